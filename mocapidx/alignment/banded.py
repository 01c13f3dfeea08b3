"""Dynamic time warping inside a region of the cost matrix.

The rest of the matrix is never looked at: its distances are not even computed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.alignment.coarse import Region, SegmentMatch, widened_region
from mocapidx.alignment.distances import FrameDistance
from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray, IndexArray

__all__ = ["MOST_CELLS", "Refinement", "WarpingPath", "align_inside", "refine_match"]

MOST_CELLS: Final = 1 << 28
"""A byte each is held: two takes of nine minutes at 30 Hz without any region."""

CELLS_AT_ONCE: Final = 1 << 11
"""Distances that are asked for together: enough for each call to be worth it."""

WIDER: Final = 4
"""A margin that was too narrow is so many times as wide in the next round."""

DIAGONAL, ROW, COLUMN = np.arange(3, dtype=np.int8)  # the steps, as they win ties


@dataclass(frozen=True, slots=True, eq=False)
class WarpingPath:
    """Which frame of one motion goes with which of another.

    Parameters
    ----------
    rows, columns : ndarray of int64, shape (M,)
        Frames of the two, from 0; each step goes one frame on in one of them or in both.
    costs : ndarray of float64, shape (M,)
        The distances of the frames.
    """

    rows: IndexArray
    columns: IndexArray
    costs: FloatArray

    @property
    def cost(self) -> float:
        """The sum of the distances."""
        return float(self.costs.sum())


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """A warping path, and the region it was found in.

    Parameters
    ----------
    path : WarpingPath
    region : Region
        As it was in the last round.
    rounds : int
        How often a path was sought, from 1.
    """

    path: WarpingPath
    region: Region
    rounds: int


def refine_match(match: SegmentMatch, distance: FrameDistance, margin: int) -> Refinement:
    """Refine a coarse alignment: dynamic time warping inside its widened segments only.

    Where the path runs along the border of the region, the best one may lie outside; the
    segments there get a wider margin, until it does so nowhere.

    Parameters
    ----------
    match : SegmentMatch
    distance : callable
        From frames of one motion and frames of the other to distances.
    margin : int
        How far segments are widened at first, in frames from 0.

    Returns
    -------
    Refinement

    Raises
    ------
    ParameterError
        If the margin is negative or the region gets too large.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, "Efficient content-based retrieval of motion capture
       data", SIGGRAPH 2005, section 7.
    """
    margins = np.full(len(match.words), margin, dtype=np.int64)
    rounds = 0
    while True:
        region = widened_region(match, margins)
        path = align_inside(region, distance)
        rounds += 1
        narrow = _narrow_segments(match, region, path)
        if not narrow.any():
            return Refinement(path, region, rounds)
        margins = np.where(narrow, np.maximum(WIDER * margins, 1), margins)


def _narrow_segments(match: SegmentMatch, region: Region, path: WarpingPath) -> BoolArray:
    """Tell which segments keep the path from leaving the region."""
    k, column = path.rows, path.columns
    above = region.highs[np.maximum(k - 1, 0)]
    below = region.lows[np.minimum(k + 1, len(region.lows) - 1)]
    right = (column < region.columns - 1) & ((column + 1 == region.highs[k]) | (column >= above))
    left = (column > 0) & ((column == region.lows[k]) | (column < below))
    at = np.flatnonzero(right | left)
    segments = np.searchsorted(match.bounds, k[at], side="right") - 1
    others = np.searchsorted(match.other_bounds, column[at], side="right") - 1
    changes = np.zeros(len(match.words) + 1, dtype=np.int64)
    np.add.at(changes, np.minimum(segments, others), 1)
    np.add.at(changes, np.maximum(segments, others) + 1, -1)
    return np.asarray(np.cumsum(changes[:-1]) > 0)


def align_inside(region: Region, distance: FrameDistance) -> WarpingPath:
    """Find the cheapest path from the first cell to the last one inside a region.

    Steps are (1, 1), (1, 0) and (0, 1); ties are won in this order, going back from the end.
    Distances are asked for some diagonals at a time.

    Parameters
    ----------
    region : Region
    distance : callable
        From rows and columns, two vectors, to finite distances.

    Returns
    -------
    WarpingPath

    Raises
    ------
    ParameterError
        If the region has more than `MOST_CELLS` cells.
    """
    if region.cells > MOST_CELLS:
        raise ParameterError(
            f"the alignment would look at {region.cells:,} pairs of frames, at most "
            f"{MOST_CELLS:,}; align shorter stretches (FILE@START:END)"
        )
    # Diagonal s has the cells k + l = s. Neither end of the rows' intervals ever decreases, so
    # it crosses the region in one stretch of rows, whose ends move on by at most one each time.
    rows = np.arange(len(region.lows))
    diagonals = np.arange(len(rows) + region.columns - 1)
    tops = np.searchsorted(rows + region.highs, diagonals, side="right")
    bottoms = np.searchsorted(rows + region.lows, diagonals, side="right")
    # Entry k + 1 is for row k; beside the stretch stand infinite ones, which no step leaves.
    before, last, current = np.full((3, len(rows) + 2), np.inf)
    before[0] = 0.0  # the cell before the first, reached by the diagonal step
    steps: list[NDArray[np.int8]] = []
    costs = _distances_by_diagonal(distance, tops, bottoms)
    for top, bottom, cost in zip(tops.tolist(), bottoms.tolist(), costs, strict=True):
        diagonal, row, column = before[top:bottom], last[top:bottom], last[top + 1 : bottom + 1]
        best = np.minimum(diagonal, row)
        step = (row < diagonal).view(np.int8)
        steps.append(np.maximum(step, (column < best).view(np.int8) * COLUMN))
        np.add(np.minimum(best, column), cost, out=current[top + 1 : bottom + 1])
        current[top] = current[bottom + 1] = np.inf
        before, last, current = last, current, before
    path_rows, path_columns = _walk_back(steps, tops, len(rows), region.columns)
    return WarpingPath(path_rows, path_columns, distance(path_rows, path_columns))


def _distances_by_diagonal(
    distance: FrameDistance, tops: IndexArray, bottoms: IndexArray
) -> Iterator[FloatArray]:
    """Yield the distances along one diagonal after the other."""
    ends = np.cumsum(bottoms - tops)
    first = 0
    while first < len(ends):
        done = ends[first - 1] if first else 0
        last = max(int(np.searchsorted(ends, done + CELLS_AT_ONCE, side="right")), first + 1)
        lengths = bottoms[first:last] - tops[first:last]
        borders = ends[first:last] - done
        k = np.arange(borders[-1]) + np.repeat(tops[first:last] - borders + lengths, lengths)
        column = np.repeat(np.arange(first, last), lengths) - k
        yield from np.split(distance(k, column), borders[:-1])
        first = last


def _walk_back(
    steps: list[NDArray[np.int8]], tops: IndexArray, rows: int, columns: int
) -> tuple[IndexArray, IndexArray]:
    k, column = rows - 1, columns - 1
    path = [(k, column)]
    while k or column:
        step = steps[k + column][k - tops[k + column]]
        k -= int(step != COLUMN)
        column -= int(step != ROW)
        path.append((k, column))
    walked = np.array(path[::-1], dtype=np.int64)
    return walked[:, 0], walked[:, 1]
