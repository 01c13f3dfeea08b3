/* Where the nodes of a skeleton are: forward kinematics over many frames.

   The twin of `_points` in mocapidx/skeleton/kinematics.py, bit for bit: the same products and
   sums in the same order. Cosines and sines come from NumPy, which both take them from. All is
   laid out with time last, in blocks of frames that stay in the cache. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"
#include "levels.h"

#define FLOAT64 "d"

enum { BLOCK = 64 }; /* frames */
enum { PARENT, TURNER, TURNS, MOVED, COLUMNS }; /* of a node; -1: none */
enum { NOT, OWN, CHANGED }; /* TURNS: no matrix is needed; has one; begins with a change of axes */

typedef double Row[BLOCK];

typedef struct {
    Py_ssize_t count, frames, wanted_count;
    const int64_t *nodes; /* (count, COLUMNS), parents first */
    const double *changes; /* (count, 3, 3) */
    const double *offsets; /* (count, 3) */
    const int64_t *bounds; /* node n has the rotations from bounds[n] to bounds[n + 1] */
    const int64_t *axes; /* of each rotation */
    const double *cosines, *sines; /* (rotations, frames) */
    const double *moved; /* offsets that change, (any, 3, frames) */
    const int64_t *wanted; /* (wanted_count,), -1: stays as it is */
    double *positions; /* (frames, wanted_count, 3) */
    Row (*matrices)[9], (*points)[3]; /* of all nodes and, first, of what the root hangs on */
} Rig;

/* matrix = before * change, the change being one constant matrix. */
INLINED void change(Row *restrict matrix, const Row *restrict before, const double *restrict by)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int t = 0; t < BLOCK; t++)
                matrix[3 * i + j][t] = before[3 * i][t] * by[j] + before[3 * i + 1][t] * by[3 + j] +
                                       before[3 * i + 2][t] * by[6 + j];
}

/* matrix = matrix * rotation about one of the axes. */
INLINED void turn(Row *restrict matrix, int axis, const double *restrict cosine,
                  const double *restrict sine, Py_ssize_t frames)
{
    const int first = (axis + 1) % 3, second = (axis + 2) % 3;
    for (int i = 0; i < 3; i++) {
        double *restrict one = matrix[3 * i + first], *restrict other = matrix[3 * i + second];
        for (Py_ssize_t t = 0; t < frames; t++) {
            const double crossed = one[t] * sine[t];
            one[t] = one[t] * cosine[t] + other[t] * sine[t];
            other[t] = other[t] * cosine[t] - crossed;
        }
    }
}

INLINED void place_block(const Rig *rig, Py_ssize_t start)
{
    const Py_ssize_t left = rig->frames - start, frames = left < BLOCK ? left : BLOCK;
    for (Py_ssize_t n = 0; n < rig->count; n++) {
        const int64_t *node = rig->nodes + COLUMNS * n;
        Row *matrix = rig->matrices[n + 1], *point = rig->points[n + 1];
        const Row *before = (const Row *)rig->matrices[node[PARENT] + 1];
        if (node[TURNS] == CHANGED)
            change(matrix, before, rig->changes + 9 * n);
        else if (node[TURNS] == OWN)
            memcpy(matrix, before, sizeof *rig->matrices);
        if (node[TURNS] != NOT)
            for (int64_t r = rig->bounds[n]; r < rig->bounds[n + 1]; r++)
                turn(matrix, (int)rig->axes[r], rig->cosines + r * rig->frames + start,
                     rig->sines + r * rig->frames + start, frames);
        Row offset[3];
        for (int i = 0; i < 3; i++)
            if (node[MOVED] >= 0)
                memcpy(offset[i], rig->moved + (3 * node[MOVED] + i) * rig->frames + start,
                       (size_t)frames * sizeof(double));
            else
                for (Py_ssize_t t = 0; t < frames; t++)
                    offset[i][t] = rig->offsets[3 * n + i];
        const Row *base = (const Row *)rig->points[node[PARENT] + 1];
        const Row *by = (const Row *)rig->matrices[node[TURNER] + 1];
        for (int i = 0; i < 3; i++)
            if (node[TURNER] >= 0)
                for (Py_ssize_t t = 0; t < frames; t++)
                    point[i][t] = base[i][t] + (by[3 * i][t] * offset[0][t] +
                                                by[3 * i + 1][t] * offset[1][t] +
                                                by[3 * i + 2][t] * offset[2][t]);
            else
                for (Py_ssize_t t = 0; t < frames; t++)
                    point[i][t] = base[i][t] + offset[i][t];
    }
    for (Py_ssize_t k = 0; k < rig->wanted_count; k++) {
        if (rig->wanted[k] < 0)
            continue;
        const Row *point = (const Row *)rig->points[rig->wanted[k] + 1];
        double *position = rig->positions + 3 * (rig->wanted_count * start + k);
        for (Py_ssize_t t = 0; t < frames; t++)
            for (int i = 0; i < 3; i++)
                position[3 * rig->wanted_count * t + i] = point[i][t];
    }
}

