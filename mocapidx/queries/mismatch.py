"""Mismatch hits: the same course of segments, some of which may be other ones."""

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, IndexArray
from mocapidx.queries.selection import selected_segments
from mocapidx.queries.source import PartSource, Source
from mocapidx.queries.steps import FuzzyQuery

__all__ = ["mismatch_hits"]


def mismatch_hits(
    query: FuzzyQuery, source: Source, mismatches: int, may_fail: BoolArray | None = None
) -> IndexArray:
    """Find the stretches that go through the steps of a query but for some.

    Documents are cut where one of the features of the query changes. A hit is as many segments
    in a row, within one document, as the query has steps; all but `mismatches` of them are in
    the set of their step. With none to spare these are the exact hits.

    Parameters
    ----------
    query : FuzzyQuery
        Neighbouring sets are disjoint.
    source : Source
        Where to look.
    mismatches : int
        How many steps may disagree; fewer than there are steps.
    may_fail : ndarray of bool, shape (L,), optional
        Which of the steps may disagree; default all.

    Returns
    -------
    ndarray of int64, shape (H, L + 1)
        Where each step of each hit starts, and where the last one ends, in positions;
        ascending by start.

    Raises
    ------
    ParameterError
        If the query demands nothing, or every step might disagree.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 5.2, last paragraph.
    """
    parts, count = source.touched(query.mask), len(query.steps)
    if not parts:
        raise ParameterError("no feature is selected, so every motion would match")
    free_to_fail = np.ones(count, np.bool_) if may_fail is None else may_fail
    if not 0 <= mismatches < count:
        raise ParameterError(
            f"{mismatches} mismatches of {count} steps; at least one step must agree"
        )
    order = _by_rarity(query, parts)
    anchors = _anchors(order, free_to_fail, mismatches)
    if [part.mask for part in parts] == [query.mask]:
        return _on_runs(query, parts[0], mismatches, free_to_fail, order, anchors)
    starts, words, free = selected_segments(parts, query.mask)
    firsts = [np.flatnonzero(query.steps[step].contains(words)) - step for step in anchors]
    hits = _candidates(firsts, len(words) - count)
    # A window that begins in a document ends before the next free place, or straddles it.
    hits = hits[free[np.searchsorted(free, hits)] >= hits + count]
    failed = np.zeros(len(hits), np.int64)
    for step in order:
        wrong = ~query.steps[step].contains(words[hits + step])
        failed += wrong
        kept = failed <= mismatches if free_to_fail[step] else ~wrong
        hits, failed = hits[kept], failed[kept]
    bounds: IndexArray = starts[hits[:, np.newaxis] + np.arange(count + 1)]
    return bounds


def _on_runs(
    query: FuzzyQuery,
    part: PartSource,
    mismatches: int,
    may_fail: BoolArray,
    order: list[int],
    anchors: list[int],
) -> IndexArray:
    """Find the hits where the segments are the runs of a sub-index, which the lists know."""
    admitted, count = part.admitted(query.steps), len(query.steps)
    firsts = [part.runs(admitted[step]) - step for step in anchors]
    hits = _candidates(firsts, len(part.words) - count)
    no_word = len(part.lists.words)  # the rank of what lies between documents
    failed = np.zeros(len(hits), np.int64)
    for step in order:
        ranks = part.ranks_at(hits + step)
        wrong = ~admitted[step].take(ranks)
        failed += wrong
        kept = (failed <= mismatches if may_fail[step] else ~wrong) & (ranks != no_word)
        hits, failed = hits[kept], failed[kept]
    runs = hits[:, np.newaxis] + np.arange(count + 1)
    return part.starts.take(runs).astype(np.int64)


def _candidates(firsts: list[IndexArray], last: int) -> IndexArray:
    """Unite the segments that hits may begin with, as far as all of their steps are there."""
    hits = firsts[0] if len(firsts) == 1 else np.unique(np.concatenate(firsts))
    return hits[(hits >= 0) & (hits <= last)]


def _by_rarity(query: FuzzyQuery, parts: list[PartSource]) -> list[int]:
    """Order the steps by how many runs could be one, as the directories tell; fewest first."""
    counts = np.min([part.counts(part.admitted(query.steps)) for part in parts], axis=0)
    order: list[int] = np.argsort(counts, kind="stable").tolist()
    return order


def _anchors(order: list[int], may_fail: BoolArray, mismatches: int) -> list[int]:
    """Choose steps of which every hit has at least one."""
    certain = [step for step in order if not may_fail[step]]
    return certain[:1] or order[: mismatches + 1]
