"""Chains and bridges without a compiler: what ``kernels/webs.c`` does, in NumPy and Python.

It takes some hundred times as long, which small stores bear.
"""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.model import BoolArray

__all__ = ["find_paths_numpy", "mark_grid"]

NO_WAY: Final = 1 << 30
REACHED: Final = (1 << 30) - (1 << 20)
COUNT_BITS: Final = 7
COUNTS: Final = (1 << COUNT_BITS) - 1
SOURCES: Final = 256
"""Cells from which bridges are sought at once; bounds the memory."""

Grid = NDArray[np.uint16]
Parts = tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]
Cell = tuple[int, int]


def find_paths_numpy(
    grid: Grid,
    diagonal: int | None,
    alpha: int,
    steepest: int,
    shortest: int,
    reach: int,
    stop_below: bool,
    restart: bool,
    stop_at_chains: bool,
) -> Parts:
    """Find the chains and bridges of a grid.

    Parameters
    ----------
    grid : ndarray of uint16, shape (rows, columns)
    diagonal : int or None
        Only cells ``(i, j)`` with ``j > i - diagonal`` become part of paths; None: all.
    alpha : int
        Per mille.
    steepest : int
        Most cells of a path in one row or column.
    shortest : int
        Twice the least length of a chain, in cells.
    reach : int
        A bridge takes fewer steps along rows and columns together.
    stop_below, restart, stop_at_chains : bool
        As in `mocapidx.graphs.paths.PathRules`.

    Returns
    -------
    tuple of ndarray
        Cells of the chains, where each chain begins, ends of the bridges, inner cells of the
        bridges, and where each bridge begins.
    """
    minima, region = mark_grid(grid, alpha, stop_below)
    if diagonal is not None:
        beyond = np.arange(grid.shape[1]) > np.arange(grid.shape[0])[:, None] - diagonal
        minima, region = minima & beyond, region & beyond
    chains = [
        chain
        for chain in _chains(grid, minima, steepest, restart)
        if sum(chain[-1]) - sum(chain[0]) + 2 >= shortest
    ]
    cells = np.array([cell for chain in chains for cell in chain], np.int32).reshape(-1, 2)
    starts = np.cumsum([0, *map(len, chains)]).astype(np.int64)
    bridges = _bridges(grid, region, cells, starts, steepest, reach, stop_at_chains)
    ends = np.array([bridge[0] for bridge in bridges], np.int32).reshape(-1, 4)
    inner = np.array([cell for _, path in bridges for cell in path], np.int32).reshape(-1, 2)
    inner_starts = np.cumsum([0, *(len(path) for _, path in bridges)]).astype(np.int64)
    return cells, starts, ends, inner, inner_starts


def mark_grid(grid: Grid, alpha: int, stop_below: bool) -> tuple[BoolArray, BoolArray]:
    """Find the minima along rows and columns, and the valid region around them.

    Parameters
    ----------
    grid : ndarray of uint16, shape (rows, columns)
    alpha : int
        Per mille.
    stop_below : bool

    Returns
    -------
    minima, region : ndarray of bool, shape (rows, columns)
    """
    along, across = _mark_rows(grid, alpha, stop_below), _mark_rows(grid.T, alpha, stop_below)
    return along[0] | across[0].T, along[1] | across[1].T


def _mark_rows(grid: Grid, alpha: int, stop_below: bool) -> tuple[BoolArray, BoolArray]:
    minima, region = np.zeros(grid.shape, np.bool_), np.zeros(grid.shape, np.bool_)
    for row, values in enumerate(grid.astype(np.int64)):
        bounds = np.flatnonzero(np.diff(values)) + 1
        first, last = np.append(0, bounds), np.append(bounds, len(values)) - 1
        runs = np.pad(values[first], 1, constant_values=1 << 20)  # outside all is higher
        low = (runs[1:-1] < runs[:-2]) & (runs[1:-1] < runs[2:])
        middles = (first + last)[low] // 2
        minima[row, middles] = region[row, middles] = True
        limits = (values[middles] * (1000 + alpha) + 999) // 1000
        floors = values[middles] if stop_below else np.zeros_like(middles)
        for step in (1, -1):
            at, limit, least = middles + step, limits, floors
            while True:
                inside = (at >= 0) & (at < len(values))
                at, limit, least = at[inside], limit[inside], least[inside]
                good = (values[at] < limit) & (values[at] >= least)
                at, limit, least = at[good], limit[good], least[good]
                if not len(at):
                    break
                region[row, at] = True
                at = at + step
    return minima, region


