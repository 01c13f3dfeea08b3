/* Subsequence dynamic time warping of a pattern whose every entry has a weight.

   The twin of the recursion in mocapidx/alignment/weighted.py. Costs are whole numbers below
   2**53 and each carries how far its start is from the last number of the block, so both find the
   same, in whatever order they add. */

#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"
#include "levels.h"

enum {
    SPAN = 1 << 16, /* numbers of frames in a block */
    VALUES = 256, /* of an octet */
    OCTETS = 8,
    BEFORE = 2, /* infinite frames before the first */
};

typedef struct {
    const uint8_t *ones; /* (rows, features) */
    const double *weights;
    Py_ssize_t rows, features;
    const int64_t *octets; /* (octet_count, words): of the different words */
    Py_ssize_t octet_count, words;
    const int64_t *places; /* (frames,): the word of each frame */
    Py_ssize_t frames;
    const int64_t *breaks;
    Py_ssize_t break_count;
    double *costs; /* (frames,): filled */
    /* Room: */
    double *of_words, *cost, *lines[3];
} Scan;

/* What each of the different words costs in a row. */
INLINED void find_costs(const Scan *scan, Py_ssize_t k)
{
    double tables[OCTETS][VALUES];
    const uint8_t *ones = scan->ones + k * scan->features;
    const double *weights = scan->weights + k * scan->features;
    for (Py_ssize_t octet = 0; octet < scan->octet_count; octet++) {
        double *table = tables[octet];
        const Py_ssize_t first = 8 * octet;
        table[0] = 0.0;
        for (int bit = 0; bit < 8; bit++) {
            const Py_ssize_t f = first + bit;
            const int counts = f < scan->features;
            const double here = counts ? SPAN * weights[f] : 0.0;
            /* A feature costs its weight where it isn't what it should be. */
            const double when_one = counts && ones[f] ? 0.0 : here;
            const double when_zero = counts && ones[f] ? here : 0.0;
            for (int value = 0; value < 1 << bit; value++) {
                table[value | 1 << bit] = table[value] + when_one;
                table[value] += when_zero;
            }
        }
    }
    double *restrict of_words = scan->of_words;
    for (Py_ssize_t word = 0; word < scan->words; word++) {
        double sum = 0.0;
        for (Py_ssize_t octet = 0; octet < scan->octet_count; octet++)
            sum += tables[octet][scan->octets[octet * scan->words + word]];
        of_words[word] = sum;
    }
}

INLINED double smaller(double a, double b)
{
    return a < b ? a : b;
}

INLINED void scan_anyhow(Scan *scan)
{
    const Py_ssize_t frames = scan->frames;
    double *here = scan->lines[0], *up = scan->lines[1], *two_up = scan->lines[2];
    for (Py_ssize_t t = 0; t < frames + BEFORE; t++)
        here[t] = up[t] = two_up[t] = INFINITY;
    for (Py_ssize_t k = 0; k < scan->rows; k++) {
        find_costs(scan, k);
        double *restrict cost = scan->cost, *restrict line = here + BEFORE;
        const double *above = up + BEFORE, *two_above = two_up + BEFORE;
        for (Py_ssize_t t = 0; t < frames; t++)
            cost[t] = scan->of_words[scan->places[t]];
        if (k == 0)
            for (Py_ssize_t t = 0; t < frames; t++)
                line[t] = cost[t] + (double)(SPAN - 1 - t);
        else
            for (Py_ssize_t t = 0; t < frames; t++) {
                const double turned = smaller(two_above[t - 1] + cost[t], above[t - 2]);
                line[t] = smaller(turned + SPAN, above[t - 1]) + cost[t];
            }
        for (Py_ssize_t i = 0; i < scan->break_count; i++)
            line[scan->breaks[i]] = INFINITY;
        double *free_line = two_up;
        two_up = up;
        up = here;
        here = free_line;
    }
    memcpy(scan->costs, up + BEFORE, (size_t)frames * sizeof *up);
}

static void scan_portable(Scan *scan)
{
    scan_anyhow(scan);
}

#if LEVELS_OF_X86

FOR("avx2")
static void scan_avx2(Scan *scan)
{
    scan_anyhow(scan);
}

FOR(AVX512_INSTRUCTIONS)
static void scan_avx512(Scan *scan)
{
    scan_anyhow(scan);
}

#endif

static void (*const scans[LEVELS])(Scan *scan) = {
    [PORTABLE] = scan_portable,
#if LEVELS_OF_X86
    [AVX512] = scan_avx512,
    [AVX2] = scan_avx2,
    [SSSE3] = scan_portable,
#endif
};

