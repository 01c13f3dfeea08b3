"""Coarse alignment: two motions segment by segment, in linear time.

Two motions that go through the same sequence of feature words are aligned by their segments.
Where their words over all selected features disagree, the features are dropped on which they
do, until the sequences of the rest agree: fewer features, longer segments. The matched
segments, widened by a margin, are the region of the cost matrix that a finer alignment needs.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import IndexArray, WordArray
from mocapidx.segments.runs import find_runs

__all__ = ["Region", "SegmentMatch", "full_region", "match_segments", "widened_region"]

Runs: TypeAlias = tuple[WordArray, IndexArray]


@dataclass(frozen=True, slots=True, eq=False)
class SegmentMatch:
    """Two motions cut into the same sequence of segments.

    Parameters
    ----------
    mask : int
        The features whose sequences agree.
    words : ndarray of uint64, shape (S,)
        The feature word of each segment, 0 outside of the mask; neighbours differ.
    bounds, other_bounds : ndarray of int64, shape (S + 1,)
        In frames; segment ``s`` is ``bounds[s]`` up to, not including, ``bounds[s + 1]`` of one
        motion, and likewise of the other.
    """

    mask: int
    words: WordArray
    bounds: IndexArray
    other_bounds: IndexArray


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """The cells of a cost matrix that an alignment may go through, an interval a row.

    Parameters
    ----------
    lows, highs : ndarray of int64, shape (T,)
        Row ``t`` has the columns ``lows[t]`` up to, not including, ``highs[t]``; neither ever
        decreases, and neighbouring intervals overlap or touch.
    columns : int
        Of the matrix: the first row begins at 0, the last one ends here.
    """

    lows: IndexArray
    highs: IndexArray
    columns: int

    @property
    def cells(self) -> int:
        """How many cells it has."""
        return int((self.highs - self.lows).sum())

    @property
    def share(self) -> float:
        """Its share of the whole matrix."""
        return self.cells / (len(self.lows) * self.columns)


def match_segments(one: WordArray, other: WordArray, mask: int) -> SegmentMatch | None:
    """Align two motions segment by segment on as many of the selected features as agree.

    A feature can agree only if it changes equally often in both, from the same value. Such
    features are taken one after the other, first those that change at the most similar
    times, and kept as long as the sequences of words still agree.

    Parameters
    ----------
    one, other : ndarray of uint64, shape (T,)
        Feature words, each of its own length, at least one frame.
    mask : int
        The selected features.

    Returns
    -------
    SegmentMatch or None
        None where no feature that changes can agree.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, "Efficient content-based retrieval of motion capture
       data", SIGGRAPH 2005, section 7; fewer and fewer features as in section 6.2.

    Examples
    --------
    >>> one = np.array([0, 0, 1, 3, 2], np.uint64)
    >>> other = np.array([0, 1, 1, 3, 3, 2], np.uint64)
    >>> match = match_segments(one, other, 3)
    >>> match.bounds.tolist(), match.other_bounds.tolist()
    ([0, 2, 3, 4, 5], [0, 1, 3, 5, 6])
    """
    runs, other_runs = find_runs(one & np.uint64(mask)), find_runs(other & np.uint64(mask))
    kept = 0
    for bit in _candidates(runs, other_runs, mask):
        if _agree(runs[0], other_runs[0], kept | bit):
            kept |= bit
    if not kept:
        return None
    words, bounds = find_runs(one & np.uint64(kept))
    _, other_bounds = find_runs(other & np.uint64(kept))
    return SegmentMatch(kept, words, bounds, other_bounds)


def _candidates(runs: Runs, other_runs: Runs, mask: int) -> list[int]:
    """Return the bits that change equally often, those of the most similar times first."""
    (values, bounds), (other_values, other_bounds) = runs, other_runs
    changes, other_changes = (v[1:] ^ v[:-1] for v in (values, other_values))
    times, other_times = (b[1:-1] / b[-1] for b in (bounds, other_bounds))
    alike = int(~(values[0] ^ other_values[0])) & mask
    found = []
    for bit in (1 << i for i in range(64) if alike >> i & 1):
        at = times[changes & np.uint64(bit) != 0]
        other_at = other_times[other_changes & np.uint64(bit) != 0]
        if len(at) == len(other_at) > 0:
            found.append((float(np.abs(at - other_at).max()), bit))
    return [bit for _, bit in sorted(found)]


def _agree(words: WordArray, other_words: WordArray, mask: int) -> bool:
    """Tell whether two sequences of words are the same in some bits, repetitions left out."""
    both = [each & np.uint64(mask) for each in (words, other_words)]
    first, second = (each[1:][each[1:] != each[:-1]] for each in both)
    return bool(both[0][0] == both[1][0]) and np.array_equal(first, second)


def widened_region(match: SegmentMatch, margins: IndexArray) -> Region:
    """Return the cells of the matched segments and those near them.

    Parameters
    ----------
    match : SegmentMatch
    margins : ndarray of int64, shape (S,)
        How far each segment is widened on all sides, in frames from 0.

    Returns
    -------
    Region
        With margins of 0, neighbouring segments meet at their corners only.

    Raises
    ------
    ParameterError
        If there is not one margin for each segment, or one is negative.
    """
    if margins.shape != match.words.shape or (margins < 0).any():
        raise ParameterError(f"{len(match.words)} segments need a margin of 0 or more frames each")
    rows, columns = int(match.bounds[-1]), int(match.other_bounds[-1])
    lows, highs = np.full(rows, columns), np.zeros(rows, dtype=np.int64)
    tops = np.maximum(match.bounds[:-1] - margins, 0)
    bottoms = match.bounds[1:] + margins
    lefts = np.maximum(match.other_bounds[:-1] - margins, 0)
    rights = np.minimum(match.other_bounds[1:] + margins, columns)
    for top, bottom, left, right in zip(tops, bottoms, lefts, rights, strict=True):
        np.minimum(lows[top:bottom], left, out=lows[top:bottom])
        np.maximum(highs[top:bottom], right, out=highs[top:bottom])
    # A segment with a wide margin may reach past its neighbours: no path can turn back there.
    lows = np.minimum.accumulate(lows[::-1])[::-1]
    return Region(lows, np.maximum.accumulate(highs), columns)


def full_region(rows: int, columns: int) -> Region:
    """Return all cells of a matrix.

    Parameters
    ----------
    rows, columns : int
        At least 1.

    Returns
    -------
    Region
    """
    zeros = np.zeros(rows, dtype=np.int64)
    return Region(zeros, zeros + columns, columns)