def _chains(grid: Grid, minima: BoolArray, steepest: int, restart: bool) -> Iterator[list[Cell]]:
    """Follow the minima from those that have none before them, in row-major order."""
    known = np.pad(minima, ((1, 0), (1, 0)))
    starts = minima & ~(known[:-1, 1:] | known[1:, :-1] | known[:-1, :-1])
    free: set[Cell] = {(i, j) for i, j in np.argwhere(minima).tolist()}
    for i, j in np.argwhere(starts).tolist():
        here: Cell | None = (i, j)
        while here is not None and here in free:
            chain, here = _chain(grid, free, here, steepest)
            yield chain
            if not restart:
                break


def _chain(
    grid: Grid, free: set[Cell], start: Cell, steepest: int
) -> tuple[list[Cell], Cell | None]:
    """Follow free minima from one; also tell which the slope limit kept out at its end."""
    chain, (i, j) = [start], start
    level = upright = 1
    free.discard(start)
    while True:
        up, right = (i + 1, j) in free, (i, j + 1) in free
        may_up, may_right = up and upright < steepest, right and level < steepest
        if (i + 1, j + 1) in free:
            i, j, level, upright = i + 1, j + 1, 1, 1
        elif may_up and not (may_right and grid[i, j + 1] < grid[i + 1, j]):
            i, level, upright = i + 1, 1, upright + 1
        elif may_right:
            j, level, upright = j + 1, level + 1, 1
        else:
            return chain, (i + 1, j) if up else (i, j + 1) if right else None
        chain.append((i, j))
        free.discard((i, j))


def _bridges(
    grid: Grid,
    region: BoolArray,
    cells: NDArray[np.int32],
    starts: NDArray[np.int64],
    steepest: int,
    reach: int,
    stop_at_chains: bool,
) -> list[tuple[tuple[int, int, int, int], list[Cell]]]:
    """Find the best bridge for each two chains, in the order in which they were met."""
    owners = np.zeros(grid.shape, np.int32)
    chain_of = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    owners[*cells.T] = chain_of + 1
    costs = (grid.astype(np.int64) << COUNT_BITS) - 1
    search = _Search(costs, region, owners, steepest, reach, stop_at_chains)
    best: dict[tuple[int, int], tuple[int, int, int, int, int]] = {}
    for top in range(0, len(cells), SOURCES):
        ways = search.ways(cells[top : top + SOURCES])
        for number, target, key in search.arrivals(ways, cells[top : top + SOURCES], top):
            pair = int(chain_of[number]), int(owners[target]) - 1
            total, count = key >> COUNT_BITS, COUNTS - (key & COUNTS)
            if pair not in best or total * best[pair][1] < best[pair][0] * count:
                best[pair] = (total, count, number, *target)
    # Python keeps the order in which pairs were met, as C does; chains come one after another.
    found = []
    sources = [entry[2] for entry in best.values()]
    for top in range(0, len(sources), SOURCES):
        ways = search.ways(cells[sources[top : top + SOURCES]])
        chosen = list(best.items())[top : top + SOURCES]
        for place, ((chain, other), (_, _, number, i, j)) in enumerate(chosen):
            path = search.trace_back(ways, place, tuple(cells[number].tolist()), (i, j))
            along = cells[starts[other] : starts[other + 1]].sum(axis=1)
            to_cell = int(np.searchsorted(along, i + j))
            found.append(((chain, int(number - starts[chain]), other, to_cell), path[1:-1]))
    return found


