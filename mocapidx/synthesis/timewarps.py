"""Time alignments as curves: slope-limited paths, made smooth and strictly increasing."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import FloatArray, IndexArray

__all__ = ["STEEPEST", "MonotoneCurve", "slope_limited_path", "smooth_timewarp"]

STEEPEST: Final = 3
"""At most so many frames of one motion go with one frame of the other (paper: k)."""

STRAIGHT: Final = 0.02
"""Share of a straight line in every curve, so that it increases strictly."""


def slope_limited_path(costs: FloatArray, steepest: int = STEEPEST) -> IndexArray | None:
    """Find the cheapest time alignment of two motions, from first frames to last.

    Parameters
    ----------
    costs : ndarray of float, shape (T, U)
        Distance of each frame of one motion from each of the other; all at least 0.
    steepest : int
        How many frames of one motion may go with a single frame of the other, at least 1.

    Returns
    -------
    ndarray of int64, shape (M, 2), or None
        Frames of both from 0, in steps (1, 1), (1, 0) and (0, 1); the total cost of its cells
        is least. None where one motion is too long for the other.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 3.1.
    """
    rows, columns = costs.shape
    if max(rows, columns) > steepest * min(rows, columns):
        return None
    # A move goes one frame on in one motion and up to `steepest` frames in the other, and pays
    # for all cells on its way but the one that it leaves.
    moves = [(1, 1)] + [m for n in range(2, steepest + 1) for m in ((1, n), (n, 1))]
    totals = np.full((rows, columns), np.inf)
    chosen = np.full((rows, columns), -1, dtype=np.int8)
    # At the start there may be several frames of one motion before any move.
    totals[0, :steepest] = np.cumsum(costs[0, :steepest])
    totals[:steepest, 0] = np.cumsum(costs[:steepest, 0])
    for row in range(1, rows):
        for number, (down, right) in enumerate(moves):
            if down > row or right >= columns:
                continue
            paid = _paid(costs, row, down, right)
            total = totals[row - down, : columns - right] + paid
            better = total < totals[row, right:]
            totals[row, right:][better] = total[better]
            chosen[row, right:][better] = number
    if not np.isfinite(totals[-1, -1]):
        return None
    path = [(rows - 1, columns - 1)]
    while path[-1] != (0, 0):
        row, column = path[-1]
        if chosen[row, column] < 0:
            path.append((max(row - 1, 0), max(column - 1, 0)))  # one of them is 0
            continue
        down, right = moves[chosen[row, column]]
        path += [(row, column - n) for n in range(1, right)]
        path += [(row - n, column) for n in range(1, down)]
        path.append((row - down, column - right))
    return np.array(path[::-1], dtype=np.int64)


def _paid(costs: FloatArray, row: int, down: int, right: int) -> FloatArray:
    """Return what a move into each cell of a row costs, for columns from `right` on."""
    columns = costs.shape[1]
    paid: FloatArray = costs[row, right:].copy()
    for n in range(1, right):
        paid += costs[row, right - n : columns - n]
    for n in range(1, down):
        paid += costs[row - n, right:]
    return paid


@dataclass(frozen=True, slots=True, eq=False)
class MonotoneCurve:
    """A strictly increasing curve through points: piecewise cubic, without overshoot.

    Parameters
    ----------
    x, y : ndarray of float64, shape (K,)
        Both strictly increasing, at least two points.

    Raises
    ------
    ParameterError
        If they do not increase.

    References
    ----------
    .. [1] Fritsch, Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17,
       1980; with the harmonic means of Fritsch and Butland, 1984.
    """

    x: FloatArray
    y: FloatArray

    def __post_init__(self) -> None:
        if len(self.x) < 2 or self.x.shape != self.y.shape:
            raise ParameterError("a curve goes through at least two points")
        if not ((np.diff(self.x) > 0).all() and (np.diff(self.y) > 0).all()):
            raise ParameterError("the points of a monotone curve must increase in both")

    def inverse(self) -> "MonotoneCurve":
        """Give the curve with its axes exchanged, through the same points."""
        return MonotoneCurve(self.y, self.x)

    def __call__(self, at: FloatArray) -> FloatArray:
        """Evaluate the curve; beside its ends it stays where it is."""
        at = np.clip(at, self.x[0], self.x[-1])
        i = np.clip(np.searchsorted(self.x, at, side="right") - 1, 0, len(self.x) - 2)
        width = np.diff(self.x)[i]
        s = (at - self.x[i]) / width
        slopes = self._slopes()
        y0, y1 = self.y[i], self.y[i + 1]
        bend = s * (1 - s) * ((1 - s) * slopes[i] - s * slopes[i + 1]) * width
        values: FloatArray = y0 + (y1 - y0) * s * s * (3 - 2 * s) + bend
        return np.clip(values, y0, y1)

    def _slopes(self) -> FloatArray:
        """Return the slopes at the points: weighted harmonic means of those beside them."""
        widths, rises = np.diff(self.x), np.diff(self.y)
        secants = rises / widths
        slopes = np.empty_like(self.x)
        slopes[0], slopes[-1] = secants[0], secants[-1]
        before, after = 2 * widths[1:] + widths[:-1], widths[1:] + 2 * widths[:-1]
        slopes[1:-1] = (before + after) / (before / secants[:-1] + after / secants[1:])
        return slopes


def smooth_timewarp(path: IndexArray, width: int) -> MonotoneCurve:
    """Turn a time alignment into a strictly increasing spline that ends where it ends.

    Both coordinates are averaged along the path, with the path mirrored at its ends: averages
    of what increases increase, and the ends stay in their places. The result does not depend
    on which motion comes first.

    Parameters
    ----------
    path : ndarray of int64, shape (M, 2)
        In steps (1, 1), (1, 0) and (0, 1).
    width : int
        How many cells to either side are averaged, from 0; their weights fall to 0.

    Returns
    -------
    MonotoneCurve
        From frames of the first motion to frames of the second.

    Raises
    ------
    ParameterError
        If a motion has a single frame.
    """
    cells = path.astype(np.float64)
    if (cells[-1] - cells[0] < 1).any():
        raise ParameterError("a stretch of a single frame can't be aligned with others")
    count = len(cells)
    width = min(width, count - 1)
    weights = 1.0 - np.abs(np.arange(-width, width + 1)) / (width + 1)
    weights /= weights.sum()
    padded = np.concatenate(
        (2 * cells[0] - cells[width:0:-1], cells, 2 * cells[-1] - cells[-2 : -2 - width : -1])
    )
    smooth = np.stack(
        [np.convolve(padded[:, axis], weights, mode="valid") for axis in (0, 1)], axis=1
    )
    line = cells[0] + np.linspace(0, 1, count)[:, None] * (cells[-1] - cells[0])
    curve = (1 - STRAIGHT) * smooth + STRAIGHT * line
    curve[0], curve[-1] = cells[0], cells[-1]  # to the last bit
    return MonotoneCurve(curve[:, 0], curve[:, 1])
