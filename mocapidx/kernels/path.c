/* The cheapest way through templates that loop, frame by frame.

   The twin of the recursion and of the tracing back in mocapidx/alignment/loops.py, bit for bit:
   float32 for the sums of columns, double for those of no column, the same order of operations. */

#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"
#include "levels.h"

enum {
    CHUNK = 128, /* columns looked at together */
    VALUES = 256, /* of a byte */
    SHIFT_FRAMES = 64, /* sums are shifted so often: they stay small enough for float32 */
    UNKNOWN = -1,
    LATE = 1, /* the column before was better held for the second time */
    SKIP = 2, /* two columns forward, not one */
    JUMP = 4,
};

typedef struct {
    const uint64_t *words;
    Py_ssize_t frames;
    const float *tables; /* (octets, VALUES, columns) */
    int octets;
    Py_ssize_t columns;
    const int64_t *before, *two_before;
    double jump_price, unknown_price;
    int fresh; /* any column may be entered for nothing at the first frame */
    float *first, *second; /* sums of each column, before and after */
    double unknown;
    uint8_t *pointers; /* (frames, columns), or NULL: not wanted */
    int64_t *sources; /* (frames,): the column that jumps come from */
    uint8_t *unknown_jumps; /* (frames,): no template was entered by a jump */
    /* Room for the walk: */
    float *either; /* two unused values, then one a column */
    float *cost;
    Py_ssize_t *odd; /* columns that aren't reached from the one or two before them */
    Py_ssize_t odd_count;
} Walk;

INLINED float smaller(float a, float b)
{
    return a < b ? a : b;
}

INLINED void add_up_cost(const Walk *walk, uint64_t word)
{
    float *restrict cost = walk->cost;
    for (int octet = 0; octet < walk->octets; octet++, word >>= 8) {
        const float *row =
            walk->tables + (octet * VALUES + (Py_ssize_t)(word & 255)) * walk->columns;
        if (octet == 0)
            memcpy(cost, row, (size_t)walk->columns * sizeof *cost);
        else
            for (Py_ssize_t c = 0; c < walk->columns; c++)
                cost[c] += row[c];
    }
}

/* The bits of a number as a whole number that is lower where the number is: compilers take the
   minimum of whole numbers in any order, and so many at a time. Its own inverse. */
INLINED int32_t in_order(int32_t bits)
{
    return bits ^ (bits < 0 ? INT32_MAX : 0);
}

/* The lower one of both sums of each column; returns the lowest of all. */
INLINED float take_either(const float *first, const float *second, float *restrict either,
                          Py_ssize_t columns)
{
    int32_t bits, lowest = INT32_MAX;
    for (Py_ssize_t c = 0; c < columns; c++) {
        either[c] = smaller(second[c], first[c]);
        memcpy(&bits, &either[c], sizeof bits);
        bits = in_order(bits);
        lowest = bits < lowest ? bits : lowest;
    }
    lowest = in_order(lowest);
    float result;
    memcpy(&result, &lowest, sizeof result);
    return result;
}

INLINED Py_ssize_t first_with(const float *sums, Py_ssize_t columns, float lowest)
{
    Py_ssize_t c = 0;
    for (; c + CHUNK <= columns; c += CHUNK) {
        int found = 0;
        for (int i = 0; i < CHUNK; i++)
            found |= sums[c + i] == lowest;
        if (found)
            break;
    }
    while (c < columns - 1 && sums[c] != lowest)
        c++;
    return c;
}

