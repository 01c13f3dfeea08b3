/* Match sequences: ways through the paths of a match web, from one row to another.

   mocapidx/graphs/sequences.py does the same in Python. Distances are whole numbers and so are
   all sums of them: both agree to the last bit.

   Kovar, Gleicher, "Automated Extraction and Parameterization of Motions in Large Data Sets",
   SIGGRAPH 2004, section 3.3. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"

#define INT32 "il"

enum { OUT_OF_MEMORY = -1, OUT_OF_RANGE = -2 };

/* A way into a chain: from where, and what it took before the cell. */
typedef struct {
    int64_t cell, parent, bridge, from, total, count;
} State;

/* A way from the first row to the last. */
typedef struct {
    int64_t total, count, first, last, state, bridge, from, to;
} Sequence;

typedef struct {
    void *items;
    size_t size, count, room;
} List;

typedef struct {
    const int32_t *cells, *ends, *inner_cells;
    const int64_t *starts, *sums, *bridge_starts, *inner_starts, *inner_sums, *chain_of;
    int64_t chains, bridges;
    int role; /* which of a cell's two numbers is the row */
    int64_t first_row, last_row, slack, most;
    int64_t *slots;  /* of each cell, its present state */
    int64_t *stamps; /* of each cell, the start that it was reached from, from 1 */
    int64_t stamp, start_column;
    List states, sequences, waiting;
} Search;

static void *added(List *list)
{
    if (list->count == list->room) {
        size_t room = list->room ? 2 * list->room : 256;
        void *grown = realloc(list->items, room * list->size);
        if (!grown)
            return NULL;
        list->items = grown;
        list->room = room;
    }
    return (char *)list->items + list->count++ * list->size;
}

static int64_t row_of(const Search *search, const int32_t *cells, int64_t at)
{
    return cells[2 * at + search->role];
}

static int64_t column_of(const Search *search, const int32_t *cells, int64_t at)
{
    return cells[2 * at + 1 - search->role];
}

static int64_t sum_of(const Search *search, int64_t cell)
{
    return (int64_t)search->cells[2 * cell] + search->cells[2 * cell + 1];
}

