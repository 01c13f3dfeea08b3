/* Classical dynamic time warping of many sequences with one reference.

   The twin of mocapidx/alignment/dtw.py. Entries are whole units of 2**-24 and sums are exact, so
   both find the same cost and, by the same rule for ties, the same path. */

#include <Python.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"
#include "levels.h"

enum {
    MOST_FEATURES = 64,
    LONGEST = 4096, /* frames of a sequence */
    DIAGONAL = 0, REFERENCE = 1, OTHER = 2, /* the steps, as they win ties */
};
#define LARGEST (INT32_C(1) << 24) /* entry, so that 64 differences stay below 2**31 */
#define FAR (INT64_C(1) << 60)

typedef struct {
    const int32_t *reference, *other; /* (rows, features), (columns, features) */
    Py_ssize_t rows, columns, features;
    int64_t *in_reference, *in_other; /* (rows + columns - 1,) */
    /* Room for the longest: */
    int32_t *turned; /* (features, columns): the other, those features that vary, one a row */
    int32_t *varying; /* (rows, features): the reference, likewise */
    int32_t *costs; /* (columns,) of one row */
    int64_t *sums; /* (columns + 1,) of one row, behind what lies before the first column */
    uint8_t *steps; /* (rows, columns) */
} Pair;

/* Keep the features that differ at all between any frames of both; give their number. */
static Py_ssize_t keep_varying(const Pair *pair)
{
    Py_ssize_t kept = 0;
    for (Py_ssize_t f = 0; f < pair->features; f++) {
        int32_t different = 0;
        for (Py_ssize_t k = 0; k < pair->rows; k++) {
            const int32_t entry = pair->reference[k * pair->features + f];
            pair->varying[k * pair->features + kept] = entry;
            different |= entry ^ pair->reference[f];
        }
        for (Py_ssize_t l = 0; l < pair->columns; l++) {
            const int32_t entry = pair->other[l * pair->features + f];
            pair->turned[kept * pair->columns + l] = entry;
            different |= entry ^ pair->reference[f];
        }
        kept += different != 0;
    }
    return kept;
}

INLINED int64_t align_anyhow(const Pair *pair)
{
    const Py_ssize_t columns = pair->columns, kept = keep_varying(pair);
    int32_t *restrict costs = pair->costs;
    int64_t *restrict sums = pair->sums + 1;
    for (Py_ssize_t l = -1; l < columns; l++)
        sums[l] = FAR;
    for (Py_ssize_t k = 0; k < pair->rows; k++) {
        memset(costs, 0, (size_t)columns * sizeof *costs);
        for (Py_ssize_t f = 0; f < kept; f++) {
            const int32_t *restrict values = pair->turned + f * columns;
            const int32_t value = pair->varying[k * pair->features + f];
            for (Py_ssize_t l = 0; l < columns; l++) {
                const int32_t gap = values[l] - value;
                costs[l] += gap < 0 ? -gap : gap;
            }
        }
        uint8_t *restrict steps = pair->steps + k * columns;
        int64_t diagonal = k ? FAR : 0, left = FAR; /* nothing lies before the first column */
        for (Py_ssize_t l = 0; l < columns; l++) {
            const int64_t up = sums[l];
            const int64_t best = up < diagonal ? up : diagonal;
            const uint8_t step = up < diagonal ? REFERENCE : DIAGONAL;
            steps[l] = left < best ? OTHER : step;
            left = (left < best ? left : best) + costs[l];
            sums[l] = left;
            diagonal = up;
        }
    }
    return sums[columns - 1];
}

static int64_t align_portable(const Pair *pair)
{
    return align_anyhow(pair);
}

#if LEVELS_OF_X86

FOR("avx2")
static int64_t align_avx2(const Pair *pair)
{
    return align_anyhow(pair);
}

FOR(AVX512_INSTRUCTIONS)
static int64_t align_avx512(const Pair *pair)
{
    return align_anyhow(pair);
}

#endif

static int64_t (*const aligners[LEVELS])(const Pair *pair) = {
    [PORTABLE] = align_portable,
#if LEVELS_OF_X86
    [AVX512] = align_avx512,
    [AVX2] = align_avx2,
    [SSSE3] = align_portable,
#endif
};

/* Walk the path from its end; it comes to stand at the beginning of its room. */
static Py_ssize_t walk_back(const Pair *pair)
{
    Py_ssize_t k = pair->rows - 1, l = pair->columns - 1, place = k + l;
    pair->in_reference[place] = k;
    pair->in_other[place] = l;
    while (k || l) {
        const uint8_t step = pair->steps[k * pair->columns + l];
        k -= step != OTHER;
        l -= step != REFERENCE;
        place--;
        pair->in_reference[place] = k;
        pair->in_other[place] = l;
    }
    const Py_ssize_t length = pair->rows + pair->columns - 1 - place;
    memmove(pair->in_reference, pair->in_reference + place, (size_t)length * sizeof(int64_t));
    memmove(pair->in_other, pair->in_other + place, (size_t)length * sizeof(int64_t));
    return length;
}