INLINED void step(const Walk *walk, float price, uint8_t *restrict pointers)
{
    const float *either = walk->either + 2, *cost = walk->cost;
    float *restrict first = walk->first, *restrict second = walk->second;
    for (Py_ssize_t c = 0; c < walk->columns; c++) {
        const float stepped = either[c - 1], skipped = either[c - 2];
        const float went = smaller(skipped, stepped);
        if (pointers)
            pointers[c] = (uint8_t)((second[c] < first[c] ? LATE : 0) |
                                    (skipped < stepped ? SKIP : 0) | (price < went ? JUMP : 0));
        second[c] = first[c] + cost[c];
        first[c] = smaller(price, went) + cost[c];
    }
    for (Py_ssize_t i = 0; i < walk->odd_count; i++) {
        const Py_ssize_t c = walk->odd[i];
        const float stepped = either[walk->before[c]], skipped = either[walk->two_before[c]];
        const float went = smaller(skipped, stepped);
        if (pointers)
            pointers[c] = (uint8_t)((pointers[c] & LATE) | (skipped < stepped ? SKIP : 0) |
                                    (price < went ? JUMP : 0));
        first[c] = smaller(price, went) + cost[c];
    }
}

INLINED void walk_anyhow(Walk *walk)
{
    const Py_ssize_t columns = walk->columns;
    for (Py_ssize_t t = 0; t < walk->frames; t++) {
        if (t == 0 || walk->words[t] != walk->words[t - 1])
            add_up_cost(walk, walk->words[t]);
        const float lowest = take_either(walk->first, walk->second, walk->either + 2, columns);
        double best = lowest;
        const int from_unknown = walk->unknown < best;
        if (from_unknown)
            best = walk->unknown;
        const double enter = walk->fresh && t == 0 ? 0.0 : best + walk->jump_price;
        if (walk->pointers) {
            walk->sources[t] =
                from_unknown ? UNKNOWN : first_with(walk->either + 2, columns, lowest);
            walk->unknown_jumps[t] = enter < walk->unknown;
            step(walk, (float)enter, walk->pointers + t * columns);
        } else {
            step(walk, (float)enter, NULL);
        }
        walk->unknown = (enter < walk->unknown ? enter : walk->unknown) + walk->unknown_price;
        if (t % SHIFT_FRAMES == SHIFT_FRAMES - 1) {
            const float least =
                take_either(walk->first, walk->second, walk->either + 2, columns);
            for (Py_ssize_t c = 0; c < columns; c++) {
                walk->first[c] -= least;
                walk->second[c] -= least;
            }
            walk->unknown -= least;
        }
    }
}

static void walk_portable(Walk *walk)
{
    walk_anyhow(walk);
}

#if LEVELS_OF_X86

FOR("avx2")
static void walk_avx2(Walk *walk)
{
    walk_anyhow(walk);
}

FOR(AVX512_INSTRUCTIONS)
static void walk_avx512(Walk *walk)
{
    walk_anyhow(walk);
}

#endif

static void (*const walks[LEVELS])(Walk *walk) = {
    [PORTABLE] = walk_portable,
#if LEVELS_OF_X86
    [AVX512] = walk_avx512,
    [AVX2] = walk_avx2,
    [SSSE3] = walk_portable,
#endif
};

/* Get room, walk, and give the room back; -1 without memory. */
static int go(Walk *walk, int level)
{
    const size_t columns = (size_t)walk->columns;
    walk->either = malloc((columns + 2) * sizeof *walk->either);
    walk->cost = malloc(columns * sizeof *walk->cost);
    walk->odd = malloc(columns * sizeof *walk->odd);
    const int failed = !walk->either || !walk->cost || !walk->odd;
    if (!failed) {
        walk->either[0] = walk->either[1] = INFINITY;
        for (Py_ssize_t c = 0; c < walk->columns; c++)
            if (walk->before[c] != c - 1 || walk->two_before[c] != c - 2)
                walk->odd[walk->odd_count++] = c;
        walks[level](walk);
    }
    free(walk->either);
    free(walk->cost);
    free(walk->odd);
    return -failed;
}

static int all_columns(const Array *numbers, Py_ssize_t columns)
{
    const int64_t *values = numbers->view.buf;
    for (Py_ssize_t i = 0; i < numbers->length; i++)
        if (values[i] < 0 || values[i] >= columns)
            return 0;
    return 1;
}

