/* Text to numbers: the frames of an AMC, the rows of a BVH.

   The twin of mocapidx/formats/numbers.py and of the NumPy readers in amc.py and bvh.py, bit for
   bit. It reads what is regular, and stops before the first frame or row that is not: what is
   wrong with that one, and whether it can be read after all, Python finds out. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "arrays.h"

#define FLOAT64 "d"

#define MOST_FRAMES 1000000000000000 /* 10 ** FRAME_DIGITS */

enum {
    EXACT_POWER = 22, /* 10**22 is the largest power of ten that a double holds exactly */
    MOST_DIGITS = 19, /* of a mantissa that fits 64 bits */
    FRAME_DIGITS = 15,
};

static const double float_powers[EXACT_POWER + 1] = {
    1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
    1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
};
static const double signs[2] = {1, -1};
static const uint64_t word_powers[9] = {
    1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000,
};

/* A place in a text, while the lock of the interpreter is released. */
typedef struct {
    const char *at, *end;
    Py_ssize_t lines; /* ends of lines passed so far */
    PyThreadState *thread;
} Scan;

/* White space; other control characters are taken for blanks in few places, all in Python. */
static int is_blank(char letter)
{
    return letter == ' ' || (letter >= '\t' && letter <= '\r');
}

/* Go to the next word of this line; 0 at its end. */
static int next_word(Scan *scan)
{
    while (scan->at < scan->end && is_blank(*scan->at) && *scan->at != '\n')
        scan->at++;
    return scan->at < scan->end && *scan->at != '\n';
}

/* Go to the next line that is not blank, or the end of the text; 0 if there are words before. */
static int next_line(Scan *scan)
{
    if (next_word(scan))
        return 0;
    while (scan->at < scan->end && is_blank(*scan->at)) {
        scan->lines += *scan->at == '\n';
        scan->at++;
    }
    return 1;
}

static int is_end_of_word(const char *at, const char *end)
{
    return at == end || is_blank(*at);
}

/* Eight letters as one word, the first one lowest; one load, where the processor stores so. */
static inline uint64_t joined(const unsigned char *l)
{
    return (uint64_t)l[0] | (uint64_t)l[1] << 8 | (uint64_t)l[2] << 16 | (uint64_t)l[3] << 24 |
           (uint64_t)l[4] << 32 | (uint64_t)l[5] << 40 | (uint64_t)l[6] << 48 |
           (uint64_t)l[7] << 56;
}

/* The next eight letters; blanks beyond the end of the text. */
static inline uint64_t eight_letters(const char *at, const char *end)
{
    if (end - at >= 8)
        return joined((const unsigned char *)at);
    unsigned char letters[8] = "        ";
    memcpy(letters, at, (size_t)(end - at));
    return joined(letters);
}

/* Read up to eight digits at once. Returns how many there were; `value` gets their number. */
static inline int read_digits(const char *at, const char *end, uint64_t *value)
{
    const uint64_t every = 0x0101010101010101u, pairs = 0x000000ff000000ffu;
    uint64_t word = eight_letters(at, end) ^ '0' * every;
    const uint64_t others = ((word + (0x7f - 9) * every) | word) & 0x80 * every;
    /* every letter below the first that is no digit leaves a one, and the ones are summed up */
    const uint64_t below = ((others & (0 - others)) >> 7) - 1;
    const int count = (int)((below & every) * every >> 56);
    const int shift = 4 * (8 - count);
    word = word << shift << shift; /* at once it might be by 64 bits, which is undefined */
    /* neighbours are joined: eight digits to four pairs, then pairs to fours, fours to eight */
    word = word * 10 + (word >> 8);
    const uint64_t high = (word & pairs) * (100 + ((uint64_t)1000000 << 32));
    const uint64_t low = (word >> 16 & pairs) * (1 + ((uint64_t)10000 << 32));
    *value = (high + low) >> 32;
    return count;
}

/* Read all digits on to a mantissa that has `before` of them.

   Returns how many there were; -1 if the mantissa might get too long for 64 bits. */
static inline int extend(const char *at, const char *end, uint64_t *mantissa, int before)
{
    uint64_t more;
    int digits = 0, count;
    do {
        if (before + digits > MOST_DIGITS - 8)
            return -1;
        count = read_digits(at + digits, end, &more);
        *mantissa = *mantissa * word_powers[count] + more;
        digits += count;
    } while (count == 8);
    return digits;
}

/* Convert one word as Python's float() does; 0 if it is no finite number. */
static int read_any_number(Scan *scan, double *number)
{
    const char *start = scan->at;
    char *stop = NULL;
    while (!is_end_of_word(scan->at, scan->end))
        scan->at++;
    PyEval_RestoreThread(scan->thread);
    *number = PyOS_string_to_double(start, &stop, NULL); /* the text ends in a NUL */
    PyErr_Clear();
    scan->thread = PyEval_SaveThread();
    return stop == scan->at && isfinite(*number);
}

/* Convert the word at this place, correctly rounded; 0 if it is no finite decimal number.

   The mantissa and the power of ten are both doubles without error, so the one operation on
   them is the only rounding. Whatever is longer goes the slow way. */
static inline int read_number(Scan *scan, double *number)
{
    const char *at = scan->at, *const end = scan->end;
    uint64_t mantissa = 0, exponent = 0;
    const int negative = *at == '-'; /* half of all are: nothing branches on it */
    at += negative | (*at == '+');
    int power = 0, digits = extend(at, end, &mantissa, 0);
    if (digits < 0)
        return read_any_number(scan, number);
    at += digits;
    if (at < end && *at == '.') {
        const int decimals = extend(++at, end, &mantissa, digits);
        if (decimals < 0)
            return read_any_number(scan, number);
        at += decimals;
        digits += decimals;
        power = -decimals;
    }
    if (digits == 0)
        return 0;
    if (at < end && (*at | 32) == 'e') {
        at++;
        const int below = at < end && *at == '-';
        at += below || (at < end && *at == '+');
        const int count = read_digits(at, end, &exponent);
        if (count == 8)
            return read_any_number(scan, number);
        if (count == 0)
            return 0;
        at += count;
        power += below ? -(int)exponent : (int)exponent;
    }
    if (!is_end_of_word(at, end))
        return 0;
    if (mantissa > (uint64_t)1 << DBL_MANT_DIG || power > EXACT_POWER || power < -EXACT_POWER ||
        FLT_EVAL_METHOD != 0)
        return read_any_number(scan, number);
    const double value = (double)(int64_t)mantissa;
    const double size = power < 0 ? value / float_powers[-power] : value * float_powers[power];
    *number = size * signs[negative];
    scan->at = at;
    return 1;
}

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

/* Whether numbers divide `total` things into consecutive parts, each of at least `least`. */
static int divide(const Array *bounds, Py_ssize_t total, Py_ssize_t least)
{
    const int64_t *numbers = bounds->view.buf;
    if (bounds->length < 1 || numbers[0] != 0 || numbers[bounds->length - 1] != total)
        return 0;
    for (Py_ssize_t i = 1; i < bounds->length; i++)
        if (numbers[i] < numbers[i - 1] || numbers[i] - numbers[i - 1] < least)
            return 0;
    return 1;
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
    if (!divide(&letter_bounds, letters, 1) || !divide(&number_bounds, table.columns, 1) ||
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
