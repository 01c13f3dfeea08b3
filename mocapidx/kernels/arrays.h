/* Arrays that Python hands over, checked once: kernels below trust them.

   Needs Python.h, with Py_LIMITED_API from 3.11 on: the first one that has the buffer protocol. */

#ifndef MOCAPIDX_ARRAYS_H
#define MOCAPIDX_ARRAYS_H

#include <stdint.h>
#include <string.h>

/* The struct module's letters that mean an element on some platform; its size is checked too. */
#define UINT64 "LQ"
#define INT64 "lq"
#define INT32 "il"
#define FLOAT32 "f"
#define FLOAT64 "d"
#define UINT8 "B"
#define BOOL "?"

typedef struct {
    Py_buffer view; /* view.obj is NULL until it is taken */
    Py_ssize_t length; /* of all dimensions together */
} Array;

/* Take the memory of an array of one or more dimensions, contiguous, of a given element.

   Returns -1 with an exception set; release_array() is right in either case. */
static int take_array(PyObject *object, Array *array, const char *name, const char *kinds,
                      Py_ssize_t size, int writable)
{
    int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0);
    memset(array, 0, sizeof *array);
    if (PyObject_GetBuffer(object, &array->view, flags) < 0) {
        array->view.obj = NULL;
        return -1;
    }
    const char *format = array->view.format ? array->view.format : "B";
    if (strlen(format) != 1 || !strchr(kinds, *format) || array->view.itemsize != size) {
        PyErr_Format(PyExc_TypeError, "%s: wrong type '%s' of %zd bytes an element", name, format,
                     array->view.itemsize);
        return -1;
    }
    array->length = array->view.len / size;
    return 0;
}

static void release_array(Array *array)
{
    if (array->view.obj)
        PyBuffer_Release(&array->view);
}

/* Whether numbers divide `total` things into consecutive parts of `least` to `most`. */
static inline int divide(const Array *bounds, Py_ssize_t total, Py_ssize_t least, Py_ssize_t most)
{
    const int64_t *numbers = bounds->view.buf;
    if (bounds->length < 1 || numbers[0] != 0 || numbers[bounds->length - 1] != total)
        return 0;
    for (Py_ssize_t i = 1; i < bounds->length; i++)
        if (numbers[i] < numbers[i - 1] || numbers[i] > total ||
            numbers[i] - numbers[i - 1] < least || numbers[i] - numbers[i - 1] > most)
            return 0;
    return 1;
}

#endif
