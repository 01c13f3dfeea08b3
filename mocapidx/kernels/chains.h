/* The chains of a match web: minima of a grid of distances, their valid region, and runs of them.

   Kovar, Gleicher, "Automated Extraction and Parameterization of Motions in Large Data Sets",
   SIGGRAPH 2004, section 3.1. Needs Python.h. */

#ifndef MOCAPIDX_CHAINS_H
#define MOCAPIDX_CHAINS_H

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { MINIMUM = 1, REGION = 2, USED = 4 };
enum { BLOCK = 32 };

typedef struct {
    char *data;
    size_t size, room;
} Buffer;

static int append(Buffer *buffer, const void *data, size_t size)
{
    if (size > buffer->room - buffer->size) {
        size_t room = buffer->room ? buffer->room : 4096;
        while (size > room - buffer->size) {
            if (room > SIZE_MAX / 2)
                return -1;
            room *= 2;
        }
        char *grown = realloc(buffer->data, room);
        if (!grown)
            return -1;
        buffer->data = grown;
        buffer->room = room;
    }
    if (size)
        memcpy(buffer->data + buffer->size, data, size);
    buffer->size += size;
    return 0;
}

typedef struct {
    int32_t from_chain, from_cell, to_chain, to_cell;
} Joint;

typedef struct {
    const uint16_t *grid;
    Py_ssize_t rows, columns;
    uint8_t *marks;
    int32_t *owners;         /* number of a cell's chain, from 1 */
    long alpha;              /* per mille */
    int stop_below, restart, stop_at_chains, steepest, reach;
    Py_ssize_t shortest;     /* twice the least length of a chain, in cells */
    Buffer cells;            /* int32 pairs, chains end to end */
    Buffer starts;           /* int64, first cell of each chain, and the end */
    Buffer joints;           /* Joint, a bridge each */
    Buffer inner;            /* int32 pairs, bridges end to end */
    Buffer inner_starts;     /* int64 */
} Web;

/* Minima of the rows, each extended along its row. */
static void mark_rows(const Web *web, const uint16_t *grid, Py_ssize_t rows, Py_ssize_t columns,
                      uint8_t *marks)
{
    for (Py_ssize_t row = 0; row < rows; row++, grid += columns, marks += columns) {
        for (Py_ssize_t first = 0, last; first < columns; first = last + 1) {
            uint16_t value = grid[first];
            for (last = first; last + 1 < columns && grid[last + 1] == value; last++)
                ;
            if ((first > 0 && grid[first - 1] < value) ||
                (last + 1 < columns && grid[last + 1] < value))
                continue;
            Py_ssize_t middle = first + (last - first) / 2;
            uint64_t limit = ((uint64_t)value * (1000 + (uint64_t)web->alpha) + 999) / 1000;
            uint32_t least = web->stop_below ? value : 0;
            marks[middle] |= MINIMUM | REGION;
            for (Py_ssize_t at = middle + 1; at < columns; at++) {
                if (grid[at] >= limit || grid[at] < least)
                    break;
                marks[at] |= REGION;
            }
            for (Py_ssize_t at = middle - 1; at >= 0; at--) {
                if (grid[at] >= limit || grid[at] < least)
                    break;
                marks[at] |= REGION;
            }
        }
    }
}

