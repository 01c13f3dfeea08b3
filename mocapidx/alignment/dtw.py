"""Classical dynamic time warping, of many sequences with one reference at once.

Distances are counted in whole units of 2**-24, so sums are exact and ties are ties on every
machine, in whatever order the sums are taken. The compiled kernel ``dtw.c`` gives the same.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.kernels.choice import compiled
from mocapidx.model import FloatArray, IndexArray

__all__ = ["GRID", "LONGEST_SEQUENCE", "Alignment", "align", "fixed_point"]

GRID = float(1 << 24)  # 64 features that differ by one each stay below 2**31
LONGEST_SEQUENCE = 4096  # frames; two such sequences have 17 million cells
CELLS_AT_ONCE = 1 << 23
LEVEL: str | None = None
"""The instructions that the kernel uses: by default the fastest that this processor has."""

DIAGONAL, REFERENCE, OTHER = np.arange(3, dtype=np.int8)  # the steps, as they win ties
FAR = np.int64(1) << 60

Alignment = tuple[float, IndexArray, IndexArray]
"""Cost of a warping path, its indices in the reference and its indices in the other sequence."""


def align(reference: FloatArray, others: Sequence[FloatArray]) -> Iterator[Alignment]:
    """Align sequences with a reference: steps (1, 0), (0, 1), (1, 1), Manhattan distance.

    Of several optimal paths the one is taken that, going back from the end, prefers the
    diagonal step, then the step in the reference, then the step in the other sequence.

    Parameters
    ----------
    reference : ndarray of float, shape (K, F)
        Entries between 0 and 1; at most 64 features and 4,096 frames.
    others : sequence of ndarray of float, shape (L, F)
        Each of its own length.

    Yields
    ------
    cost : float
        The total cost of the optimal path.
    in_reference, in_other : ndarray of int64, shape (M,)
        The path in frames from 0, both ends included.

    Raises
    ------
    ParameterError
        If a sequence is empty, too long or of another number of features.

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, section 5.1.
    """
    for sequence in (reference, *others):
        _check(sequence, reference.shape[-1])
    fixed_reference = fixed_point(reference)
    kernel = compiled("dtw")
    in_one = _align_batch if kernel is None else partial(_align_compiled, kernel)
    first = 0
    while first < len(others):
        last = first + _batch_size(len(reference), [len(x) for x in others[first:]])
        yield from in_one(fixed_reference, [fixed_point(x) for x in others[first:last]])
        first = last


def fixed_point(matrix: FloatArray) -> NDArray[np.int32]:
    """Entries between 0 and 1 in whole units of 2**-24."""
    return np.rint(np.asarray(matrix, dtype=np.float64) * GRID).astype(np.int32)


def _check(sequence: FloatArray, features: int) -> None:
    if sequence.ndim != 2 or sequence.shape[1] != features or not 1 <= features <= 64:
        raise ParameterError(
            f"a sequence must have the shape (T, {features}), at most 64 features, "
            f"got {sequence.shape}"
        )
    if not 1 <= len(sequence) <= LONGEST_SEQUENCE:
        raise ParameterError(
            f"a sequence to align must have 1 to {LONGEST_SEQUENCE} frames, got {len(sequence)}"
        )


def _batch_size(rows: int, lengths: Sequence[int]) -> int:
    """How many of the next sequences fit into memory together, at least one."""
    longest = np.maximum.accumulate(lengths)
    cells = rows * longest * np.arange(1, len(lengths) + 1)
    return max(1, int(np.searchsorted(cells, CELLS_AT_ONCE, side="right")))


def _align_compiled(
    kernel: ModuleType, reference: NDArray[np.int32], others: Sequence[NDArray[np.int32]]
) -> Iterator[Alignment]:
    bounds = np.cumsum([0, *map(len, others)], dtype=np.int64)
    totals, lengths = np.empty((2, len(others)), dtype=np.int64)
    paths = np.empty((2, bounds[-1] + (len(reference) - 1) * len(others)), dtype=np.int64)
    everything = np.concatenate(others)
    features = reference.shape[1]
    kernel.align(reference, everything, features, bounds, totals, lengths, *paths, LEVEL)
    end = 0
    for total, length in zip(totals.tolist(), lengths.tolist(), strict=True):
        begin, end = end, end + length
        yield total / GRID, paths[0, begin:end].copy(), paths[1, begin:end].copy()


def _align_batch(
    reference: NDArray[np.int32], others: Sequence[NDArray[np.int32]]
) -> Iterator[Alignment]:
    """Fill all cost matrices together, one diagonal k + l = s after the other."""
    everything = np.vstack((reference, *others))
    varying = (everything != everything[0]).any(axis=0)  # the rest adds nothing to any distance
    rows, lengths = len(reference), np.array([len(x) for x in others])
    columns = int(lengths.max())
    reversed_others = np.zeros((varying.sum(), len(others), columns), dtype=np.int32)
    for other, sequence in enumerate(others):  # frame l stands at columns - 1 - l
        reversed_others[:, other, columns - len(sequence) :] = sequence[::-1, varying].T
    by_feature = np.ascontiguousarray(reference[:, varying].T)[:, None, :]

    room = np.empty((len(by_feature), len(others), rows), dtype=np.int32)
    steps = np.zeros((rows + columns - 1, len(others), rows), dtype=np.int8)
    totals = np.empty(len(others), dtype=np.int64)
    # One column of FAR before row 0 saves every test for the border.
    before, last, current = np.full((3, len(others), rows + 1), FAR)
    before[:, 0] = 0  # the cell before (0, 0), reached by the diagonal step
    for s in range(rows + columns - 1):
        low, high = max(0, s - columns + 1), min(rows, s + 1)
        there = slice(columns - 1 - s + low, columns - 1 - s + high)
        gaps = room[:, :, : high - low]
        np.subtract(by_feature[:, :, low:high], reversed_others[:, :, there], out=gaps)
        cost = np.abs(gaps, out=gaps).sum(axis=0, dtype=np.int32)
        diagonal, reference_step = before[:, low:high], last[:, low:high]
        other_step = last[:, low + 1 : high + 1]
        best = np.minimum(diagonal, reference_step)
        step = (reference_step < diagonal).view(np.int8)
        steps[s, :, low:high] = np.maximum(step, (other_step < best).view(np.int8) * OTHER)
        current.fill(FAR)
        current[:, low + 1 : high + 1] = np.minimum(best, other_step) + cost
        ends = rows + lengths - 2 == s
        totals[ends] = current[ends, rows]
        before, last, current = last, current, before
        before[:, 0] = FAR
    yield from _paths(steps, totals, rows, lengths)


def _paths(
    steps: NDArray[np.int8], totals: IndexArray, rows: int, lengths: IndexArray
) -> Iterator[Alignment]:
    """Walk all paths back from their ends together."""
    k = np.full(len(lengths), rows - 1)
    column = lengths - 1
    walked = [(k, column)]
    everyone = np.arange(len(lengths))
    while (k > 0).any() or (column > 0).any():
        step = steps[k + column, everyone, k]
        moving = (k > 0) | (column > 0)
        k = k - ((step != OTHER) & moving)
        column = column - ((step != REFERENCE) & moving)
        walked.append((k, column))
    ks, columns = (np.array(side)[::-1] for side in zip(*walked, strict=True))
    for other, total in enumerate(totals):
        at_start = (ks[:, other] == 0) & (columns[:, other] == 0)
        begin = int(at_start.sum()) - 1  # finished paths wait at (0, 0)
        yield float(total) / GRID, ks[begin:, other].copy(), columns[begin:, other].copy()
