"""The search for match sequences without a compiler: what ``kernels/sequences.c`` does."""

import heapq
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mocapidx.graphs.search_paths import SearchPaths
from mocapidx.model import IndexArray

__all__ = ["find_sequences_python"]


@dataclass(slots=True)
class _State:
    """A way into a chain: from where, and what it took before the cell."""

    cell: int
    parent: int
    bridge: int
    start: int
    total: int
    count: int

    def row(self) -> list[int]:
        return [self.cell, self.parent, self.bridge, self.start, self.total, self.count]


def find_sequences_python(
    found: SearchPaths, role: int, first_row: int, last_row: int, slack: int, most: int
) -> tuple[IndexArray, IndexArray]:
    """Find the match sequences from one row to another.

    Parameters
    ----------
    found : SearchPaths
    role, first_row, last_row, slack : int
        As in `mocapidx.graphs.sequences.find_sequences`.
    most : int
        Most that a sequence may cost, in units of the distances.

    Returns
    -------
    table : ndarray of int64, shape (S, 8)
        Total, cells, first column, last column, state, bridge, where on it, last cell.
    states : ndarray of int64, shape (N, 6)
        Cell, state before, bridge, where on it, total and cells before the cell.

    Raises
    ------
    ValueError
        If a bridge leads nowhere.
    """
    search = _Search(found, role, first_row, last_row, slack, most)
    search.run()
    table = np.array(search.table, dtype=np.int64).reshape(-1, 8)
    states = np.array([state.row() for state in search.states], dtype=np.int64)
    return table, states.reshape(-1, 6)


class _Search:
    def __init__(
        self, found: SearchPaths, role: int, first_row: int, last_row: int, slack: int, most: int
    ) -> None:
        paths = found.paths
        self.found, self.paths = found, paths
        self.rows, self.columns = paths.cells[:, role].tolist(), paths.cells[:, 1 - role].tolist()
        self.inner_rows = paths.inner_cells[:, role].tolist()
        self.inner_columns = paths.inner_cells[:, 1 - role].tolist()
        self.starts, self.inner_starts = paths.starts.tolist(), paths.inner_starts.tolist()
        self.sums, self.inner_sums = found.sums.tolist(), found.inner_sums.tolist()
        self.ends = paths.ends.tolist()
        self.first_row, self.last_row, self.slack, self.most = first_row, last_row, slack, most
        self.longest = most * 4 * (last_row - first_row + 2)
        self.table: list[list[int]] = []
        self.states: list[_State] = []
        self.start_column = 0
        self.waiting: list[tuple[int, int, int]] = []
        self.slots: dict[int, int] = {}

    def run(self) -> None:
        for cell in self._chain_starts():
            self.start_column = self.columns[cell] + self.first_row - self.rows[cell]
            self.slots = {}
            self._enter(_State(cell, -1, -1, -1, 0, 0))
            self._walk_all()
        for bridge, cell in self._bridge_starts():
            self.start_column = self.inner_columns[cell]
            self.slots = {}
            self._cross(bridge, cell, -1, 0, 0)
            self._walk_all()

    def _chain_starts(self) -> Iterator[int]:
        first, last = self.paths.starts[:-1], self.paths.starts[1:] - 1
        rows = np.array(self.rows, dtype=np.int64)
        latest = min(self.first_row + self.slack, self.last_row)
        good = (rows[first] <= latest) & (rows[last] >= self.first_row)
        for chain in np.flatnonzero(good).tolist():
            bounds = self.starts[chain], self.starts[chain + 1]
            yield bisect_left(self.rows, self.first_row, *bounds)

    def _bridge_starts(self) -> Iterator[tuple[int, int]]:
        for bridge in range(self.paths.bridges):
            start, end = self.inner_starts[bridge], self.inner_starts[bridge + 1]
            if start == end or self.inner_rows[start] > self.first_row:
                continue
            if self.inner_rows[end - 1] >= self.first_row:
                yield bridge, bisect_left(self.inner_rows, self.first_row, start, end)

    def _enter(self, way: _State) -> None:
        """Wait at a cell, unless a cheaper way has come there already."""
        known = self.slots.get(way.cell)
        if known is None:
            self.slots[way.cell] = len(self.states)
            self.states.append(way)
            order = self.rows[way.cell] + self.columns[way.cell], way.cell
            heapq.heappush(self.waiting, (*order, self.slots[way.cell]))
        elif way.total * self.states[known].count < self.states[known].total * way.count:
            self.states[known] = way

    def _walk_all(self) -> None:
        while self.waiting:
            self._walk(heapq.heappop(self.waiting)[-1])

    def _walk(self, number: int) -> None:
        """Go along the chain of a state, to the last row and over all bridges on the way."""
        state = self.states[number]
        chain = int(self.found.chain_of[state.cell])
        start, end = self.starts[chain], self.starts[chain + 1]
        stop = bisect_left(self.rows, self.last_row + 1, state.cell, end)
        paid, gone = state.total - self.sums[state.cell], state.count - state.cell
        if stop > state.cell and self.rows[stop - 1] >= self.last_row - self.slack:
            last = self.columns[stop - 1] + self.last_row - self.rows[stop - 1]
            ending = [number, -1, -1, stop - 1]
            self._finish(paid + self.sums[stop], gone + stop, last, ending)
        for bridge in range(*self.found.bridge_starts[chain : chain + 2].tolist()):
            leave = start + self.ends[bridge][1]
            if leave < state.cell:
                continue
            if leave >= stop or self.rows[leave] >= self.last_row:
                break
            total = paid + self.sums[leave + 1]
            if total > self.longest:
                break
            self._cross(bridge, self.inner_starts[bridge], number, total, gone + leave + 1)

    def _cross(self, bridge: int, start: int, parent: int, total: int, count: int) -> None:
        """Go over a bridge, to the last row or on to the next chain."""
        end = self.inner_starts[bridge + 1]
        if start < end and self.inner_rows[end - 1] >= self.last_row:
            stop = bisect_left(self.inner_rows, self.last_row + 1, start, end)
            if stop > start:
                paid = total + self.inner_sums[stop] - self.inner_sums[start]
                last = self.inner_columns[stop - 1] + self.last_row - self.inner_rows[stop - 1]
                ending = [parent, bridge, start, stop - 1]
                self._finish(paid, count + stop - start, last, ending)
            return
        _, _, chain, place = self.ends[bridge]
        if not 0 <= chain < len(self.starts) - 1:
            raise ValueError("a bridge of the web leads nowhere")
        cell = self.starts[chain] + place
        if not self.starts[chain] <= cell < self.starts[chain + 1]:
            raise ValueError("a bridge of the web leads nowhere")
        if parent >= 0 and self._sum(cell) <= self._sum(self.states[parent].cell):
            raise ValueError("a bridge of the web leads nowhere")
        if self.rows[cell] <= self.last_row:
            paid = total + self.inner_sums[end] - self.inner_sums[start]
            self._enter(_State(cell, parent, bridge, start, paid, count + end - start))

    def _sum(self, cell: int) -> int:
        total: int = self.rows[cell] + self.columns[cell]
        return total

    def _finish(self, total: int, count: int, last: int, ending: list[int]) -> None:
        if total <= self.most * count:
            self.table.append([total, count, self.start_column, last, *ending])
