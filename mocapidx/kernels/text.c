/* Text to numbers: the frames of an AMC, the rows of a BVH.

   The twin of mocapidx/formats/numbers.py and of the NumPy readers in amc.py and bvh.py, bit for
   bit. It reads what is regular, and stops before the first frame or row that is not: what is
   wrong with that one, and whether it can be read after all, Python finds out. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>
#include <string.h>

#include "arrays.h"
#include "decimals.h"

#define FRAME_DIGITS 15
#define MOST_FRAMES 1000000000000000 /* 10 ** FRAME_DIGITS */

/* Read the numbers of one line; 0 if there are more or fewer, or one is none. */
static int read_numbers(Scan *scan, Py_ssize_t count, const int64_t *columns,
                        const double *scales, double *row)
{
    for (Py_ssize_t i = 0; i < count; i++) {
        double number;
        if (!next_word(scan) || !read_number(scan, &number))
            return 0;
        row[columns[i]] = number * scales[i];
    }
    return next_line(scan);
}

/* Read a line that has only the number of a frame; 0 if it is another one, or none. */
static int read_frame_number(Scan *scan, int64_t expected)
{
    int64_t number = 0;
    const char *start = scan->at;
    for (; scan->at < scan->end && *scan->at >= '0' && *scan->at <= '9'; scan->at++) {
        if (scan->at - start == FRAME_DIGITS)
            return 0;
        number = 10 * number + (*scan->at - '0');
    }
    return scan->at > start && is_end_of_word(scan->at, scan->end) && number == expected && next_line(scan);
}

typedef struct {
    Py_ssize_t columns; /* of a row */
    const int64_t *targets; /* the column of each number of a frame, as the text has them */
    const double *scales;
    double *values; /* (rows, columns) */
    Py_ssize_t row, rows; /* the first one to fill, and how many there are */
    const char *names; /* of bones, one after the other */
    const int64_t *name_bounds;
    const int64_t *bounds; /* bone b has the numbers from bounds[b] to bounds[b + 1] */
    Py_ssize_t bones;
} Table;

static int read_bones(Scan *scan, const Table *table, double *row)
{
    for (Py_ssize_t b = 0; b < table->bones; b++) {
        const size_t length = (size_t)(table->name_bounds[b + 1] - table->name_bounds[b]);
        if ((size_t)(scan->end - scan->at) < length ||
            memcmp(scan->at, table->names + table->name_bounds[b], length) != 0)
            return 0;
        scan->at += length;
        if (!is_end_of_word(scan->at, scan->end) ||
            !read_numbers(scan, (Py_ssize_t)(table->bounds[b + 1] - table->bounds[b]),
                          table->targets + table->bounds[b], table->scales + table->bounds[b], row))
            return 0;
    }
    return 1;
}

/* Read frames; one counts when the next has begun, or the text is at its end. */
static Py_ssize_t read_all_frames(Scan *scan, const Table *table, int64_t first)
{
    const char *good = scan->at;
    Py_ssize_t lines = scan->lines, frames = 0, read = 0;
    int regular = 1;
    next_line(scan);
    while (regular && scan->at < scan->end && table->row + read < table->rows) {
        const char *start = scan->at;
        const Py_ssize_t lines_before = scan->lines;
        regular = read_frame_number(scan, first + read);
        if (regular) {
            frames = read;
            good = start;
            lines = lines_before;
            regular = read_bones(scan, table, table->values + (table->row + read) * table->columns);
            read += regular;
        }
    }
    if (regular && scan->at == scan->end)
        return read;
    scan->at = good;
    scan->lines = lines;
    return frames;
}

static Py_ssize_t read_all_rows(Scan *scan, const Table *table)
{
    Py_ssize_t read = 0;
    next_line(scan);
    while (scan->at < scan->end && table->row + read < table->rows) {
        const char *start = scan->at;
        const Py_ssize_t lines_before = scan->lines;
        if (!read_numbers(scan, table->columns, table->targets, table->scales,
                          table->values + (table->row + read) * table->columns)) {
            scan->at = start;
            scan->lines = lines_before;
            break;
        }
        read++;
    }
    return read;
}

/* What both functions of Python take: text, at, targets, scales, values, row. */
typedef struct {
    Array targets, scales, values;
    const char *text;
    Py_ssize_t length;
} Arguments;

static int take_table(PyObject *text, Py_ssize_t at, PyObject *targets, PyObject *scales,
                      PyObject *values, Py_ssize_t row, Arguments *arguments, Table *table)
{
    char *letters;
    if (PyBytes_AsStringAndSize(text, &letters, &arguments->length) < 0 ||
        take_array(targets, &arguments->targets, "targets", INT64, 8, 0) < 0 ||
        take_array(scales, &arguments->scales, "scales", FLOAT64, 8, 0) < 0 ||
        take_array(values, &arguments->values, "values", FLOAT64, 8, 1) < 0)
        return -1;
    arguments->text = letters;
    const Py_buffer *view = &arguments->values.view;
    const Py_ssize_t columns = arguments->targets.length;
    const int64_t *target = arguments->targets.view.buf;
    int fits = at >= 0 && at <= arguments->length && view->ndim == 2 && columns > 0 &&
               view->shape[1] == columns && arguments->scales.length == columns && row >= 0 &&
               row <= view->shape[0];
    for (Py_ssize_t i = 0; fits && i < columns; i++)
        fits = target[i] >= 0 && target[i] < columns;
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "the arrays don't fit each other");
        return -1;
    }
    *table = (Table){.columns = columns,
                     .targets = target,
                     .scales = arguments->scales.view.buf,
                     .values = view->buf,
                     .row = row,
                     .rows = view->shape[0]};
    return 0;
}

