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

#endif
