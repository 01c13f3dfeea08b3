"""Maximal stretches of frames in which the feature word stays within a fuzzy set.

Each sub-index gives the stretches in which its part of the condition holds; those of several
are intersected. Positions are the ones of `mocapidx.index.build`, so no stretch leaves its
document.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocapidx.model import BoolArray, IndexArray, WordArray
from mocapidx.queries.source import PartSource, Source, expand_ranges
from mocapidx.queries.steps import FuzzySet

__all__ = [
    "Stretches",
    "find_stretches",
    "full_words",
    "intersect_stretches",
    "join_runs",
    "runs_at",
    "split_stretches",
    "spread_bits",
    "unite_stretches",
]


@dataclass(frozen=True, slots=True)
class Stretches:
    """Half-open intervals, ascending; no two touch.

    Parameters
    ----------
    starts, ends : ndarray of int64, shape (N,)
        In positions, or in run numbers where a function says so.
    """

    starts: IndexArray
    ends: IndexArray


def join_runs(runs: IndexArray) -> Stretches:
    """Join neighbouring run numbers.

    Parameters
    ----------
    runs : ndarray of int64, shape (N,)
        Ascending.

    Returns
    -------
    Stretches
        In run numbers.
    """
    breaks = np.flatnonzero(np.diff(runs) != 1)
    starts = runs[np.concatenate(([0], breaks + 1))] if len(runs) else runs
    ends = runs[np.concatenate((breaks, [len(runs) - 1]))] + 1 if len(runs) else runs
    return Stretches(starts, ends)


def intersect_stretches(one: Stretches, other: Stretches) -> Stretches:
    """Find where two sets of stretches hold at once.

    Parameters
    ----------
    one, other : Stretches
        In any order.

    Returns
    -------
    Stretches
        Maximal again, since in each of the two no stretches touch.
    """
    first = np.searchsorted(other.ends, one.starts, "right")
    last = np.searchsorted(other.starts, one.ends, "left")
    mine, yours = expand_ranges(first, last)
    return Stretches(
        np.maximum(one.starts[mine], other.starts[yours]),
        np.minimum(one.ends[mine], other.ends[yours]),
    )


def unite_stretches(sets: Sequence[Stretches]) -> Stretches:
    """Find where any of some sets of stretches holds.

    Parameters
    ----------
    sets : sequence of Stretches
        At least one.

    Returns
    -------
    Stretches
        Maximal: those that overlap or touch are one.
    """
    if len(sets) == 1:
        return sets[0]
    starts = np.concatenate([stretches.starts for stretches in sets])
    order = np.argsort(starts, kind="stable")
    starts = starts[order]
    ends = np.concatenate([stretches.ends for stretches in sets])[order]
    ends = np.maximum.accumulate(ends)
    apart = np.flatnonzero(starts[1:] > ends[:-1])
    if not len(starts):
        return Stretches(starts, ends)
    return Stretches(starts[np.append(0, apart + 1)], ends[np.append(apart, len(ends) - 1)])


def find_stretches(step: FuzzySet, source: Source) -> Stretches:
    """Find the maximal stretches within a fuzzy set.

    Parameters
    ----------
    step : FuzzySet
        Any; only the sub-indexes that its cubes look at are opened.
    source : Source
        Where to look.

    Returns
    -------
    Stretches
        In positions.
    """
    by_parts: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for mask, value in step.cubes:
        key = tuple(i for i, part in enumerate(source.parts) if part.mask & mask)
        by_parts.setdefault(key, []).append((mask, value))
    return unite_stretches(
        [
            _stretches_of_alike(FuzzySet(tuple(cubes)), [source.parts[i] for i in key], source)
            for key, cubes in by_parts.items()
        ]
    )


def _stretches_of_alike(step: FuzzySet, parts: list[PartSource], source: Source) -> Stretches:
    """Find the stretches of a set whose cubes all look at the same sub-indexes."""
    rows = [part.admitted([step])[0] for part in parts]
    counts = [part.counts(row) for part, row in zip(parts, rows, strict=True)]
    stretches = Stretches(source.first, source.first + source.lengths)
    for i, place in enumerate(np.argsort(counts, kind="stable").tolist()):
        part, row = parts[place], rows[place]
        if i and part.lookup_cost(len(stretches.starts)) < part.stretches_cost(row):
            stretches = _narrow(stretches, part, row)
        else:
            held = _stretches_of_part(part, row)
            stretches = intersect_stretches(stretches, held) if i else held
    if len(parts) > 1 and len(step.cubes) > 1:
        # The parts alone let through what agrees with one cube here and another one there.
        cuts, ends = split_stretches(stretches, parts)
        inside = step.contains(full_words(parts, cuts))
        stretches = _join_touching(cuts[inside], ends[inside])
    return stretches


def _stretches_of_part(part: PartSource, admitted: BoolArray) -> Stretches:
    """Find the maximal stretches of admitted words in one sub-index, in positions."""
    runs = join_runs(part.runs(admitted))
    return Stretches(
        part.starts.take(runs.starts).astype(np.int64),
        part.starts.take(runs.ends).astype(np.int64),
    )


def _narrow(stretches: Stretches, part: PartSource, admitted: BoolArray) -> Stretches:
    """Keep of some stretches where a sub-index has admitted words; looks at no run elsewhere."""
    first = runs_at(part, stretches.starts)
    last = part.starts.search(stretches.ends)
    owners, runs = expand_ranges(first, last)
    inside = np.flatnonzero(admitted.take(part.ranks_at(runs)))
    owners, runs = owners[inside], runs[inside]
    return _join_touching(
        np.maximum(part.starts.take(runs), stretches.starts[owners]),
        np.minimum(part.starts.take(runs + 1), stretches.ends[owners]),
    )


def _join_touching(starts: IndexArray, ends: IndexArray) -> Stretches:
    """Join ascending intervals that do not overlap where one ends and the next one begins."""
    apart = np.flatnonzero(starts[1:] != ends[:-1])
    if not len(starts):
        return Stretches(starts, ends)
    return Stretches(starts[np.append(0, apart + 1)], ends[np.append(apart, len(ends) - 1)])


def split_stretches(
    stretches: Stretches, parts: Sequence[PartSource]
) -> tuple[IndexArray, IndexArray]:
    """Cut stretches into the segments of the combined segmentation of some sub-indexes.

    Parameters
    ----------
    stretches : Stretches
        In positions.
    parts : sequence of PartSource
        Their segments' borders together are the borders of the combined segmentation.

    Returns
    -------
    cuts, ends : ndarray of int64, shape (N,)
        Half-open pieces in positions, ascending.
    """
    cuts = [stretches.starts]
    for part in parts:
        first = part.starts.search(stretches.starts, before=False)
        last = part.starts.search(stretches.ends)
        cuts.append(part.starts.take(expand_ranges(first, last)[1]).astype(np.int64))
    starts = np.sort(np.concatenate(cuts))
    starts = starts[np.flatnonzero(np.diff(starts, prepend=-1))]
    owners = np.searchsorted(stretches.starts, starts, "right") - 1
    ends = stretches.ends[owners]
    same = np.flatnonzero(owners[1:] == owners[:-1])
    ends[same] = starts[same + 1]
    return starts, ends


def runs_at(part: PartSource, positions: IndexArray) -> IndexArray:
    """Give the run numbers of a sub-index that positions are in, shape (N,)."""
    return part.starts.search(positions, before=False) - 1


def full_words(parts: Sequence[PartSource], positions: IndexArray) -> WordArray:
    """Give the feature words at positions of frames, as far as some sub-indexes know them.

    Parameters
    ----------
    parts : sequence of PartSource
        Bits of features of other sub-indexes are 0.
    positions : ndarray of int64, shape (N,)
        Not free ones.

    Returns
    -------
    ndarray of uint64, shape (N,)
        Whole feature words.
    """
    words = np.zeros(len(positions), np.uint64)
    for part in parts:
        words |= spread_bits(part.words.take(runs_at(part, positions)), part.mask)
    return words


def spread_bits(part_words: NDArray[np.uint32], mask: int) -> WordArray:
    """Put the bits of part words back to their places in feature words.

    Parameters
    ----------
    part_words : ndarray of uint32, shape (N,)
        The features of a sub-index, squeezed together.
    mask : int
        The features of the sub-index.

    Returns
    -------
    ndarray of uint64, shape (N,)
        The other features are 0.
    """
    squeezed = part_words.astype(np.uint64)
    words = np.zeros(len(squeezed), np.uint64)
    while mask:  # one turn for each block of neighbouring features
        low = (mask & -mask).bit_length() - 1
        size = (~(mask >> low) & ((mask >> low) + 1)).bit_length() - 1
        block = np.uint64((1 << size) - 1)
        words |= (squeezed & block) << np.uint64(low)
        squeezed >>= np.uint64(size)
        mask &= ~(((1 << size) - 1) << low)
    return words