class _Search:
    """Dynamic programming over the triangle that each of many cells can reach."""

    def __init__(
        self,
        costs: NDArray[np.int64],
        region: BoolArray,
        owners: NDArray[np.int32],
        steepest: int,
        reach: int,
        stop_at_chains: bool,
    ) -> None:
        self.costs, self.region, self.owners = costs, region, owners
        self.k, self.reach, self.stop = steepest, reach, stop_at_chains

    def ways(self, sources: NDArray[np.int32]) -> NDArray[np.int64]:
        """Give the keys of the states, shape (sources, rows, columns, states)."""
        k, reach = self.k, self.reach
        keys = np.full((len(sources), reach + 1, reach + 1, 2 * k - 1), NO_WAY, np.int64)
        rows, columns = self.costs.shape  # keys have a border before the first row and column
        for step in range(reach):
            di = np.arange(step + 1)
            dj = step - di
            i, j = sources[:, :1] + di, sources[:, 1:] + dj
            inside = (i < rows) & (j < columns)
            i, j = np.minimum(i, rows - 1), np.minimum(j, columns - 1)
            cost = self.costs[i, j]
            if step == 0:
                keys[:, 1, 1, 0] = cost[:, 0] + COUNTS
                continue
            open_ = self._open(keys, sources)
            here = np.full((*i.shape, 2 * k - 1), NO_WAY, np.int64)
            here[..., 0] = open_(di, dj).min(axis=-1)
            if k > 1:
                left, below = open_(di + 1, dj), open_(di, dj + 1)
                here[..., 1] = np.minimum(left[..., 0], left[..., k:].min(axis=-1))
                here[..., 2:k] = left[..., 1 : k - 1]
                here[..., k] = below[..., :k].min(axis=-1)
                here[..., k + 1 :] = below[..., k : 2 * k - 2]
            here += cost[..., None]
            good = inside & self.region[i, j] & (here.min(axis=-1) < REACHED)
            here[~good | (here >= REACHED).all(axis=-1)] = NO_WAY
            keys[:, di + 1, dj + 1] = np.where(here < REACHED, here, NO_WAY)
        return keys

    def _open(self, keys: NDArray[np.int64], sources: NDArray[np.int32]) -> Any:
        """Read states from which a path may go on: not those at the end of a bridge."""
        rows, columns = self.costs.shape

        def at(di: NDArray[np.int64], dj: NDArray[np.int64]) -> NDArray[np.int64]:
            found = keys[:, di, dj]
            if not self.stop:
                return found
            i = np.minimum(sources[:, :1] + np.maximum(di - 1, 0), rows - 1)
            j = np.minimum(sources[:, 1:] + np.maximum(dj - 1, 0), columns - 1)
            ended = (self.owners[i, j] > 0) & ((di > 1) | (dj > 1))
            return np.where(ended[..., None], NO_WAY, found)

        return at

    def arrivals(
        self, ways: NDArray[np.int64], sources: NDArray[np.int32], first: int
    ) -> Iterator[tuple[int, Cell, int]]:
        """List where paths come to other chains, source by source, row by row."""
        keys = ways[:, 1:, 1:].min(axis=-1)
        number, di, dj = np.nonzero(keys < REACHED)
        i, j = sources[number, 0] + di, sources[number, 1] + dj
        owner = self.owners[i, j]
        there = (owner > 0) & (owner != self.owners[*sources[number].T])
        where = zip(number[there], i[there], j[there], keys[number, di, dj][there], strict=True)
        for place, row, column, key in where:
            yield first + int(place), (int(row), int(column)), int(key)

    def trace_back(
        self, ways: NDArray[np.int64], place: int, source: Cell, target: Cell
    ) -> list[Cell]:
        """List the cells of the best path, both ends included."""
        keys, k = ways[place, 1:, 1:], self.k
        (i, j), path = target, [target]
        state = int(keys[i - source[0], j - source[1]].argmin())
        while (i, j) != source:
            before = keys[i - source[0], j - source[1], state] - self.costs[i, j]
            last = state
            i -= last == 0 or last >= k
            j -= last < k
            fits = np.ones(2 * k - 1, np.bool_)
            if last > 0:
                fits[:] = False
                if last not in (1, k):
                    fits[last - 1] = True
                elif last == 1:
                    fits[0] = fits[k:] = True
                else:
                    fits[:k] = True
            state = int((fits & (keys[i - source[0], j - source[1]] == before)).argmax())
            path.append((int(i), int(j)))
        return path[::-1]
