/* The paths of a match web: minima, valid region, chains and bridges of a grid of distances.

   mocapidx/graphs/paths.py does the same in NumPy. Distances are whole numbers and so are all
   sums of them: both agree to the last bit.

   Kovar, Gleicher, "Automated Extraction and Parameterization of Motions in Large Data Sets",
   SIGGRAPH 2004, sections 3.1 and 3.2. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"
#include "chains.h"

enum { DIAGONAL = 0, UP = 1, RIGHT = 2 };
enum { STEEPEST = 8, LONGEST_REACH = 120, COUNT_BITS = 7 };
enum { COUNTS = (1 << COUNT_BITS) - 1 };

/* Above any key. What is added to it stays above REACHED and below overflow. */
static const uint32_t NO_WAY = UINT32_C(1) << 30, REACHED = (UINT32_C(1) << 30) - (1 << 20);

/* The states of a cell tell how a path came to it: 0 by a diagonal step, 1 .. k - 1 with 2 .. k
   cells in its row, k .. 2 k - 2 with 2 .. k cells in its column. Behind the 2 k - 1 states
   stand the least of all, of those that a step right may follow with two cells in the row, and
   of those that a step up may follow with two cells in the column.

   The key of a state orders paths by their total and then by their cells, more of them first:
   the total, then in the lowest bits COUNTS less the number of cells. */

enum { ANY = 0, LEVEL = 1, UPRIGHT = 2, LEASTS = 3 };

typedef struct {
    uint64_t total;
    int32_t count, chain, cell, from_cell, length;
    uint8_t steps[LONGEST_REACH]; /* from the end */
} Bridge;

typedef struct {
    uint32_t *ways;          /* reach x reach cells */
    Py_ssize_t *first, *end; /* of each row, the columns that were reached */
    Bridge *best;            /* from the present chain, one a chain that it leads to */
    size_t bests, room;
    int32_t *place;          /* of each chain in `best`, from 1 */
} Scratch;

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static void no_way(uint32_t *way, int k)
{
    for (int n = 0; n < 2 * k - 1 + LEASTS; n++)
        way[n] = NO_WAY;
}

static inline void fill_way(uint32_t *way, const uint32_t *across, const uint32_t *left,
                            const uint32_t *below, uint32_t cost, const int k)
{
    const int leasts = 2 * k - 1;
    uint32_t level = NO_WAY, upright = NO_WAY;
    way[0] = across ? across[leasts + ANY] + cost : NO_WAY;
    for (int n = 1; n < k; n++) {
        way[n] = left ? left[n == 1 ? leasts + LEVEL : n - 1] + cost : NO_WAY;
        level = least(level, way[n]);
    }
    for (int n = k; n < leasts; n++) {
        way[n] = below ? below[n == k ? leasts + UPRIGHT : n - 1] + cost : NO_WAY;
        upright = least(upright, way[n]);
    }
    way[leasts + ANY] = least(way[0], least(level, upright));
    way[leasts + LEVEL] = least(way[0], upright);
    way[leasts + UPRIGHT] = least(way[0], level);
}

static inline uint32_t cost_of(uint16_t distance)
{
    return ((uint32_t)distance << COUNT_BITS) - 1;
}

/* Write the steps of the best path to a cell, from its end. */
static int32_t trace_back(const Web *web, const Scratch *scratch, Py_ssize_t di, Py_ssize_t dj,
                          const uint16_t *source, uint8_t *steps)
{
    const int k = web->steepest, leasts = 2 * k - 1;
    const uint32_t *way = scratch->ways + (di * web->reach + dj) * (leasts + LEASTS);
    int32_t length = 0;
    int state = 0;
    while (way[state] != way[leasts + ANY])
        state++;
    while (di || dj) {
        uint32_t before = way[state] - cost_of(source[di * web->columns + dj]);
        if (state == 0)
            di--, dj--;
        else if (state < k)
            dj--;
        else
            di--;
        steps[length++] = state == 0 ? DIAGONAL : state < k ? RIGHT : UP;
        way = scratch->ways + (di * web->reach + dj) * (leasts + LEASTS);
        if (state > 1 && state != k) {
            state--;
        } else {
            int last = state;
            for (state = 0; state < leasts; state++) {
                int fits = last == 0 || (last == k ? state < k : state == 0 || state >= k);
                if (fits && way[state] == before)
                    break;
            }
        }
    }
    return length;
}

/* Give the number of a cell in its chain: along it, rows and columns together only grow. */
static int32_t cell_number(const Web *web, int32_t chain, Py_ssize_t sum)
{
    const int64_t *starts = (const int64_t *)(const void *)web->starts.data;
    const int32_t *cells = (const int32_t *)(const void *)web->cells.data;
    int64_t low = starts[chain], high = starts[chain + 1] - 1;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if ((Py_ssize_t)cells[2 * middle] + cells[2 * middle + 1] < sum)
            low = middle + 1;
        else
            high = middle;
    }
    return (int32_t)(low - starts[chain]);
}