/* Mark minima and region along rows and columns; cells up to the diagonal are no path. */
static int mark(Web *web, int diagonal_known, Py_ssize_t diagonal)
{
    Py_ssize_t rows = web->rows, columns = web->columns;
    uint16_t *turned = calloc((size_t)rows * (size_t)columns, sizeof *turned);
    uint8_t *turned_marks = calloc((size_t)rows * (size_t)columns, 1);
    if (!turned || !turned_marks) {
        free(turned);
        free(turned_marks);
        return -1;
    }
    for (Py_ssize_t top = 0; top < rows; top += BLOCK)
        for (Py_ssize_t left = 0; left < columns; left += BLOCK)
            for (Py_ssize_t i = top; i < top + BLOCK && i < rows; i++)
                for (Py_ssize_t j = left; j < left + BLOCK && j < columns; j++)
                    turned[j * rows + i] = web->grid[i * columns + j];
    mark_rows(web, web->grid, rows, columns, web->marks);
    mark_rows(web, turned, columns, rows, turned_marks);
    for (Py_ssize_t top = 0; top < rows; top += BLOCK)
        for (Py_ssize_t left = 0; left < columns; left += BLOCK)
            for (Py_ssize_t i = top; i < top + BLOCK && i < rows; i++)
                for (Py_ssize_t j = left; j < left + BLOCK && j < columns; j++)
                    web->marks[i * columns + j] |= turned_marks[j * rows + i];
    free(turned);
    free(turned_marks);
    if (diagonal_known)
        for (Py_ssize_t i = 0; i < rows; i++) {
            Py_ssize_t end = i - diagonal + 1;
            if (end > 0)
                memset(web->marks + i * columns, 0, (size_t)(end < columns ? end : columns));
        }
    return 0;
}

static int is_free(const Web *web, Py_ssize_t i, Py_ssize_t j)
{
    return i < web->rows && j < web->columns &&
           (web->marks[i * web->columns + j] & (MINIMUM | USED)) == MINIMUM;
}

static int is_minimum(const Web *web, Py_ssize_t i, Py_ssize_t j)
{
    return i >= 0 && j >= 0 && (web->marks[i * web->columns + j] & MINIMUM);
}

/* Follow minima from a cell as long as the slope allows; keep the chain if it is long enough. */
static int trace_chain(Web *web, Py_ssize_t i, Py_ssize_t j)
{
    const Py_ssize_t columns = web->columns;
    for (;;) {
        size_t before = web->cells.size;
        Py_ssize_t first_i = i, first_j = j, blocked_i = -1, blocked_j = -1;
        int level = 1, upright = 1; /* cells of the chain in this row, in this column */
        for (;;) {
            int32_t cell[2] = {(int32_t)i, (int32_t)j};
            web->marks[i * columns + j] |= USED;
            if (append(&web->cells, cell, sizeof cell))
                return -1;
            if (is_free(web, i + 1, j + 1)) {
                i++, j++;
                level = upright = 1;
                continue;
            }
            int up = is_free(web, i + 1, j), right = is_free(web, i, j + 1);
            int may_up = up && upright < web->steepest;
            int may_right = right && level < web->steepest;
            if (may_up && may_right)
                may_up = web->grid[(i + 1) * columns + j] <= web->grid[i * columns + j + 1];
            if (may_up) {
                i++;
                upright++;
                level = 1;
            } else if (may_right) {
                j++;
                level++;
                upright = 1;
            } else {
                if (up || right) {
                    blocked_i = up ? i + 1 : i;
                    blocked_j = up ? j : j + 1;
                }
                break;
            }
        }
        if ((i - first_i) + (j - first_j) + 2 >= web->shortest) {
            int64_t end = (int64_t)(web->cells.size / (2 * sizeof(int32_t)));
            int32_t number = (int32_t)(web->starts.size / sizeof(int64_t));
            if (append(&web->starts, &end, sizeof end))
                return -1;
            for (size_t at = before; at < web->cells.size; at += 2 * sizeof(int32_t)) {
                int32_t cell[2];
                memcpy(cell, web->cells.data + at, sizeof cell);
                web->owners[cell[0] * columns + cell[1]] = number;
            }
        } else {
            web->cells.size = before;
        }
        if (!web->restart || blocked_i < 0)
            return 0;
        i = blocked_i;
        j = blocked_j;
    }
}

static int trace_chains(Web *web)
{
    int64_t zero = 0;
    if (append(&web->starts, &zero, sizeof zero))
        return -1;
    for (Py_ssize_t i = 0; i < web->rows; i++)
        for (Py_ssize_t j = 0; j < web->columns; j++)
            if (is_free(web, i, j) && !is_minimum(web, i, j - 1) && !is_minimum(web, i - 1, j) &&
                !is_minimum(web, i - 1, j - 1) && trace_chain(web, i, j))
                return -1;
    return 0;
}

#endif