static void release_table(Arguments *arguments)
{
    release_array(&arguments->targets);
    release_array(&arguments->scales);
    release_array(&arguments->values);
}

PyDoc_STRVAR(read_rows_doc,
"read_rows(text, at, targets, scales, values, row)\n"
"--\n\n"
"Read lines of numbers from text[at:] into values[row:].\n\n"
"Number i of a line times scales[i] goes to column targets[i]. Returns how many rows were read,\n"
"where the first line stands that was not (it is irregular, or values is full), and how many\n"
"lines end before it.");

static PyObject *read_rows(PyObject *module, PyObject *given)
{
    (void)module;
    PyObject *text, *targets, *scales, *values;
    Py_ssize_t at, row, rows = 0;
    if (!PyArg_ParseTuple(given, "OnOOOn:read_rows", &text, &at, &targets, &scales, &values, &row))
        return NULL;
    Arguments arguments = {0};
    Table table;
    PyObject *result = NULL;
    if (take_table(text, at, targets, scales, values, row, &arguments, &table) == 0) {
        Scan scan = {arguments.text + at, arguments.text + arguments.length, 0, NULL};
        scan.thread = PyEval_SaveThread();
        rows = read_all_rows(&scan, &table);
        PyEval_RestoreThread(scan.thread);
        result = Py_BuildValue("nnn", rows, (Py_ssize_t)(scan.at - arguments.text), scan.lines);
    }
    release_table(&arguments);
    return result;
}

PyDoc_STRVAR(read_frames_doc,
"read_frames(text, at, first, names, name_bounds, bounds, targets, scales, values, row)\n"
"--\n\n"
"Read frames of an AMC from text[at:] into values[row:], the first one numbered `first`.\n\n"
"Bone b is names[name_bounds[b]:name_bounds[b + 1]] and has the numbers bounds[b] to\n"
"bounds[b + 1] of a frame; number i times scales[i] goes to column targets[i]. Returns how many\n"
"frames were read, where the first one stands that was not, and how many lines end before it.\n"
"With fewer than two rows to fill, perhaps none is read.");

static PyObject *read_frames(PyObject *module, PyObject *given)
{
    (void)module;
    PyObject *text, *names, *name_bounds, *bounds, *targets, *scales, *values;
    Py_ssize_t at, row, frames = 0, letters;
    long long first;
    char *letter;
    if (!PyArg_ParseTuple(given, "OnLOOOOOOn:read_frames", &text, &at, &first, &names,
                          &name_bounds, &bounds, &targets, &scales, &values, &row) ||
        PyBytes_AsStringAndSize(names, &letter, &letters) < 0)
        return NULL;
    if (first < 0 || first > MOST_FRAMES) {
        PyErr_SetString(PyExc_ValueError, "no such frame");
        return NULL;
    }
    Arguments arguments = {0};
    Array number_bounds = {0}, letter_bounds = {0};
    Table table;
    PyObject *result = NULL;
    if (take_table(text, at, targets, scales, values, row, &arguments, &table) < 0 ||
        take_array(name_bounds, &letter_bounds, "name_bounds", INT64, 8, 0) < 0 ||
        take_array(bounds, &number_bounds, "bounds", INT64, 8, 0) < 0)
        goto done;
    if (!divide(&letter_bounds, letters, 1, PY_SSIZE_T_MAX) ||
        !divide(&number_bounds, table.columns, 1, PY_SSIZE_T_MAX) ||
        letter_bounds.length != number_bounds.length) {
        PyErr_SetString(PyExc_ValueError, "the bones don't fit the arrays");
        goto done;
    }
    table.names = letter;
    table.name_bounds = letter_bounds.view.buf;
    table.bounds = number_bounds.view.buf;
    table.bones = number_bounds.length - 1;
    Scan scan = {arguments.text + at, arguments.text + arguments.length, 0, NULL};
    scan.thread = PyEval_SaveThread();
    frames = read_all_frames(&scan, &table, first);
    PyEval_RestoreThread(scan.thread);
    result = Py_BuildValue("nnn", frames, (Py_ssize_t)(scan.at - arguments.text), scan.lines);
done:
    release_array(&number_bounds);
    release_array(&letter_bounds);
    release_table(&arguments);
    return result;
}

static PyMethodDef methods[] = {
    {"read_rows", read_rows, METH_VARARGS, read_rows_doc},
    {"read_frames", read_frames, METH_VARARGS, read_frames_doc},
    {NULL, NULL, 0, NULL},
};

static PyModuleDef_Slot slots[] = {{0, NULL}};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_text", "Text to numbers.", 0, methods, slots, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__text(void)
{
    return PyModuleDef_Init(&definition);
}