static void place_block_portable(const Rig *rig, Py_ssize_t start)
{
    place_block(rig, start);
}

#if LEVELS_OF_X86

FOR("avx2")
static void place_block_avx2(const Rig *rig, Py_ssize_t start)
{
    place_block(rig, start);
}

FOR(AVX512_INSTRUCTIONS)
static void place_block_avx512(const Rig *rig, Py_ssize_t start)
{
    place_block(rig, start);
}

#else
#define place_block_avx2 place_block_portable
#define place_block_avx512 place_block_portable
#endif

/* Place all nodes; -1 without memory. */
static int place_all(Rig *rig, int level)
{
    const size_t rooms = (size_t)rig->count + 1;
    /* zeroed: beyond the last frame of a block there is nothing to wonder at */
    rig->matrices = calloc(rooms, sizeof *rig->matrices);
    rig->points = calloc(rooms, sizeof *rig->points);
    if (rig->matrices && rig->points) {
        for (int i = 0; i < 9; i += 4)
            for (int t = 0; t < BLOCK; t++)
                rig->matrices[0][i][t] = 1.0;
        void (*place)(const Rig *, Py_ssize_t) = level == AVX512 ? place_block_avx512
                                                 : level == AVX2 ? place_block_avx2
                                                                 : place_block_portable;
        for (Py_ssize_t start = 0; start < rig->frames; start += BLOCK)
            place(rig, start);
    }
    const int placed = rig->matrices && rig->points;
    free(rig->matrices);
    free(rig->points);
    return placed ? 0 : -1;
}

/* Whether all numbers of a rig lead to others that are there. */
static int leads_nowhere_else(const Rig *rig, Py_ssize_t rotations, Py_ssize_t moved)
{
    for (Py_ssize_t n = 0; n < rig->count; n++) {
        const int64_t *node = rig->nodes + COLUMNS * n;
        if (node[PARENT] < -1 || node[PARENT] >= n || node[TURNER] < -1 || node[TURNER] > n ||
            node[TURNS] < NOT || node[TURNS] > CHANGED || node[MOVED] < -1 || node[MOVED] >= moved ||
            rig->bounds[n] > rig->bounds[n + 1])
            return 0;
    }
    for (Py_ssize_t r = 0; r < rotations; r++)
        if (rig->axes[r] < 0 || rig->axes[r] > 2)
            return 0;
    for (Py_ssize_t k = 0; k < rig->wanted_count; k++)
        if (rig->wanted[k] < -1 || rig->wanted[k] >= rig->count)
            return 0;
    return rig->bounds[0] == 0 && rig->bounds[rig->count] == rotations;
}

PyDoc_STRVAR(place_nodes_doc,
"place_nodes(nodes, changes, offsets, bounds, axes, cosines, sines, moved, wanted, positions,\n"
"            level=None)\n"
"--\n\n"
"Fill positions (frames, wanted, 3) with the points of the wanted nodes.\n\n"
"A row of nodes has the parent, the node that turns the offset, whether it has a matrix (0 no,\n"
"1 yes, 2 with a change of axes before), and the row of moved; -1 is none. Node n has the\n"
"rotations from bounds[n] to bounds[n + 1], about axes. The lock of the interpreter is released.");