/* A path came to a cell of another chain: keep it if its average is the least. */
static int arrive(const Web *web, Scratch *scratch, int32_t chain, int32_t from_cell,
                  Py_ssize_t i, Py_ssize_t j, Py_ssize_t di, Py_ssize_t dj, uint32_t key)
{
    uint64_t total = key >> COUNT_BITS;
    int32_t count = COUNTS - (int32_t)(key & COUNTS);
    Bridge *best;
    if (scratch->place[chain]) {
        best = &scratch->best[scratch->place[chain] - 1];
        if (total * (uint64_t)best->count >= best->total * (uint64_t)count)
            return 0;
    } else {
        if (scratch->bests == scratch->room) {
            size_t room = scratch->room ? 2 * scratch->room : 64;
            Bridge *grown = realloc(scratch->best, room * sizeof *grown);
            if (!grown)
                return -1;
            scratch->best = grown;
            scratch->room = room;
        }
        best = &scratch->best[scratch->bests++];
        scratch->place[chain] = (int32_t)scratch->bests;
    }
    best->total = total;
    best->count = count;
    best->chain = chain;
    best->from_cell = from_cell;
    best->cell = cell_number(web, chain, i + di + j + dj);
    best->length =
        trace_back(web, scratch, di, dj, web->grid + i * web->columns + j, best->steps);
    return 0;
}

/* Find the best paths from one cell of a chain to the chains within reach. */
static inline int reach_out(const Web *web, Scratch *scratch, int32_t chain, int32_t from_cell,
                            Py_ssize_t i, Py_ssize_t j, const int k)
{
    const Py_ssize_t reach = web->reach, columns = web->columns;
    const int size = 2 * k - 1 + LEASTS;
    Py_ssize_t below_first = 0, below_end = 0;
    for (Py_ssize_t di = 0; di < reach && i + di < web->rows; di++) {
        Py_ssize_t limit = reach - di < columns - j ? reach - di : columns - j;
        Py_ssize_t first = -1, end = -1, origin = (i + di) * columns + j;
        uint32_t *row = scratch->ways + di * reach * size;
        const uint32_t *below = di ? row - reach * size : row;
        for (Py_ssize_t dj = below_first; dj < limit; dj++) {
            uint32_t *way = row + dj * size;
            if (di == 0 && dj == 0) {
                no_way(way, k);
                way[0] = way[size - LEASTS + ANY] = way[size - LEASTS + LEVEL] =
                    way[size - LEASTS + UPRIGHT] = cost_of(web->grid[origin]) + COUNTS;
                first = 0;
                end = 1;
                continue;
            }
            int has_left = end == dj, has_below = dj < below_end;
            int has_across = dj > below_first && dj <= below_end;
            if (!has_left && dj > below_end)
                break;
            if (!(web->marks[origin + dj] & REGION) || !(has_left || has_below || has_across)) {
                no_way(way, k);
                continue;
            }
            fill_way(way, has_across ? below + (dj - 1) * size : NULL,
                     has_left ? way - size : NULL, has_below ? below + dj * size : NULL,
                     cost_of(web->grid[origin + dj]), k);
            uint32_t key = way[size - LEASTS + ANY];
            if (key >= REACHED) {
                no_way(way, k);
                continue;
            }
            int32_t owner = web->owners[origin + dj] - 1;
            if (owner >= 0) {
                if (owner != chain &&
                    arrive(web, scratch, owner, from_cell, i, j, di, dj, key))
                    return -1;
                if (web->stop_at_chains) {
                    no_way(way, k);
                    continue;
                }
            }
            if (first < 0)
                first = dj;
            end = dj + 1;
        }
        if (first < 0)
            break;
        below_first = first;
        below_end = end;
    }
    return 0;
}

static int keep_bridges(Web *web, const Scratch *scratch, int32_t chain)
{
    const int64_t *starts = (const int64_t *)(const void *)web->starts.data;
    const int32_t *cells = (const int32_t *)(const void *)web->cells.data;
    for (size_t n = 0; n < scratch->bests; n++) {
        const Bridge *bridge = &scratch->best[n];
        Joint joint = {chain, bridge->from_cell, bridge->chain, bridge->cell};
        const int32_t *from = cells + 2 * (starts[chain] + bridge->from_cell);
        int32_t cell[2] = {from[0], from[1]};
        for (int32_t at = bridge->length - 1; at > 0; at--) { /* the last step is the arrival */
            cell[0] += bridge->steps[at] != RIGHT;
            cell[1] += bridge->steps[at] != UP;
            if (append(&web->inner, cell, sizeof cell))
                return -1;
        }
        int64_t end = (int64_t)(web->inner.size / sizeof cell);
        if (append(&web->joints, &joint, sizeof joint) ||
            append(&web->inner_starts, &end, sizeof end))
            return -1;
    }
    return 0;
}