PyDoc_STRVAR(forward_doc,
"forward(words, tables, before, two_before, jump_price, unknown_price, fresh, first, second,\n"
"        unknown, pointers, sources, unknown_jumps, level)\n"
"--\n\n"
"Go over some frames; change the sums of the columns, return that of no column.\n\n"
"words uint64 (T,), tables float32 (B, 256, C), before and two_before int64 (C,), first and\n"
"second float32 (C,). pointers uint8 (T, C), sources int64 (T,) and unknown_jumps uint8 (T,) are\n"
"filled, unless pointers is empty. level is one of levels(), None: the fastest. The lock of the interpreter is released.");

static PyObject *forward(PyObject *module, PyObject *arguments)
{
    (void)module;
    PyObject *o[9];
    Walk walk = {0};
    const char *level_name;
    if (!PyArg_ParseTuple(arguments, "OOOOddpOOdOOOz:forward", &o[0], &o[1], &o[2], &o[3],
                          &walk.jump_price, &walk.unknown_price, &walk.fresh, &o[4], &o[5],
                          &walk.unknown, &o[6], &o[7], &o[8], &level_name))
        return NULL;
    const int level = take_level(level_name);
    if (level < 0)
        return NULL;
    Array words = {0}, tables = {0}, before = {0}, two_before = {0}, first = {0}, second = {0};
    Array pointers = {0}, sources = {0}, unknown_jumps = {0};
    PyObject *result = NULL;
    if (take_array(o[0], &words, "words", UINT64, 8, 0) < 0 ||
        take_array(o[1], &tables, "tables", FLOAT32, 4, 0) < 0 ||
        take_array(o[2], &before, "before", INT64, 8, 0) < 0 ||
        take_array(o[3], &two_before, "two_before", INT64, 8, 0) < 0 ||
        take_array(o[4], &first, "first", FLOAT32, 4, 1) < 0 ||
        take_array(o[5], &second, "second", FLOAT32, 4, 1) < 0 ||
        take_array(o[6], &pointers, "pointers", UINT8, 1, 1) < 0 ||
        take_array(o[7], &sources, "sources", INT64, 8, 1) < 0 ||
        take_array(o[8], &unknown_jumps, "unknown_jumps", UINT8, 1, 1) < 0)
        goto done;
    const Py_ssize_t columns = before.length, frames = words.length;
    const Py_ssize_t table = VALUES * columns;
    if (!columns || two_before.length != columns || first.length != columns ||
        second.length != columns || !tables.length || tables.length % table ||
        tables.length / table > 8 || !all_columns(&before, columns) ||
        !all_columns(&two_before, columns) ||
        (pointers.length && (pointers.length / columns != frames || pointers.length % columns ||
                             sources.length != frames || unknown_jumps.length != frames))) {
        PyErr_SetString(PyExc_ValueError, "the arrays don't fit each other");
        goto done;
    }
    walk.words = words.view.buf;
    walk.frames = frames;
    walk.tables = tables.view.buf;
    walk.octets = (int)(tables.length / table);
    walk.columns = columns;
    walk.before = before.view.buf;
    walk.two_before = two_before.view.buf;
    walk.first = first.view.buf;
    walk.second = second.view.buf;
    walk.pointers = pointers.length ? pointers.view.buf : NULL;
    walk.sources = sources.view.buf;
    walk.unknown_jumps = unknown_jumps.view.buf;
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = go(&walk, level);
    Py_END_ALLOW_THREADS
    result = failed ? PyErr_NoMemory() : PyFloat_FromDouble(walk.unknown);
done:
    release_array(&words);
    release_array(&tables);
    release_array(&before);
    release_array(&two_before);
    release_array(&first);
    release_array(&second);
    release_array(&pointers);
    release_array(&sources);
    release_array(&unknown_jumps);
    return result;
}

