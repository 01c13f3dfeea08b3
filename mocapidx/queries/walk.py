"""From a border of a stretch to the next: the sub-indexes are looked up where they are needed.

A chain of stretches grows from its rarest step run by run, at a cost that depends on the number
of candidates and hardly on the size of the store.
"""

from collections.abc import Sequence

import numpy as np

from mocapidx.model import BoolArray, IndexArray
from mocapidx.queries.source import PartSource
from mocapidx.queries.stretches import runs_at

__all__ = ["follow", "precede"]

TURN_COST = 4000
"""A turn of the walk takes about as long as passing over so many runs, ..."""
MOVE_COST = 10
"""... and moving one of the candidates a run on as long as passing over so many."""


def follow(
    parts: Sequence[PartSource], admitted: Sequence[BoolArray], positions: IndexArray
) -> tuple[IndexArray, IndexArray]:
    """Find where the stretches end that begin at positions.

    Parameters
    ----------
    parts : sequence of PartSource
        Sub-indexes; a frame is inside where all of them admit it.
    admitted : sequence of ndarray of bool, each of shape (W + 1,)
        The admitted words of each.
    positions : ndarray of int64, shape (N,)
        Where something else ended; may be free.

    Returns
    -------
    kept : ndarray of int64, shape (M,)
        Places of the positions that are inside.
    ends : ndarray of int64, shape (M,)
        Where the admitted stretch from there ends.
    """
    kept, runs = _inside(parts, admitted, positions)
    ends = [
        part.starts.take(_leave(part, row, at, 1))
        for part, row, at in zip(parts, admitted, runs, strict=True)
    ]
    return kept, np.min(ends, axis=0).astype(np.int64)


def precede(
    parts: Sequence[PartSource], admitted: Sequence[BoolArray], positions: IndexArray
) -> tuple[IndexArray, IndexArray]:
    """Find where the stretches start that end at positions.

    Parameters
    ----------
    parts, admitted
        As for `follow`.
    positions : ndarray of int64, shape (N,)
        Where something else starts.

    Returns
    -------
    kept : ndarray of int64, shape (M,)
        Places of the positions before which frames are inside.
    starts : ndarray of int64, shape (M,)
        Where the admitted stretch that ends there starts.
    """
    # Before the first position of all lies no. -1, which wraps to the last run: a free one.
    kept, runs = _inside(parts, admitted, positions - 1)
    starts = [
        part.starts.take(_leave(part, row, at, -1) + 1)
        for part, row, at in zip(parts, admitted, runs, strict=True)
    ]
    return kept, np.max(starts, axis=0).astype(np.int64)


def _inside(
    parts: Sequence[PartSource], admitted: Sequence[BoolArray], positions: IndexArray
) -> tuple[IndexArray, list[IndexArray]]:
    """Give the places of the positions that all sub-indexes admit, and their runs in each."""
    kept = np.arange(len(positions))
    runs: list[IndexArray] = []
    for part, row in zip(parts, admitted, strict=True):
        at = runs_at(part, positions[kept])
        inside = np.flatnonzero(row.take(part.ranks_at(at)))
        kept, runs = kept[inside], [*(known[inside] for known in runs), at[inside]]
    return kept, runs


def _leave(part: PartSource, admitted: BoolArray, runs: IndexArray, turn: int) -> IndexArray:
    """Find the first run after (or before, by `turn`) each admitted run that isn't admitted."""
    at = runs + turn
    moving = np.arange(len(at))
    budget = len(part.words)  # beyond it, passing over all runs would have been quicker
    while budget > 0:
        budget -= TURN_COST + MOVE_COST * len(moving)
        moving = moving[admitted.take(part.ranks_at(at[moving]))]  # -1 is the last, a free one
        if not len(moving):
            return at
        at[moving] += turn
    outside = np.flatnonzero(~admitted.take(part.ranks))
    if turn > 0:
        at[moving] = outside[np.searchsorted(outside, at[moving])]
    else:  # nothing before the first run is the same as no. -1
        at[moving] = np.append(outside, -1)[np.searchsorted(outside, at[moving], "right") - 1]
    return at
