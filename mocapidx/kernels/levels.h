/* Functions built several times over, each for processors with certain instructions.

   One body, INLINED, is called by a function of each level: FOR("avx2") static void ...; which of
   them runs is decided when the library is loaded. Needs Python.h. */

#ifndef MOCAPIDX_LEVELS_H
#define MOCAPIDX_LEVELS_H

#include <string.h>

#if (defined(__x86_64__) || defined(__i386__)) && defined(__GNUC__)
#define LEVELS_OF_X86 1
#define FOR(instructions) __attribute__((target(instructions)))
#define INLINED static inline __attribute__((always_inline))
#else
#define LEVELS_OF_X86 0
#define INLINED static inline
#endif

#define AVX512_INSTRUCTIONS "avx512f,avx512bw,avx512vl,avx512bitalg"

enum { AVX512, AVX2, SSSE3, PORTABLE, LEVELS }; /* the fastest first */

static const char *const level_names[LEVELS] = {"avx512", "avx2", "ssse3", "portable"};
static int level_runs[LEVELS]; /* whether this processor has it */

static void find_levels(void)
{
#if LEVELS_OF_X86
    __builtin_cpu_init();
    level_runs[AVX512] = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                         __builtin_cpu_supports("avx512vl") &&
                         __builtin_cpu_supports("avx512bitalg");
    level_runs[AVX2] = !!__builtin_cpu_supports("avx2");
    level_runs[SSSE3] = !!__builtin_cpu_supports("ssse3");
#endif
    level_runs[PORTABLE] = 1;
}

/* The level of a name, NULL: the fastest; -1 with an exception set. */
static int take_level(const char *name)
{
    for (int level = 0; level < LEVELS; level++)
        if (level_runs[level] && (!name || strcmp(name, level_names[level]) == 0))
            return level;
    PyErr_Format(PyExc_ValueError, "this processor has no '%s'", name);
    return -1;
}

#define LEVELS_DOC \
    "levels()\n--\n\nName the sets of instructions that this processor has, the fastest first."

static PyObject *name_levels(PyObject *module, PyObject *nothing)
{
    (void)module, (void)nothing;
    PyObject *names = PyList_New(0);
    for (int level = 0; names && level < LEVELS; level++) {
        if (!level_runs[level])
            continue;
        PyObject *name = PyUnicode_FromString(level_names[level]);
        if (!name || PyList_Append(names, name) < 0)
            Py_CLEAR(names);
        Py_XDECREF(name);
    }
    return names;
}

#endif