/* Align all others; -1 without memory. */
static int align_all(Pair *pair, const int32_t *others, const int64_t *bounds, Py_ssize_t count,
                     int64_t *totals, int64_t *lengths, int level)
{
    size_t longest = 1, rows = (size_t)pair->rows, features = (size_t)pair->features;
    for (Py_ssize_t i = 0; i < count; i++)
        if ((size_t)(bounds[i + 1] - bounds[i]) > longest)
            longest = (size_t)(bounds[i + 1] - bounds[i]);
    pair->turned = malloc(longest * features * sizeof *pair->turned);
    pair->varying = malloc(rows * features * sizeof *pair->varying);
    pair->costs = malloc(longest * sizeof *pair->costs);
    pair->sums = malloc((longest + 1) * sizeof *pair->sums);
    pair->steps = malloc(rows * longest);
    const int failed =
        !pair->turned || !pair->varying || !pair->costs || !pair->sums || !pair->steps;
    for (Py_ssize_t i = 0; i < count && !failed; i++) {
        pair->other = others + bounds[i] * pair->features;
        pair->columns = (Py_ssize_t)(bounds[i + 1] - bounds[i]);
        totals[i] = aligners[level](pair);
        lengths[i] = walk_back(pair);
        pair->in_reference += lengths[i];
        pair->in_other += lengths[i];
    }
    free(pair->turned);
    free(pair->varying);
    free(pair->costs);
    free(pair->sums);
    free(pair->steps);
    return -failed;
}

static int in_range(const Array *entries)
{
    const int32_t *values = entries->view.buf;
    int32_t lowest = 0, highest = 0;
    for (Py_ssize_t i = 0; i < entries->length; i++) {
        lowest = values[i] < lowest ? values[i] : lowest;
        highest = values[i] > highest ? values[i] : highest;
    }
    return lowest >= 0 && highest <= LARGEST;
}

PyDoc_STRVAR(align_doc,
"align(reference, others, features, bounds, totals, lengths, in_reference, in_other, level)\n"
"--\n\n"
"Align sequences of entries from 0 to 2**24 (int32) with a reference.\n\n"
"reference has K times, others together R times the number of features; sequence n has the rows\n"
"bounds[n] to bounds[n + 1] (int64). Filled (int64): totals and lengths of the paths, and the\n"
"paths one after the other, for which there must be room for R + (K - 1) N frames. level is one\n"
"of levels(), None: the fastest. The lock of the interpreter is released.");

static PyObject *align(PyObject *module, PyObject *arguments)
{
    (void)module;
    PyObject *o[7];
    Py_ssize_t features;
    const char *level_name;
    if (!PyArg_ParseTuple(arguments, "OOnOOOOOz:align", &o[0], &o[1], &features, &o[2], &o[3],
                          &o[4], &o[5], &o[6], &level_name))
        return NULL;
    const int level = take_level(level_name);
    if (level < 0)
        return NULL;
    Array reference = {0}, others = {0}, bounds = {0}, totals = {0}, lengths = {0};
    Array in_reference = {0}, in_other = {0};
    PyObject *result = NULL;
    if (take_array(o[0], &reference, "reference", INT32, 4, 0) < 0 ||
        take_array(o[1], &others, "others", INT32, 4, 0) < 0 ||
        take_array(o[2], &bounds, "bounds", INT64, 8, 0) < 0 ||
        take_array(o[3], &totals, "totals", INT64, 8, 1) < 0 ||
        take_array(o[4], &lengths, "lengths", INT64, 8, 1) < 0 ||
        take_array(o[5], &in_reference, "in_reference", INT64, 8, 1) < 0 ||
        take_array(o[6], &in_other, "in_other", INT64, 8, 1) < 0)
        goto done;
    if (features < 1 || features > MOST_FEATURES || !reference.length ||
        reference.length % features || others.length % features ||
        reference.length / features > LONGEST ||
        !divide(&bounds, others.length / features, 1, LONGEST)) {
        PyErr_SetString(PyExc_ValueError, "no sequences of so many features");
        goto done;
    }
    const Py_ssize_t rows = reference.length / features, count = bounds.length - 1;
    const Py_ssize_t room = others.length / features + (rows - 1) * count;
    if (totals.length != count || lengths.length != count || in_reference.length < room ||
        in_other.length < room || !in_range(&reference) || !in_range(&others)) {
        PyErr_SetString(PyExc_ValueError, "too little room, or entries out of range");
        goto done;
    }
    Pair pair = {
        .reference = reference.view.buf,
        .rows = rows,
        .features = features,
        .in_reference = in_reference.view.buf,
        .in_other = in_other.view.buf,
    };
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = align_all(&pair, others.view.buf, bounds.view.buf, count, totals.view.buf,
                       lengths.view.buf, level);
    Py_END_ALLOW_THREADS
    result = failed ? PyErr_NoMemory() : Py_NewRef(Py_None);
done:
    release_array(&reference);
    release_array(&others);
    release_array(&bounds);
    release_array(&totals);
    release_array(&lengths);
    release_array(&in_reference);
    release_array(&in_other);
    return result;
}

static PyMethodDef functions[] = {
    {"align", align, METH_VARARGS, align_doc},
    {"levels", name_levels, METH_NOARGS, LEVELS_DOC},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "_dtw",
    .m_doc = "Classical dynamic time warping.",
    .m_size = 0,
    .m_methods = functions,
};

PyMODINIT_FUNC PyInit__dtw(void)
{
    find_levels();
    return PyModuleDef_Init(&definition);
}