/* The first cell from `low` up to `high` in this row or a later one. */
static int64_t first_in_row(const Search *search, const int32_t *cells, int64_t low, int64_t high,
                            int64_t row)
{
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (row_of(search, cells, middle) < row)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* ---- the states that wait, the one with the least row and column first ---- */

static int goes_before(const Search *search, int64_t one, int64_t other)
{
    const State *states = search->states.items;
    int64_t a = sum_of(search, states[one].cell), b = sum_of(search, states[other].cell);
    return a < b || (a == b && states[one].cell < states[other].cell);
}

static int wait_for(Search *search, int64_t state)
{
    if (!added(&search->waiting))
        return OUT_OF_MEMORY;
    int64_t *heap = search->waiting.items;
    size_t at = search->waiting.count - 1;
    while (at && goes_before(search, state, heap[(at - 1) / 2])) {
        heap[at] = heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    heap[at] = state;
    return 0;
}

static int64_t next_waiting(Search *search)
{
    int64_t *heap = search->waiting.items, first = heap[0];
    size_t count = --search->waiting.count, at = 0;
    if (!count)
        return first;
    int64_t last = heap[count];
    for (size_t below; (below = 2 * at + 1) < count; at = below) {
        if (below + 1 < count && goes_before(search, heap[below + 1], heap[below]))
            below++;
        if (!goes_before(search, heap[below], last))
            break;
        heap[at] = heap[below];
    }
    heap[at] = last;
    return first;
}

/* ---- the walk ---- */

/* A way came to a cell of a chain: wait there, unless a cheaper way has come already. */
static int enter(Search *search, State way)
{
    State *states = search->states.items;
    if (search->stamps[way.cell] == search->stamp) {
        State *known = &states[search->slots[way.cell]];
        if (way.total * known->count < known->total * way.count)
            *known = way;
        return 0;
    }
    State *place = added(&search->states);
    if (!place)
        return OUT_OF_MEMORY;
    *place = way;
    search->stamps[way.cell] = search->stamp;
    search->slots[way.cell] = (int64_t)search->states.count - 1;
    return wait_for(search, search->slots[way.cell]);
}

static int finish(Search *search, const int32_t *cells, int64_t to, Sequence sequence)
{
    if (sequence.total > search->most * sequence.count)
        return 0;
    sequence.to = to;
    sequence.first = search->start_column;
    sequence.last = column_of(search, cells, to) + search->last_row - row_of(search, cells, to);
    Sequence *place = added(&search->sequences);
    if (!place)
        return OUT_OF_MEMORY;
    *place = sequence;
    return 0;
}

/* Go over a bridge from its inner cell `from`: to the last row, or on to the next chain. */
static int cross(Search *search, int64_t bridge, int64_t from, int64_t parent, int64_t total,
                 int64_t count)
{
    int64_t end = search->inner_starts[bridge + 1];
    int64_t stop = first_in_row(search, search->inner_cells, from, end, search->last_row + 1);
    const int32_t *ends = search->ends + 4 * bridge;
    if (from < end && row_of(search, search->inner_cells, end - 1) >= search->last_row) {
        Sequence sequence = {.state = parent, .bridge = bridge, .from = from,
                             .total = total + search->inner_sums[stop] - search->inner_sums[from],
                             .count = count + stop - from};
        return stop > from ? finish(search, search->inner_cells, stop - 1, sequence) : 0;
    }
    if (ends[2] < 0 || ends[2] >= search->chains || ends[3] < 0 ||
        ends[3] >= search->starts[ends[2] + 1] - search->starts[ends[2]])
        return OUT_OF_RANGE;
    State way = {.cell = search->starts[ends[2]] + ends[3], .parent = parent, .bridge = bridge,
                 .from = from,
                 .total = total + search->inner_sums[end] - search->inner_sums[from],
                 .count = count + end - from};
    if (parent >= 0 && sum_of(search, way.cell) <=
                           sum_of(search, ((State *)search->states.items)[parent].cell))
        return OUT_OF_RANGE; /* bridges lead forward, else this would not end */
    if (row_of(search, search->cells, way.cell) > search->last_row)
        return 0;
    return enter(search, way);
}

/* Walk along the chain of a state, to the last row and over all bridges on the way. */
static int walk(Search *search, int64_t number)
{
    State state = ((State *)search->states.items)[number];
    int64_t chain = search->chain_of[state.cell], end = search->starts[chain + 1];
    int64_t stop = first_in_row(search, search->cells, state.cell, end, search->last_row + 1);
    int64_t paid = state.total - search->sums[state.cell], gone = state.count - state.cell;
    if (stop > state.cell &&
        row_of(search, search->cells, stop - 1) >= search->last_row - search->slack) {
        Sequence sequence = {.state = number, .bridge = -1, .from = -1,
                             .total = paid + search->sums[stop], .count = gone + stop};
        if (finish(search, search->cells, stop - 1, sequence))
            return OUT_OF_MEMORY;
    }
    for (int64_t bridge = search->bridge_starts[chain]; bridge < search->bridge_starts[chain + 1];
         bridge++) {
        int64_t leave = search->starts[chain] + search->ends[4 * bridge + 1];
        if (leave < state.cell)
            continue;
        if (leave >= stop || row_of(search, search->cells, leave) >= search->last_row)
            break; /* bridges are ordered by where they leave */
        int64_t total = paid + search->sums[leave + 1], count = gone + leave + 1;
        if (total > search->most * 4 * (search->last_row - search->first_row + 2))
            break;
        int failed = cross(search, bridge, search->inner_starts[bridge], number, total, count);
        if (failed)
            return failed;
    }
    return 0;
}

static int run(Search *search)
{
    int failed = 0;
    while (!failed && search->waiting.count)
        failed = walk(search, next_waiting(search));
    return failed;
}

static int search_all(Search *search)
{
    int failed = 0;
    for (int64_t chain = 0; chain < search->chains && !failed; chain++) {
        int64_t start = search->starts[chain], end = search->starts[chain + 1];
        int64_t first = row_of(search, search->cells, start);
        if (first > search->first_row + search->slack || first > search->last_row ||
            row_of(search, search->cells, end - 1) < search->first_row)
            continue;
        int64_t at = first_in_row(search, search->cells, start, end, search->first_row);
        search->stamp++;
        search->start_column = column_of(search, search->cells, at) + search->first_row -
                               row_of(search, search->cells, at);
        State way = {.cell = at, .parent = -1, .bridge = -1, .from = -1};
        failed = enter(search, way);
        failed = failed ? failed : run(search);
    }
    for (int64_t bridge = 0; bridge < search->bridges && !failed; bridge++) {
        int64_t start = search->inner_starts[bridge], end = search->inner_starts[bridge + 1];
        if (start == end || row_of(search, search->inner_cells, start) > search->first_row ||
            row_of(search, search->inner_cells, end - 1) < search->first_row)
            continue;
        int64_t at = first_in_row(search, search->inner_cells, start, end, search->first_row);
        search->stamp++;
        search->start_column = column_of(search, search->inner_cells, at);
        failed = cross(search, bridge, at, -1, 0, 0);
        failed = failed ? failed : run(search);
    }
    return failed;
}

/* Whether numbers grow from 0 to the count of what they divide. */
static int divides(const Array *starts, int64_t count)
{
    const int64_t *values = starts->view.buf;
    if (starts->length < 1 || values[0] != 0 || values[starts->length - 1] != count)
        return 0;
    for (Py_ssize_t n = 1; n < starts->length; n++)
        if (values[n] < values[n - 1])
            return 0;
    return 1;
}

static PyObject *bytes_of(const List *list)
{
    return PyBytes_FromStringAndSize(list->items, (Py_ssize_t)(list->count * list->size));
}

PyDoc_STRVAR(find_sequences_doc,
"find_sequences(cells, starts, sums, chain_of, ends, bridge_starts, inner_cells, inner_starts, "
"inner_sums, role, first_row, last_row, slack, most)\n--\n\n"
"Give the match sequences from one row to another and the states that they went through, as "
"two arrays of int64 in bytes.");

static PyObject *find_sequences(PyObject *module, PyObject *arguments)
{
    (void)module;
    static const char *const names[] = {"cells", "starts", "sums", "chain_of", "ends",
                                        "bridge_starts", "inner_cells", "inner_starts",
                                        "inner_sums"};
    static const int wide[] = {0, 1, 1, 1, 0, 1, 0, 1, 1};
    enum { CELLS, STARTS, SUMS, CHAIN_OF, ENDS, BRIDGE_STARTS, INNER, INNER_STARTS, INNER_SUMS };
    PyObject *objects[9], *result = NULL;
    Array arrays[9];
    Search search = {.states = {.size = sizeof(State)}, .sequences = {.size = sizeof(Sequence)},
                     .waiting = {.size = sizeof(int64_t)}};
    Py_ssize_t first_row, last_row, slack, most;
    memset(arrays, 0, sizeof arrays);
    if (!PyArg_ParseTuple(arguments, "OOOOOOOOOinnnn", &objects[0], &objects[1], &objects[2],
                          &objects[3], &objects[4], &objects[5], &objects[6], &objects[7],
                          &objects[8], &search.role, &first_row, &last_row, &slack, &most))
        return NULL;
    for (int n = 0; n < 9; n++)
        if (take_array(objects[n], &arrays[n], names[n], wide[n] ? INT64 : INT32, wide[n] ? 8 : 4,
                       0) < 0)
            goto done;
    int64_t cells = arrays[CELLS].length / 2, inner = arrays[INNER].length / 2;
    search.chains = arrays[STARTS].length - 1;
    search.bridges = arrays[INNER_STARTS].length - 1;
    if (!divides(&arrays[STARTS], cells) || !divides(&arrays[INNER_STARTS], inner) ||
        !divides(&arrays[BRIDGE_STARTS], search.bridges) || arrays[SUMS].length != cells + 1 ||
        arrays[CHAIN_OF].length != cells || arrays[INNER_SUMS].length != inner + 1 ||
        arrays[ENDS].length != 4 * search.bridges || (search.role != 0 && search.role != 1) ||
        arrays[BRIDGE_STARTS].length != search.chains + 1 || first_row > last_row || slack < 0) {
        PyErr_SetString(PyExc_ValueError, "the arrays of a web don't fit each other");
        goto done;
    }
    search.cells = arrays[CELLS].view.buf;
    search.starts = arrays[STARTS].view.buf;
    search.sums = arrays[SUMS].view.buf;
    search.chain_of = arrays[CHAIN_OF].view.buf;
    search.ends = arrays[ENDS].view.buf;
    search.bridge_starts = arrays[BRIDGE_STARTS].view.buf;
    search.inner_cells = arrays[INNER].view.buf;
    search.inner_starts = arrays[INNER_STARTS].view.buf;
    search.inner_sums = arrays[INNER_SUMS].view.buf;
    search.first_row = first_row;
    search.last_row = last_row;
    search.slack = slack;
    search.most = most;
    int failed;
    Py_BEGIN_ALLOW_THREADS
    search.slots = malloc((size_t)(cells + 1) * sizeof(int64_t));
    search.stamps = calloc((size_t)cells + 1, sizeof(int64_t));
    failed = search.slots && search.stamps ? search_all(&search) : OUT_OF_MEMORY;
    Py_END_ALLOW_THREADS
    if (failed == OUT_OF_MEMORY)
        PyErr_NoMemory();
    else if (failed)
        PyErr_SetString(PyExc_ValueError, "a bridge of the web leads nowhere");
    else
        result = Py_BuildValue("NN", bytes_of(&search.sequences), bytes_of(&search.states));
done:
    for (int n = 0; n < 9; n++)
        release_array(&arrays[n]);
    free(search.slots);
    free(search.stamps);
    free(search.states.items);
    free(search.sequences.items);
    free(search.waiting.items);
    return result;
}

static PyMethodDef functions[] = {
    {"find_sequences", find_sequences, METH_VARARGS, find_sequences_doc},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "_sequences",
    .m_doc = "The search for match sequences.",
    .m_size = 0,
    .m_methods = functions,
};

PyMODINIT_FUNC PyInit__sequences(void)
{
    return PyModuleDef_Init(&definition);
}