static PyObject *place_nodes(PyObject *module, PyObject *arguments)
{
    (void)module;
    enum { NODES, CHANGES, OFFSETS, BOUNDS, AXES, COSINES, SINES, MOVES, WANTED, POSITIONS, ALL };
    static const char *const names[ALL] = {"nodes", "changes", "offsets", "bounds", "axes",
                                           "cosines", "sines", "moved", "wanted", "positions"};
    PyObject *objects[ALL];
    const char *name = NULL;
    if (!PyArg_ParseTuple(arguments, "OOOOOOOOOO|z:place_nodes", &objects[0], &objects[1],
                          &objects[2], &objects[3], &objects[4], &objects[5], &objects[6],
                          &objects[7], &objects[8], &objects[9], &name))
        return NULL;
    const int level = take_level(name);
    if (level < 0)
        return NULL;
    Array arrays[ALL];
    memset(arrays, 0, sizeof arrays);
    PyObject *result = NULL;
    for (int i = 0; i < ALL; i++) {
        const int whole = i == NODES || i == BOUNDS || i == AXES || i == WANTED;
        if (take_array(objects[i], &arrays[i], names[i], whole ? INT64 : FLOAT64, 8,
                       i == POSITIONS) < 0)
            goto done;
    }
    Rig rig = {.count = arrays[NODES].length / COLUMNS,
               .wanted_count = arrays[WANTED].length,
               .nodes = arrays[NODES].view.buf,
               .changes = arrays[CHANGES].view.buf,
               .offsets = arrays[OFFSETS].view.buf,
               .bounds = arrays[BOUNDS].view.buf,
               .axes = arrays[AXES].view.buf,
               .cosines = arrays[COSINES].view.buf,
               .sines = arrays[SINES].view.buf,
               .moved = arrays[MOVES].view.buf,
               .wanted = arrays[WANTED].view.buf,
               .positions = arrays[POSITIONS].view.buf};
    const Py_ssize_t rotations = arrays[AXES].length, wanted = rig.wanted_count;
    rig.frames = wanted ? arrays[POSITIONS].length / (3 * wanted) : 0;
    const Py_ssize_t frames = rig.frames;
    const Py_ssize_t moved = frames ? arrays[MOVES].length / (3 * frames) : 0;
    if (arrays[NODES].length != COLUMNS * rig.count || arrays[CHANGES].length != 9 * rig.count ||
        arrays[OFFSETS].length != 3 * rig.count || arrays[BOUNDS].length != rig.count + 1 ||
        arrays[COSINES].length != rotations * frames || arrays[SINES].length != rotations * frames ||
        arrays[MOVES].length != 3 * moved * frames ||
        arrays[POSITIONS].length != 3 * wanted * frames ||
        !leads_nowhere_else(&rig, rotations, moved)) {
        PyErr_SetString(PyExc_ValueError, "the arrays don't fit each other");
        goto done;
    }
    int placed;
    Py_BEGIN_ALLOW_THREADS
    placed = place_all(&rig, level);
    Py_END_ALLOW_THREADS
    result = placed < 0 ? PyErr_NoMemory() : Py_NewRef(Py_None);
done:
    for (int i = 0; i < ALL; i++)
        release_array(&arrays[i]);
    return result;
}

static PyMethodDef methods[] = {
    {"place_nodes", place_nodes, METH_VARARGS, place_nodes_doc},
    {"levels", name_levels, METH_NOARGS, LEVELS_DOC},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "_kinematics",
    .m_doc = "Forward kinematics.",
    .m_size = 0,
    .m_methods = methods,
};

PyMODINIT_FUNC PyInit__kinematics(void)
{
    find_levels();
    return PyModuleDef_Init(&definition);
}
