"""Of hits that lie over one another, the best: all documents at once."""

from typing import Final

import numpy as np

from mocapidx.model import BoolArray, IndexArray
from mocapidx.templates.match import Hits, merge_hits

__all__ = ["best_of_overlapping"]

MOST_ROUNDS: Final = 20
FAR: Final = np.iinfo(np.int64).max


def best_of_overlapping(
    documents: IndexArray, starts: IndexArray, ends: IndexArray, shared: float
) -> IndexArray:
    """Keep each hit that no better one covers too much.

    Parameters
    ----------
    documents, starts, ends : ndarray of int64, shape (H,)
        Best first; intervals half open, none empty.
    shared : float
        A hit that shares more than this part of the shorter interval with a better one that is
        kept, in the same document, is dropped.

    Returns
    -------
    ndarray of int64
        The hits that are kept, ascending: those that taking one hit after the other, best first,
        keeps as well (`mocapidx.templates.match.merge_hits`).
    """
    rank = np.lexsort((starts, documents))  # the rank, best first, of the hits along the time
    document, start, end = documents[rank], starts[rank], ends[rank]
    undecided = np.ones(len(rank), dtype=np.bool_)
    kept = np.zeros(len(rank), dtype=np.bool_)
    for _ in range(MOST_ROUNDS):
        if not undecided.any():
            break
        place = np.flatnonzero(undecided)
        pairs = _too_near(document[place], start[place], end[place], shared)
        left, right = place[pairs[0]], place[pairs[1]]
        rival = np.full(len(rank), FAR)  # the best of those that stand in each one's way
        np.minimum.at(rival, left, rank[right])
        np.minimum.at(rival, right, rank[left])
        wins = undecided & (rank < rival)
        kept |= wins
        undecided &= ~wins
        undecided[left[wins[right]]] = False
        undecided[right[wins[left]]] = False
    rest = np.flatnonzero(undecided)  # a long flight of stairs: one after the other
    hits = Hits(document[rest], start[rest], end[rest], rank[rest].astype(np.float64))
    last = merge_hits([hits], shared).costs.astype(np.int64)
    return np.sort(np.concatenate([rank[kept], last]))


def _too_near(
    document: IndexArray, start: IndexArray, end: IndexArray, shared: float
) -> tuple[IndexArray, IndexArray]:
    """Give the pairs of intervals, ordered by document and start, that share too much."""
    lefts, rights = [], []
    place = np.arange(len(start))
    for gap in range(1, len(start)):
        place = place[place + gap < len(start)]
        other = place + gap
        # Later ones start later still: who is past the end here meets nobody farther on.
        meets: BoolArray = (document[other] == document[place]) & (start[other] < end[place])
        place, other = place[meets], other[meets]
        if not len(place):
            break
        common = np.minimum(end[place], end[other]) - start[other]
        shorter = np.minimum(end[place] - start[place], end[other] - start[other])
        close = common > shared * shorter
        lefts.append(place[close])
        rights.append(other[close])
    nothing = np.zeros(0, dtype=np.int64)
    return np.concatenate([nothing, *lefts]), np.concatenate([nothing, *rights])