/* Get room, scan, and give the room back; -1 without memory. */
static int go(Scan *scan, int level)
{
    const size_t frames = (size_t)scan->frames + BEFORE;
    double *room = malloc((4 * frames + (size_t)scan->words) * sizeof *room);
    if (!room)
        return -1;
    for (int line = 0; line < 3; line++)
        scan->lines[line] = room + (size_t)line * frames;
    scan->cost = room + 3 * frames;
    scan->of_words = room + 4 * frames;
    scans[level](scan);
    free(room);
    return 0;
}

static int all_below(const Array *numbers, int64_t limit)
{
    const int64_t *values = numbers->view.buf;
    for (Py_ssize_t i = 0; i < numbers->length; i++)
        if (values[i] < 0 || values[i] >= limit)
            return 0;
    return 1;
}

PyDoc_STRVAR(last_row_doc,
"last_row(ones, weights, features, octets, words, places, breaks, costs, level)\n"
"--\n\n"
"Fill costs (float64, one a frame) with the last row of the accumulated costs.\n\n"
"ones (bool) and weights (float64) have K times the number of features, octets (int64) B times the\n"
"number of different words, the lowest eight features first; places and breaks (int64) are below the\n"
"numbers of words and frames. level is one of levels(), None: the fastest. The lock of the\n"
"interpreter is released.");

static PyObject *last_row(PyObject *module, PyObject *arguments)
{
    (void)module;
    PyObject *o[6];
    const char *level_name;
    Scan scan = {0};
    if (!PyArg_ParseTuple(arguments, "OOnOnOOOz:last_row", &o[0], &o[1], &scan.features, &o[2],
                          &scan.words, &o[3], &o[4], &o[5], &level_name))
        return NULL;
    const int level = take_level(level_name);
    if (level < 0)
        return NULL;
    Array ones = {0}, weights = {0}, octets = {0}, places = {0}, breaks = {0}, costs = {0};
    PyObject *result = NULL;
    if (take_array(o[0], &ones, "ones", BOOL, 1, 0) < 0 ||
        take_array(o[1], &weights, "weights", FLOAT64, 8, 0) < 0 ||
        take_array(o[2], &octets, "octets", INT64, 8, 0) < 0 ||
        take_array(o[3], &places, "places", INT64, 8, 0) < 0 ||
        take_array(o[4], &breaks, "breaks", INT64, 8, 0) < 0 ||
        take_array(o[5], &costs, "costs", FLOAT64, 8, 1) < 0)
        goto done;
    if (scan.features < 1 || scan.features > 8 * OCTETS || !ones.length ||
        ones.length % scan.features || weights.length != ones.length || scan.words < 0 ||
        (scan.words ? octets.length % scan.words : octets.length) ||
        (scan.words && octets.length / scan.words != (scan.features + 7) / 8) ||
        places.length != costs.length || places.length > SPAN) {
        PyErr_SetString(PyExc_ValueError, "the arrays don't fit each other");
        goto done;
    }
    if (!all_below(&octets, VALUES) || !all_below(&places, scan.words) ||
        !all_below(&breaks, places.length)) {
        PyErr_SetString(PyExc_ValueError, "octets, places or breaks out of range");
        goto done;
    }
    scan.ones = ones.view.buf;
    scan.weights = weights.view.buf;
    scan.rows = ones.length / scan.features;
    scan.octets = octets.view.buf;
    scan.octet_count = (scan.features + 7) / 8;
    scan.places = places.view.buf;
    scan.frames = places.length;
    scan.breaks = breaks.view.buf;
    scan.break_count = breaks.length;
    scan.costs = costs.view.buf;
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = go(&scan, level);
    Py_END_ALLOW_THREADS
    result = failed ? PyErr_NoMemory() : Py_NewRef(Py_None);
done:
    release_array(&ones);
    release_array(&weights);
    release_array(&octets);
    release_array(&places);
    release_array(&breaks);
    release_array(&costs);
    return result;
}

static PyMethodDef functions[] = {
    {"last_row", last_row, METH_VARARGS, last_row_doc},
    {"levels", name_levels, METH_NOARGS, LEVELS_DOC},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "_weighted",
    .m_doc = "Weighted patterns against feature words.",
    .m_size = 0,
    .m_methods = functions,
};

PyMODINIT_FUNC PyInit__weighted(void)
{
    find_levels();
    return PyModuleDef_Init(&definition);
}