PyDoc_STRVAR(trace_doc,
"trace(pointers, sources, unknown_jumps, before, two_before, column, held, columns, jumps)\n"
"--\n\n"
"Follow the pointers of some frames back from a column, -1 for none, that may be held for the\n"
"second time. Fill in columns int64 (T,) and jumps bool (T,); return column and held of the\n"
"frame before the first.");

static PyObject *trace(PyObject *module, PyObject *arguments)
{
    (void)module;
    PyObject *o[7];
    Py_ssize_t column;
    int held;
    if (!PyArg_ParseTuple(arguments, "OOOOOnpOO:trace", &o[0], &o[1], &o[2], &o[3], &o[4],
                          &column, &held, &o[5], &o[6]))
        return NULL;
    Array pointers = {0}, sources = {0}, unknown_jumps = {0}, before = {0}, two_before = {0};
    Array columns = {0}, jumps = {0};
    PyObject *result = NULL;
    if (take_array(o[0], &pointers, "pointers", UINT8, 1, 0) < 0 ||
        take_array(o[1], &sources, "sources", INT64, 8, 0) < 0 ||
        take_array(o[2], &unknown_jumps, "unknown_jumps", UINT8, 1, 0) < 0 ||
        take_array(o[3], &before, "before", INT64, 8, 0) < 0 ||
        take_array(o[4], &two_before, "two_before", INT64, 8, 0) < 0 ||
        take_array(o[5], &columns, "columns", INT64, 8, 1) < 0 ||
        take_array(o[6], &jumps, "jumps", BOOL, 1, 1) < 0)
        goto done;
    const Py_ssize_t width = before.length, frames = columns.length;
    if (!width || two_before.length != width || jumps.length != frames ||
        pointers.length / width < frames || sources.length < frames ||
        unknown_jumps.length < frames || column < UNKNOWN || column >= width ||
        (held && column == UNKNOWN)) {
        PyErr_SetString(PyExc_ValueError, "the arrays don't fit each other");
        goto done;
    }
    const uint8_t *steps = pointers.view.buf, *entered = unknown_jumps.view.buf;
    const int64_t *from = sources.view.buf;
    int64_t *path = columns.view.buf;
    uint8_t *jumped = jumps.view.buf;
    for (Py_ssize_t t = frames - 1; t >= 0; t--) {
        path[t] = column;
        jumped[t] = 0;
        if (held) {
            held = 0;
            continue;
        }
        const uint8_t *row = steps + t * width;
        int64_t next = column;
        if (column == UNKNOWN ? entered[t] : row[column] & JUMP) {
            jumped[t] = 1;
            next = from[t];
        } else if (column != UNKNOWN) {
            const Array *back = row[column] & SKIP ? &two_before : &before;
            next = ((const int64_t *)back->view.buf)[column];
        }
        if (next < UNKNOWN || next >= width) {
            PyErr_SetString(PyExc_ValueError, "a pointer leads nowhere");
            goto done;
        }
        column = (Py_ssize_t)next;
        held = column != UNKNOWN && row[column] & LATE;
    }
    result = Py_BuildValue("nO", column, held ? Py_True : Py_False);
done:
    release_array(&pointers);
    release_array(&sources);
    release_array(&unknown_jumps);
    release_array(&before);
    release_array(&two_before);
    release_array(&columns);
    release_array(&jumps);
    return result;
}

static PyMethodDef functions[] = {
    {"forward", forward, METH_VARARGS, forward_doc},
    {"trace", trace, METH_VARARGS, trace_doc},
    {"levels", name_levels, METH_NOARGS, LEVELS_DOC},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "_path",
    .m_doc = "The cheapest way through templates that loop.",
    .m_size = 0,
    .m_methods = functions,
};

PyMODINIT_FUNC PyInit__path(void)
{
    find_levels();
    return PyModuleDef_Init(&definition);
}
