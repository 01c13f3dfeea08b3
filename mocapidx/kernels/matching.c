/* Subsequence dynamic time warping of quantised templates against packed feature words.

   The twin of mocapidx/alignment/subsequence.py, bit for bit: float32 throughout, the same
   order of operations. All rows of all templates go over a block of frames while it lies in the
   first-level cache. */

#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"
#include "levels.h"
#include "template_rows.h"

/* The first of ascending numbers that is not below a limit; stays inside whatever they are. */
static Py_ssize_t first_from(const int64_t *numbers, Py_ssize_t low, Py_ssize_t high, int64_t limit)
{
    while (low < high) {
        Py_ssize_t middle = low + (high - low) / 2;
        if (numbers[middle] < limit)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

typedef struct {
    const uint64_t *ones, *care; /* rows of all templates, one after the other */
    const int64_t *bounds; /* template m has the rows from bounds[m] */
    Py_ssize_t templates;
    const uint64_t *words;
    Py_ssize_t frames;
    const int64_t *breaks; /* of all templates, one after the other */
    const int64_t *break_bounds;
    int weighted;
    float *costs; /* (templates, frames) */
} Matching;

/* Let one template go over a block; `carried` has the last two values of each of its rows. The
   costs are written only if they are `wanted`. */
static void match_block(const Matching *matching, Py_ssize_t m, Py_ssize_t start,
                        Py_ssize_t frames, int wanted, const Level *level, Room *room,
                        float (*carried)[2])
{
    const Py_ssize_t rows = (Py_ssize_t)(matching->bounds[m + 1] - matching->bounds[m]);
    const uint64_t *ones = matching->ones + matching->bounds[m];
    const uint64_t *care = matching->care + matching->bounds[m];
    const int64_t *breaks = matching->breaks;
    const Py_ssize_t end_of_breaks = (Py_ssize_t)matching->break_bounds[m + 1];
    const Py_ssize_t first_break =
        first_from(breaks, (Py_ssize_t)matching->break_bounds[m], end_of_breaks, start);
    const Py_ssize_t last_break =
        first_from(breaks, first_break, end_of_breaks, start + frames);
    float *here = room->rows[0] + BEFORE, *up = room->rows[1] + BEFORE;
    float *two_up = room->rows[2] + BEFORE;
    for (Py_ssize_t t = -2; t < frames; t++)
        up[t] = INFINITY; /* the row above the first is two rows above the second */
    for (Py_ssize_t k = 0; k < rows; k++) {
        if (k == 0 || ones[k] != ones[k - 1] || care[k] != care[k - 1]) {
            const Bytes row = bytes_of(ones[k], care[k]);
            level->count(room, &row, room->counts, frames);
        }
        level->add_row(room->counts, bits_set(care[k]), k ? up : NULL, two_up, here, frames,
                       matching->weighted);
        for (Py_ssize_t i = first_break; i < last_break; i++)
            if (breaks[i] >= start && breaks[i] - start < frames)
                here[breaks[i] - start] = INFINITY;
        here[-2] = carried[k][0];
        here[-1] = carried[k][1];
        carried[k][0] = here[frames - 2];
        carried[k][1] = here[frames - 1];
        float *free_row = two_up;
        two_up = up;
        up = here;
        here = free_row;
    }
    if (!wanted)
        return;
    const float length = (float)rows;
    float *costs = matching->costs + m * matching->frames + start;
    for (Py_ssize_t t = 0; t < frames; t++)
        costs[t] = up[t] / length;
}

/* Fill the costs of all templates from `begin` up to `end`; -1 without memory. */
static int match_frames(const Matching *matching, Py_ssize_t begin, Py_ssize_t end,
                        const Level *level)
{
    const Py_ssize_t rows = (Py_ssize_t)matching->bounds[matching->templates];
    Py_ssize_t longest = 0;
    for (Py_ssize_t m = 0; m < matching->templates; m++) {
        const Py_ssize_t own = (Py_ssize_t)(matching->bounds[m + 1] - matching->bounds[m]);
        longest = own > longest ? own : longest;
    }
    void *memory = malloc(sizeof(Room) + 64);
    float(*carried)[2] = malloc((size_t)(rows ? rows : 1) * sizeof *carried);
    if (!memory || !carried) {
        free(memory);
        free(carried);
        return -1;
    }
    Room *room = (Room *)(((uintptr_t)memory + 63) & ~(uintptr_t)63);
    memset(room, 0, sizeof *room);
    for (Py_ssize_t k = 0; k < rows; k++)
        carried[k][0] = carried[k][1] = INFINITY;
    /* No match is longer than two frames a row, less two. */
    const Py_ssize_t reach = longest ? 2 * (longest - 1) : 0;
    Py_ssize_t start = begin > reach ? begin - reach : 0;
    while (start < end) {
        const int wanted = start >= begin;
        const Py_ssize_t stop = wanted ? end : begin;
        const Py_ssize_t frames = stop - start < BLOCK ? stop - start : BLOCK;
        cut_planes(room, matching->words + start, frames);
        for (Py_ssize_t m = 0; m < matching->templates; m++)
            match_block(matching, m, start, frames, wanted, level, room,
                        carried + matching->bounds[m]);
        start += frames;
    }
    free(memory);
    free(carried);
    return 0;
}

/* The first frame of the best match of the first template that ends at a frame, or -1: all sums in
   reach of it, and the way back through them. `sums` has rows of `stride` values, one more than the
   template, and all that this function doesn't write is infinite. */
static int64_t find_start(const Matching *matching, Py_ssize_t end, const Level *level, Room *room,
                          float *sums, Py_ssize_t stride)
{
    const Py_ssize_t rows = (Py_ssize_t)matching->bounds[1];
    const Py_ssize_t reach = 2 * (rows - 1), low = end > reach ? end - reach : 0;
    const Py_ssize_t frames = end - low + 1;
    const uint64_t *words = matching->words + low;
    float *first_row = sums + stride + BEFORE;
    cut_planes(room, words, frames);
    const Py_ssize_t break_count = (Py_ssize_t)matching->break_bounds[1];
    const Py_ssize_t first_break = first_from(matching->breaks, 0, break_count, low);
    for (Py_ssize_t k = 0; k < rows; k++) {
        float *here = first_row + k * stride;
        const Bytes row = bytes_of(matching->ones[k], matching->care[k]);
        level->count(room, &row, room->counts, frames);
        level->add_row(room->counts, bits_set(matching->care[k]), k ? here - stride : NULL,
                       k ? here - 2 * stride : NULL, here, frames, matching->weighted);
        for (Py_ssize_t i = first_break; i < break_count && matching->breaks[i] <= end; i++)
            if (matching->breaks[i] >= low)
                here[matching->breaks[i] - low] = INFINITY;
    }
    Py_ssize_t k = rows - 1, t = frames - 1;
    if (isinf(first_row[k * stride + t]))
        return -1;
    while (k > 0 && t >= 0) {
        const float *up = first_row + (k - 1) * stride + t, *two_up = up - stride;
        float skipped = two_up[-1], best = up[-1];
        if (matching->weighted) {
            const uint64_t care = matching->care[k];
            const Reciprocal share = reciprocal(bits_set(care));
            const float n = (float)bits_set((words[t] ^ matching->ones[k]) & care);
            skipped += n * share.high + n * share.low;
        }
        int up_by = 1, left_by = 1;
        if (up[-2] < best) {
            best = up[-2];
            left_by = 2;
        }
        if (skipped < best) {
            up_by = 2;
            left_by = 1;
        }
        k -= up_by;
        t -= left_by;
    }
    return k == 0 && t >= 0 ? low + t : -1;
}

/* Fill the starts of the matches that end at some frames; -1 without memory. */
static int find_starts(const Matching *matching, const int64_t *ends, Py_ssize_t count,
                       int64_t *starts, const Level *level)
{
    const Py_ssize_t rows = (Py_ssize_t)matching->bounds[1], stride = BEFORE + 2 * rows;
    const size_t values = (size_t)(rows + 1) * (size_t)stride;
    void *memory = malloc(sizeof(Room) + 64);
    float *sums = malloc(values * sizeof *sums);
    if (memory && sums) {
        Room *room = (Room *)(((uintptr_t)memory + 63) & ~(uintptr_t)63);
        memset(room, 0, sizeof *room);
        for (size_t i = 0; i < values; i++)
            sums[i] = INFINITY;
        for (Py_ssize_t i = 0; i < count; i++)
            starts[i] = find_start(matching, (Py_ssize_t)ends[i], level, room, sums, stride);
    }
    const int failed = !memory || !sums;
    free(memory);
    free(sums);
    return -failed;
}

PyDoc_STRVAR(match_doc,
"match(ones, care, bounds, words, breaks, break_bounds, weighted, costs, begin, end, level)\n"
"--\n\n"
"Fill costs[:, begin:end] with the cost of the best match of each template.\n\n"
"Template m has the rows bounds[m] to bounds[m + 1] of ones and care (uint64), and the breaks\n"
"break_bounds[m] to break_bounds[m + 1] (int64, ascending). costs is float32 (M, L), words\n"
"uint64 (L,). level is one of levels(), None: the fastest. Parts of the frames can be filled at a time, by\n"
"several threads: the lock of the interpreter is released.");

static PyObject *match(PyObject *module, PyObject *arguments)
{
    (void)module;
    PyObject *objects[7];
    Py_ssize_t begin, end;
    int weighted;
    const char *level_name;
    if (!PyArg_ParseTuple(arguments, "OOOOOOpOnnz:match", &objects[0], &objects[1], &objects[2],
                          &objects[3], &objects[4], &objects[5], &weighted, &objects[6], &begin,
                          &end, &level_name))
        return NULL;
    const int level = take_level(level_name);
    if (level < 0)
        return NULL;
    Array ones = {0}, care = {0}, bounds = {0}, words = {0}, breaks = {0}, break_bounds = {0};
    Array costs = {0};
    PyObject *result = NULL;
    if (take_array(objects[0], &ones, "ones", UINT64, 8, 0) < 0 ||
        take_array(objects[1], &care, "care", UINT64, 8, 0) < 0 ||
        take_array(objects[2], &bounds, "bounds", INT64, 8, 0) < 0 ||
        take_array(objects[3], &words, "words", UINT64, 8, 0) < 0 ||
        take_array(objects[4], &breaks, "breaks", INT64, 8, 0) < 0 ||
        take_array(objects[5], &break_bounds, "break_bounds", INT64, 8, 0) < 0 ||
        take_array(objects[6], &costs, "costs", FLOAT32, 4, 1) < 0)
        goto done;
    const Py_ssize_t templates = bounds.length - 1;
    if (care.length != ones.length || !divide(&bounds, ones.length, 1, PY_SSIZE_T_MAX) ||
        break_bounds.length != bounds.length ||
        !divide(&break_bounds, breaks.length, 0, PY_SSIZE_T_MAX) ||
        (templates ? costs.length / templates != words.length || costs.length % templates
                   : costs.length)) {
        PyErr_SetString(PyExc_ValueError, "the arrays don't fit each other");
        goto done;
    }
    if (begin < 0 || end < begin || end > words.length) {
        PyErr_SetString(PyExc_ValueError, "no such frames");
        goto done;
    }
    const Matching matching = {
        .ones = ones.view.buf,
        .care = care.view.buf,
        .bounds = bounds.view.buf,
        .templates = templates,
        .words = words.view.buf,
        .frames = words.length,
        .breaks = breaks.view.buf,
        .break_bounds = break_bounds.view.buf,
        .weighted = weighted,
        .costs = costs.view.buf,
    };
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = match_frames(&matching, begin, end, &levels[level]);
    Py_END_ALLOW_THREADS
    result = failed ? PyErr_NoMemory() : Py_NewRef(Py_None);
done:
    release_array(&ones);
    release_array(&care);
    release_array(&bounds);
    release_array(&words);
    release_array(&breaks);
    release_array(&break_bounds);
    release_array(&costs);
    return result;
}

PyDoc_STRVAR(starts_doc,
"starts(ones, care, words, breaks, weighted, ends, starts, level)\n"
"--\n\n"
"Fill starts (int64) with the first frames of the best matches of one template that end at some\n"
"frames (int64), -1 for none.\n\n"
"The template has at most 1,024 rows; all else is as for match().");

static PyObject *starts(PyObject *module, PyObject *arguments)
{
    (void)module;
    PyObject *objects[6];
    int weighted;
    const char *level_name;
    if (!PyArg_ParseTuple(arguments, "OOOOpOOz:starts", &objects[0], &objects[1], &objects[2],
                          &objects[3], &weighted, &objects[4], &objects[5], &level_name))
        return NULL;
    const int level = take_level(level_name);
    if (level < 0)
        return NULL;
    Array ones = {0}, care = {0}, words = {0}, breaks = {0}, ends = {0}, found = {0};
    PyObject *result = NULL;
    if (take_array(objects[0], &ones, "ones", UINT64, 8, 0) < 0 ||
        take_array(objects[1], &care, "care", UINT64, 8, 0) < 0 ||
        take_array(objects[2], &words, "words", UINT64, 8, 0) < 0 ||
        take_array(objects[3], &breaks, "breaks", INT64, 8, 0) < 0 ||
        take_array(objects[4], &ends, "ends", INT64, 8, 0) < 0 ||
        take_array(objects[5], &found, "starts", INT64, 8, 1) < 0)
        goto done;
    int fit = ones.length && ones.length <= BLOCK / 2 && care.length == ones.length &&
              found.length == ends.length;
    for (Py_ssize_t i = 0; fit && i < ends.length; i++) {
        const int64_t end = ((const int64_t *)ends.view.buf)[i];
        fit = end >= 0 && end < words.length;
    }
    if (!fit) {
        PyErr_SetString(PyExc_ValueError, "the arrays don't fit each other");
        goto done;
    }
    const int64_t bounds[2] = {0, ones.length}, break_bounds[2] = {0, breaks.length};
    const Matching matching = {
        .ones = ones.view.buf,
        .care = care.view.buf,
        .bounds = bounds,
        .templates = 1,
        .words = words.view.buf,
        .frames = words.length,
        .breaks = breaks.view.buf,
        .break_bounds = break_bounds,
        .weighted = weighted,
    };
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = find_starts(&matching, ends.view.buf, ends.length, found.view.buf, &levels[level]);
    Py_END_ALLOW_THREADS
    result = failed ? PyErr_NoMemory() : Py_NewRef(Py_None);
done:
    release_array(&ones);
    release_array(&care);
    release_array(&words);
    release_array(&breaks);
    release_array(&ends);
    release_array(&found);
    return result;
}

static PyMethodDef functions[] = {
    {"starts", starts, METH_VARARGS, starts_doc},
    {"match", match, METH_VARARGS, match_doc},
    {"levels", name_levels, METH_NOARGS, LEVELS_DOC},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "_matching",
    .m_doc = "Templates against feature words.",
    .m_size = 0,
    .m_methods = functions,
};

PyMODINIT_FUNC PyInit__matching(void)
{
    find_levels();
    return PyModuleDef_Init(&definition);
}
