"""Subsequence dynamic time warping of rows in which every feature has a weight of its own.

The steps are (1, 1), (2, 1), (1, 2); (2, 1) pays twice, and every step but (1, 1) one unit more,
so that of equal matches the one nearest to the pattern's own tempo wins. Costs are whole numbers
below 2**53, so sums are exact in whatever order they are taken, and one number carries the cost
of a match together with its first frame: the lowest is the cheapest match and, of equal ones,
the shortest. The compiled kernel ``weighted.c`` finds the same.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.kernels.choice import compiled
from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray

__all__ = ["LARGEST_WEIGHT", "LONGEST_PATTERN", "Vocabulary", "match_rows", "vocabulary"]

LONGEST_PATTERN: Final = 4096  # rows
LARGEST_WEIGHT: Final = 1 << 18
"""64 features of this weight, over the longest pattern and with room for a start, stay below
2**53; the unit of the steps is nothing beside it."""

BLOCK: Final = 16_384  # frames; the rows of costs stay in the second-level cache
SPAN: Final = 1 << 16  # numbers of frames in a block with all that its matches can reach
ROWS_AT_ONCE: Final = 64
LEVEL: str | None = None
"""The instructions that the kernel uses: by default the fastest that this processor has."""


@dataclass(frozen=True, slots=True, eq=False)
class Vocabulary:
    """A sequence of feature words as different words, and where each stands.

    Parameters
    ----------
    octets : ndarray of int64, shape (B, U)
        The U different words, eight features at a time, the lowest first.
    places : ndarray of int64, shape (L,)
        The word of each frame.
    """

    octets: IndexArray
    places: IndexArray


def vocabulary(words: WordArray, features: int) -> Vocabulary:
    """Find the different words of a sequence: there are far fewer than frames.

    Parameters
    ----------
    words : ndarray of uint64, shape (L,)
    features : int
        F, at most 64.

    Returns
    -------
    Vocabulary
    """
    different, places = np.unique(words, return_inverse=True)
    shifts = np.arange(0, features, 8, dtype=np.uint64)[:, np.newaxis]
    octets = (different >> shifts & np.uint64(255)).astype(np.int64)
    return Vocabulary(octets, places.astype(np.int64))


def match_rows(
    ones: BoolArray, weights: FloatArray, words: WordArray, breaks: IndexArray | None = None
) -> tuple[FloatArray, IndexArray]:
    """Find the best match of a pattern that ends at each frame.

    The local cost of a row and a frame is the sum of the weights of the features that disagree.

    Parameters
    ----------
    ones : ndarray of bool, shape (K, F)
        The rows; K at most 4,096, F at most 64.
    weights : ndarray of float, shape (K, F)
        Whole numbers from 0 to `LARGEST_WEIGHT`.
    words : ndarray of uint64, shape (L,)
        Feature words; several documents may stand end to end.
    breaks : ndarray of int64, optional
        Frames that no match touches, ascending; two in a row keep documents apart.

    Returns
    -------
    costs : ndarray of float64, shape (L,)
        Sum of the local costs along the path, and 1 for each step but (1, 1); exact, infinite
        where no match can end.
    starts : ndarray of int64, shape (L,)
        First frame of the match, of several equally good ones the latest; -1 for none.

    Raises
    ------
    ParameterError
        If the pattern has no rows, or shape or weights are out of range.

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, section 5.2, equations (1) and (2).
    """
    _check(ones, weights)
    ones = np.ascontiguousarray(ones, dtype=np.bool_)
    weights = np.ascontiguousarray(weights, dtype=np.float64)
    costs, starts = np.empty(len(words)), np.empty(len(words), dtype=np.int64)
    overlap = 2 * (len(ones) - 1)  # no match is longer
    breaks = np.empty(0, dtype=np.int64) if breaks is None else breaks
    for begin in range(0, len(words), BLOCK):
        low, high = max(0, begin - overlap), min(len(words), begin + BLOCK)
        first, last = np.searchsorted(breaks, (low, high))
        known = vocabulary(words[low:high], ones.shape[1])
        both = _last_row(ones, weights, known, breaks[first:last] - low)[begin - low :]
        found = np.isfinite(both)
        whole = np.floor(both / SPAN, out=np.full(len(both), np.inf), where=found)
        costs[begin:high] = whole
        backward = np.subtract(both, whole * SPAN, out=np.zeros(len(both)), where=found)
        starts[begin:high] = np.where(found, low + SPAN - 1 - backward, -1)
    return costs, starts


def _check(ones: BoolArray, weights: FloatArray) -> None:
    if ones.ndim != 2 or ones.shape != weights.shape or not 1 <= ones.shape[1] <= 64:
        raise ParameterError(
            f"rows and weights must have one shape (K, F), F at most 64, got {ones.shape} and "
            f"{weights.shape}"
        )
    if not 1 <= len(ones) <= LONGEST_PATTERN:
        raise ParameterError(f"a pattern has 1 to {LONGEST_PATTERN} rows, got {len(ones)}")
    whole = (weights >= 0) & (weights <= LARGEST_WEIGHT) & (weights == np.rint(weights))
    if not whole.all():
        raise ParameterError(f"weights must be whole numbers from 0 to {LARGEST_WEIGHT}")


def _last_row(
    ones: BoolArray, weights: FloatArray, known: Vocabulary, breaks: IndexArray
) -> NDArray[np.float64]:
    """Last row of the accumulated costs, each with how far its start is from the highest number."""
    length = len(known.places)
    kernel = compiled("weighted")
    if kernel is not None:
        costs = np.empty(length)
        words = (known.octets, known.octets.shape[1])
        kernel.last_row(ones, weights, ones.shape[1], *words, known.places, breaks, costs, LEVEL)
        return costs
    # Two infinite frames before the first stand for everything that lies before the block.
    two_rows_up, one_row_up, row = np.full((3, length + 2), np.inf)
    cost, skipping = np.empty((2, length))
    for k, table in enumerate(_tables(ones, weights, known)):
        table.take(known.places, out=cost, mode="clip")
        here = row[2:]
        if k == 0:
            np.add(cost, np.arange(SPAN - 1, SPAN - 1 - length, -1), out=here)
        else:
            np.add(two_rows_up[1:-1], cost, out=skipping)
            np.minimum(one_row_up[:-2], skipping, out=here)
            np.add(here, SPAN, out=here)
            np.minimum(here, one_row_up[1:-1], out=here)
            np.add(here, cost, out=here)
        here[breaks] = np.inf
        two_rows_up, one_row_up, row = one_row_up, row, two_rows_up
    return one_row_up[2:]


def _tables(
    ones: BoolArray, weights: FloatArray, known: Vocabulary
) -> Iterator[NDArray[np.float64]]:
    """Yield for each row what each of the different words costs, with room for a start."""
    octets = len(known.octets)
    for begin in range(0, len(ones), ROWS_AT_ONCE):
        some = slice(begin, begin + ROWS_AT_ONCE)
        # A feature that is on costs its weight where it should be off, and saves it elsewhere.
        signed = np.zeros((len(ones[some]), 8 * octets))
        signed[:, : ones.shape[1]] = np.where(ones[some], -weights[some], weights[some])
        tables = np.zeros((len(signed), octets, 1))
        tables[:, 0, 0] = np.where(ones[some], weights[some], 0.0).sum(axis=1)
        for bit in range(8):  # what each value of an octet adds, half of them after the other
            more = tables + signed[:, bit::8, np.newaxis]
            tables = np.concatenate((tables, more), axis=2)
        tables *= SPAN
        for row in tables:
            costs = row[0].take(known.octets[0])
            for table, values in zip(row[1:], known.octets[1:], strict=True):
                costs += table.take(values)
            yield costs
