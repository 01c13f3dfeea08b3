"""Gaps: stretches in which a point was not seen; short ones are filled, long ones stay."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.model import BoolArray, FloatArray, IndexArray

__all__ = ["FILLED", "GapCounts", "fill_gaps", "find_gaps", "stretches"]

FILLED: Final = 0.2  # seconds: the longest gap that is filled unless told otherwise
SLOPE: Final = 3  # frames on either side that tell the velocity at the edge of a gap


@dataclass(frozen=True, slots=True)
class GapCounts:
    """How much of some points was not seen.

    Parameters
    ----------
    filled, filled_frames : int
        Gaps that were filled, and the frames of points in them.
    left, left_frames : int
        Gaps that were left, and the frames of points in them.
    longest : float
        Seconds of the longest gap.
    """

    filled: int = 0
    filled_frames: int = 0
    left: int = 0
    left_frames: int = 0
    longest: float = 0.0


def stretches(mask: BoolArray) -> IndexArray:
    """Return where a mask is true.

    Parameters
    ----------
    mask : ndarray of bool, shape (T,)

    Returns
    -------
    ndarray of int64, shape (N, 2)
        Half-open stretches of frames.
    """
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    return edges.astype(np.int64).reshape(-1, 2)


def find_gaps(positions: FloatArray) -> list[IndexArray]:
    """Find the gaps of each point.

    Parameters
    ----------
    positions : ndarray of float, shape (T, P, 3)
        NaN where a point was not seen.

    Returns
    -------
    list of ndarray of int64, shape (N, 2)
        For each point its half-open stretches of frames.
    """
    unseen = np.asarray(np.isnan(positions).any(axis=2), dtype=np.bool_)
    whole = np.asarray(~unseen.any(axis=0), dtype=np.bool_)
    none = np.empty((0, 2), dtype=np.int64)
    return [none if whole[p] else stretches(unseen[:, p]) for p in range(positions.shape[1])]


def fill_gaps(positions: FloatArray, rate: float, longest: float) -> tuple[FloatArray, GapCounts]:
    """Fill short gaps between frames that are known.

    A cubic takes each point from where and how fast it was before the gap to where and how fast
    it is after it. What is missing at the beginning or the end is never filled.

    Parameters
    ----------
    positions : ndarray of float, shape (T, P, 3)
        NaN where a point was not seen.
    rate : float
        Frames a second, in Hz.
    longest : float
        Seconds; longer gaps stay. 0 fills none.

    Returns
    -------
    positions : ndarray of float, shape (T, P, 3)
        The same array where there was nothing to fill.
    counts : GapCounts
        Points that are missing throughout count as one gap.
    """
    gaps = find_gaps(positions)
    frames = len(positions)
    filled = positions
    number, within = [0, 0], [0, 0]
    lengths = [int((g[:, 1] - g[:, 0]).max()) for g in gaps if len(g)]
    for point, found in enumerate(gaps):
        for start, end in found.tolist():
            short = start > 0 and end < frames and end - start <= longest * rate * (1 + 1e-9)
            if short:
                filled = positions.copy() if filled is positions else filled
                filled[start:end, point] = _across(positions[:, point], start, end)
            number[short] += 1
            within[short] += end - start
    longest_gap = max(lengths, default=0) / rate
    return filled, GapCounts(number[True], within[True], number[False], within[False], longest_gap)


def _across(points: FloatArray, start: int, end: int) -> FloatArray:
    """Return the points of a gap by a cubic; a straight line where velocities are unknown."""
    before, after = start - 1, end
    width = float(after - before)
    first, last = points[before], points[after]
    chord = (last - first) / width
    early, late = max(before - SLOPE, 0), min(after + SLOPE, len(points) - 1)
    known_early = before - early if before > early else 1
    slope_in = (first - points[early]) / known_early
    slope_out = (points[late] - last) / (late - after if late > after else 1)
    if not (before > early and np.isfinite(slope_in).all()):
        slope_in = chord
    if not (late > after and np.isfinite(slope_out).all()):
        slope_out = chord
    s = (np.arange(start, end)[:, None] - before) / width
    smooth: FloatArray = (
        (2 * s**3 - 3 * s**2 + 1) * first
        + (s**3 - 2 * s**2 + s) * width * slope_in
        + (3 * s**2 - 2 * s**3) * last
        + (s**3 - s**2) * width * slope_out
    )
    return smooth