static int build_bridges(Web *web)
{
    const int k = web->steepest;
    const size_t reach = (size_t)web->reach;
    int32_t chains = (int32_t)(web->starts.size / sizeof(int64_t)) - 1;
    int64_t zero = 0;
    int failed = append(&web->inner_starts, &zero, sizeof zero);
    Scratch scratch = {
        .ways = malloc(reach * reach * (size_t)(2 * k - 1 + LEASTS) * sizeof(uint32_t)),
        .place = calloc((size_t)chains + 1, sizeof(int32_t)),
    };
    failed |= !scratch.ways || !scratch.place;
    for (int32_t chain = 0; chain < chains && !failed; chain++) {
        const int64_t *starts = (const int64_t *)(const void *)web->starts.data;
        const int32_t *cells = (const int32_t *)(const void *)web->cells.data;
        int32_t count = (int32_t)(starts[chain + 1] - starts[chain]);
        const int32_t *cell = cells + 2 * starts[chain];
        for (int32_t n = 0; n < count && !failed; n++, cell += 2)
            failed |= k == 3 ? reach_out(web, &scratch, chain, n, cell[0], cell[1], 3)
                             : reach_out(web, &scratch, chain, n, cell[0], cell[1], k);
        failed |= failed ? 0 : keep_bridges(web, &scratch, chain);
        for (size_t n = 0; n < scratch.bests; n++)
            scratch.place[scratch.best[n].chain] = 0;
        scratch.bests = 0;
    }
    free(scratch.ways);
    free(scratch.place);
    free(scratch.best);
    return failed ? -1 : 0;
}

PyDoc_STRVAR(find_paths_doc,
"find_paths(grid, rows, columns, diagonal, alpha, steepest, shortest, reach, stop_below, restart, "
"stop_at_chains)\n--\n\n"
"Give the chains and bridges of a grid as five arrays in bytes: cells of the chains (int32 pairs), "
"where each chain begins (int64), the ends of each bridge (four int32), the bridges' inner cells "
"and where each of them begins.");

static PyObject *find_paths(PyObject *module, PyObject *arguments)
{
    (void)module;
    PyObject *grid, *diagonal, *result = NULL;
    Array array = {.length = 0};
    Web web = {.rows = 0};
    Py_ssize_t offset = 0;
    if (!PyArg_ParseTuple(arguments, "OnnOlinippp", &grid, &web.rows, &web.columns, &diagonal,
                          &web.alpha, &web.steepest, &web.shortest, &web.reach, &web.stop_below,
                          &web.restart, &web.stop_at_chains))
        return NULL;
    int mirrored = diagonal != Py_None;
    if (mirrored && (offset = PyNumber_AsSsize_t(diagonal, PyExc_OverflowError)) == -1 &&
        PyErr_Occurred())
        return NULL;
    if (take_array(grid, &array, "grid", "HS", 2, 0))
        goto done;
    if (web.rows < 1 || web.columns < 1 || web.rows > UINT16_MAX || web.columns > UINT16_MAX ||
        array.length != web.rows * web.columns || web.alpha < 0 || web.alpha > 1000000 ||
        web.steepest < 1 || web.steepest > STEEPEST || web.reach < 1 ||
        web.reach > LONGEST_REACH || offset > UINT16_MAX || offset < -(Py_ssize_t)UINT16_MAX) {
        PyErr_SetString(PyExc_ValueError, "a size or a limit is out of range");
        goto done;
    }
    size_t size = (size_t)web.rows * (size_t)web.columns;
    int failed;
    web.grid = array.view.buf;
    Py_BEGIN_ALLOW_THREADS
    web.marks = calloc(size, 1);
    web.owners = calloc(size, sizeof(int32_t));
    failed = !web.marks || !web.owners || mark(&web, mirrored, offset) || trace_chains(&web) ||
             build_bridges(&web);
    Py_END_ALLOW_THREADS
    if (failed) {
        PyErr_NoMemory();
        goto done;
    }
    Buffer *parts[] = {&web.cells, &web.starts, &web.joints, &web.inner, &web.inner_starts};
    result = PyTuple_New(5);
    for (int n = 0; result && n < 5; n++) {
        PyObject *part =
            PyBytes_FromStringAndSize(parts[n]->data, (Py_ssize_t)parts[n]->size);
        if (!part || PyTuple_SetItem(result, n, part) < 0)
            Py_CLEAR(result);
    }
done:
    release_array(&array);
    free(web.marks);
    free(web.owners);
    free(web.cells.data);
    free(web.starts.data);
    free(web.joints.data);
    free(web.inner.data);
    free(web.inner_starts.data);
    return result;
}

static PyMethodDef functions[] = {
    {"find_paths", find_paths, METH_VARARGS, find_paths_doc},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "_webs",
    .m_doc = "The paths of a match web.",
    .m_size = 0,
    .m_methods = functions,
};

PyMODINIT_FUNC PyInit__webs(void)
{
    return PyModuleDef_Init(&definition);
}
