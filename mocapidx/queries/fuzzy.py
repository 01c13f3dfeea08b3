"""Fuzzy hits: each step is one segment with a word from the step's set of alternatives."""

from collections.abc import Sequence

import numpy as np

from mocapidx.model import BoolArray, IndexArray
from mocapidx.queries.source import PartSource, Source
from mocapidx.queries.steps import FuzzyQuery, join_intersecting
from mocapidx.queries.stretches import find_stretches, full_words, runs_at, split_stretches

__all__ = ["fuzzy_hits"]


def fuzzy_hits(query: FuzzyQuery, source: Source) -> IndexArray:
    """Find the fuzzy hits of a sequence of sets.

    The segments are those of the sub-indexes that the query looks at: all their features cut,
    selected or not, and each step is exactly one segment.

    Parameters
    ----------
    query : FuzzyQuery
        Adjacent sets that intersect are joined first.
    source : Source
        Where to look; sub-indexes that the query doesn't look at are not opened.

    Returns
    -------
    ndarray of int64, shape (H, L + 1)
        Where each of the L steps (after joining) of each hit starts, and where the last one
        ends, in positions; ascending by start.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 5.2, equations 9 to 11.
    """
    query = join_intersecting(query)
    parts = source.touched(query.mask)
    if len(parts) == 1:
        return _shifted_intersection(query, parts[0])
    return _walk_from_rarest(query, parts, source)


def _shifted_intersection(query: FuzzyQuery, part: PartSource) -> IndexArray:
    """Intersect the shifted lists of the steps, the shortest first (equation 11)."""
    admitted = part.admitted(query.steps)
    counts = part.counts(admitted)
    order = np.argsort(counts, kind="stable").tolist()
    if not counts[order[0]]:
        return np.zeros((0, len(query.steps) + 1), np.int64)
    others = np.any(admitted[order[1:]], axis=0)
    if part.lookup_cost(int(counts[order[0]])) < part.listing_cost(others):
        hits = _by_table(part, admitted, order)
    else:
        hits = _by_lists(part, admitted, order)
    runs = hits[:, np.newaxis] + np.arange(len(query.steps) + 1)
    return part.starts.take(runs).astype(np.int64)


def _by_lists(part: PartSource, admitted: BoolArray, order: list[int]) -> IndexArray:
    """Give the first runs of the hits; the accumulator, the smaller set, is what is shifted."""
    place = order[0]
    hits = part.bitmap(admitted[place])
    for step in order[1:]:
        hits = hits.shift(step - place)
        hits &= part.bitmap(admitted[step])
        place = step
        if not hits:
            break
    return np.asarray(hits.to_array(), dtype=np.int64) - place


def _by_table(part: PartSource, admitted: BoolArray, order: list[int]) -> IndexArray:
    """Give the first runs of the hits: unite the rarest step, look the others up."""
    hits = part.runs(admitted[order[0]]) - order[0]
    hits = hits[hits >= 0]
    last = len(part.words) - 1  # a free number, which has no word
    for step in order[1:]:
        hits = hits[admitted[step].take(part.ranks_at(np.minimum(hits + step, last)))]
        if not len(hits):
            break
    return hits


def _walk_from_rarest(query: FuzzyQuery, parts: Sequence[PartSource], source: Source) -> IndexArray:
    """Find the segments of the rarest step, then look at the segments after and before them."""
    totals = np.min([part.counts(part.admitted(query.steps)) for part in parts], axis=0)
    rarest = int(np.argmin(totals))
    starts, ends = split_stretches(find_stretches(query.steps[rarest], source), parts)
    bounds = [starts, ends]
    for step in query.steps[rarest + 1 :]:
        at = bounds[-1]
        kept = np.flatnonzero(at < _document_ends(source, at))
        kept = kept[step.contains(full_words(parts, at[kept]))]
        following = [part.starts.take(runs_at(part, at[kept]) + 1) for part in parts]
        bounds = [column[kept] for column in bounds]
        bounds.append(np.min(following, axis=0).astype(np.int64))
    for step in query.steps[:rarest][::-1]:
        at = bounds[0]
        kept = np.flatnonzero(at > source.first[source.document_at(at)])
        kept = kept[step.contains(full_words(parts, at[kept] - 1))]
        before = [part.starts.take(runs_at(part, at[kept] - 1)) for part in parts]
        bounds = [np.max(before, axis=0).astype(np.int64)] + [column[kept] for column in bounds]
    return np.stack(bounds, axis=1)


def _document_ends(source: Source, positions: IndexArray) -> IndexArray:
    documents = source.document_at(positions)
    return source.first[documents] + source.lengths[documents]
