"""The paths of a match web through one grid of frame distances.

Chains of minima are stretches of two motions in which it is clear which frame goes with which;
bridges join chains that lie close together. The work is done in C where it was built, else by
`mocapidx.graphs.paths_numpy`, with the same outcome.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.graphs.frame_distance import WINDOW
from mocapidx.graphs.paths_numpy import find_paths_numpy
from mocapidx.kernels.choice import compiled
from mocapidx.model import IndexArray

__all__ = ["GridPaths", "PathRules", "empty_paths", "find_paths", "reordered"]

MOST_SLOPE: Final = 8
MOST_REACH: Final = 120
MOST_ALPHA: Final = 1000.0


@dataclass(frozen=True, slots=True)
class PathRules:
    """What makes a path. The last four are repairs of what the paper prints; False: as printed.

    Parameters
    ----------
    window : float
        Seconds before and after a frame that are compared with it.
    alpha : float
        The valid region extends from a minimum up to a cell that is larger by this share.
    slope : int
        Most frames of one motion that go with a single frame of the other, 1 to 8.
    chain_seconds : float
        Shorter chains are dropped.
    bridge_seconds : float
        A bridge advances by less than this, in both motions together.
    stop_below : bool
        The region also stops at a cell below the minimum, which belongs to another one; else it
        runs over shallow minima down all slopes and covers nearly the whole grid.
    restart : bool
        A minimum that only the slope limit kept out of a chain starts the next one; else it is
        in none, as it has a predecessor.
    stop_at_chains : bool
        A bridge ends at the first cell of a chain that it meets; else it may run along chains.

    Raises
    ------
    ParameterError
        If a value is out of its bounds.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, sections 3.1 and 3.2.
    """

    window: float = WINDOW
    alpha: float = 0.15
    slope: int = 3
    chain_seconds: float = 0.25
    bridge_seconds: float = 2.0
    stop_below: bool = True
    restart: bool = True
    stop_at_chains: bool = True

    def __post_init__(self) -> None:
        bounds = {
            "window": (self.window, 0, 2),
            "alpha": (self.alpha, 0, MOST_ALPHA),
            "slope": (self.slope, 1, MOST_SLOPE),
            "chain_seconds": (self.chain_seconds, 0, 60),
            "bridge_seconds": (self.bridge_seconds, 0, 2),
        }
        for name, (value, low, high) in bounds.items():
            if not low <= value <= high:
                raise ParameterError(f"{name} must be from {low} to {high}, got {value}")


@dataclass(frozen=True, slots=True, eq=False)
class GridPaths:
    """Chains and bridges of a grid.

    Parameters
    ----------
    cells : ndarray of int32, shape (N, 2)
        Row and column of the chains' cells, chains end to end.
    starts : ndarray of int64, shape (chains + 1,)
        Where each chain begins in `cells`; the last is their number.
    values : ndarray of uint16, shape (N,)
        Distances of the cells.
    ends : ndarray of int32, shape (bridges, 4)
        Of each bridge: the chain it leaves and the number of the cell in that chain, the chain
        it comes to and the number of the cell there. Ordered by all four.
    inner_cells : ndarray of int32, shape (M, 2)
        What lies between the ends, bridges end to end; a bridge of neighbours has nothing.
    inner_starts : ndarray of int64, shape (bridges + 1,)
    inner_values : ndarray of uint16, shape (M,)
    """

    cells: NDArray[np.int32]
    starts: IndexArray
    values: NDArray[np.uint16]
    ends: NDArray[np.int32]
    inner_cells: NDArray[np.int32]
    inner_starts: IndexArray
    inner_values: NDArray[np.uint16]

    @property
    def chains(self) -> int:
        """Number of chains."""
        return len(self.starts) - 1

    @property
    def bridges(self) -> int:
        """Number of bridges."""
        return len(self.ends)


def find_paths(
    grid: NDArray[np.uint16], rate: float, rules: PathRules, *, diagonal: int | None = None
) -> GridPaths:
    """Find the chains and bridges of a grid.

    Parameters
    ----------
    grid : ndarray of uint16, shape (rows, columns)
        Frame distances, in whole steps.
    rate : float
        Frames a second of both motions, in Hz.
    rules : PathRules
    diagonal : int, optional
        Where a motion is compared with itself: row ``i`` and column ``i - diagonal`` are the
        same frame. Only cells beyond the diagonal become part of paths.

    Returns
    -------
    GridPaths
        Distances in the steps of the grid.

    Raises
    ------
    ParameterError
        If a bridge may be longer than 120 frames at this rate.
    """
    limits = _limits(rate, rules)
    kernel = compiled("webs")
    grid = np.ascontiguousarray(grid)
    if kernel is None:
        cells, starts, ends, inner, inner_starts = find_paths_numpy(grid, diagonal, *limits)
    else:
        parts = kernel.find_paths(grid, *grid.shape, diagonal, *limits)
        kinds = (np.int32, np.int64, np.int32, np.int32, np.int64)
        cells, starts, ends, inner, inner_starts = map(np.frombuffer, parts, kinds)
    cells, ends, inner = cells.reshape(-1, 2), ends.reshape(-1, 4), inner.reshape(-1, 2)
    values, inner_values = grid[*cells.T], grid[*inner.T]
    found = GridPaths(cells, starts, values, ends, inner, inner_starts, inner_values)
    return reordered(found, np.lexsort(ends.T[::-1]))


def reordered(paths: GridPaths, order: IndexArray) -> GridPaths:
    """Give the paths with some of their bridges, in another order.

    Parameters
    ----------
    paths : GridPaths
    order : ndarray of int64
        Numbers of the bridges that are to be kept.

    Returns
    -------
    GridPaths
    """
    lengths = np.diff(paths.inner_starts)[order]
    inner_starts = np.concatenate(([0], np.cumsum(lengths))).astype(np.int64)
    shift = np.repeat(paths.inner_starts[:-1][order] - inner_starts[:-1], lengths)
    kept = np.arange(inner_starts[-1]) + shift
    return replace(
        paths,
        ends=paths.ends[order],
        inner_cells=paths.inner_cells[kept],
        inner_starts=inner_starts,
        inner_values=paths.inner_values[kept],
    )


def _limits(rate: float, rules: PathRules) -> tuple[int, int, int, int, bool, bool, bool]:
    """Give the rules as the kernels take them: whole numbers of cells and per mille."""
    reach = max(int(np.ceil(rules.bridge_seconds * rate - 1e-9)), 1)
    if reach > MOST_REACH:
        raise ParameterError(
            f"bridges of {rules.bridge_seconds} s at {rate:g} Hz reach {reach} frames, at most "
            f"{MOST_REACH}; build the web at a lower rate"
        )
    shortest = int(np.ceil(2 * rules.chain_seconds * rate - 1e-9))
    repairs = (rules.stop_below, rules.restart, rules.stop_at_chains)
    return round(1000 * rules.alpha), rules.slope, shortest, reach, *repairs


def empty_paths() -> GridPaths:
    """Give the paths of a grid that has none."""
    cells, starts = np.empty((0, 2), np.int32), np.zeros(1, np.int64)
    values, ends = np.empty(0, np.uint16), np.empty((0, 4), np.int32)
    return GridPaths(cells, starts, values, ends, cells, starts, values)
