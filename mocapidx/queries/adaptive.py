"""Adaptive fuzzy hits: each step is a maximal stretch within the step's set of alternatives."""

from collections.abc import Sequence

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, IndexArray
from mocapidx.queries.selection import match_selection
from mocapidx.queries.source import PartSource, Source
from mocapidx.queries.steps import FuzzyQuery, FuzzySet, join_intersecting
from mocapidx.queries.stretches import find_stretches
from mocapidx.queries.walk import follow, precede

__all__ = ["adaptive_hits"]

COMMON = 64
"""If more than one in so many runs may start the rarest step, all runs are passed over."""

WALK = 3
"""A chain of the rarest step takes about so many looks at runs before it breaks off."""


def adaptive_hits(query: FuzzyQuery, source: Source) -> IndexArray:
    """Find the adaptive fuzzy hits of a sequence of sets.

    A hit is a chain: the maximal stretch within V_1 ends where one within V_2 begins, and so
    on. Neighbouring sets are disjoint, so a stretch of the one that begins where one of the
    other ends is maximal from there.

    Parameters
    ----------
    query : FuzzyQuery
        Adjacent sets that intersect are joined first.
    source : Source
        Where to look; sub-indexes that the query doesn't look at are not opened.

    Returns
    -------
    ndarray of int64, shape (H, L + 1)
        Where the stretch of each of the L steps (after joining) of each hit starts, and where
        the last one ends, in positions; ascending by start.

    Raises
    ------
    ParameterError
        If the query demands nothing.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 5.2.
    """
    query = join_intersecting(query)
    parts = source.touched(query.mask)
    if not parts:
        raise ParameterError("no feature is selected, so every motion would match")
    tables = [part.admitted(query.steps) for part in parts]
    counts = np.min([part.counts(rows) for part, rows in zip(parts, tables, strict=True)], axis=0)
    rarest = int(np.argmin(counts))
    if not counts[rarest]:
        return np.zeros((0, len(query.steps) + 1), np.int64)
    walks = _walking_is_quicker(parts, tables, int(counts[rarest]))
    if not walks or not all(_is_product(step, parts) for step in query.steps):
        return _join(query, source, rarest).T
    if _is_selection(query) and counts[rarest] * COMMON > sum(part.lists.runs for part in parts):
        values = np.concatenate([step.values for step in query.steps])
        return match_selection(parts, query.mask, values, rarest)
    return _walk(query, source, parts, tables, rarest).T


def _walking_is_quicker(
    parts: Sequence[PartSource], tables: Sequence[BoolArray], rarest: int
) -> bool:
    """Tell whether to look up what is around the runs of the rarest step, or to list all steps."""
    walking = sum(part.lookup_cost(rarest * WALK) for part in parts)
    listing = sum(
        part.stretches_cost(row) for part, rows in zip(parts, tables, strict=True) for row in rows
    )
    return walking < listing


def _is_selection(query: FuzzyQuery) -> bool:
    """Tell whether each step is one feature vector, over the same features throughout."""
    mask = query.steps[0].cubes[0][0]
    return all(len(step.cubes) == 1 and step.cubes[0][0] == mask for step in query.steps)


def _is_product(step: FuzzySet, parts: Sequence[PartSource]) -> bool:
    """Tell whether a word is in a set if each sub-index for itself admits its part of it."""
    if len(step.cubes) == 1:
        return True
    return sum(bool(part.mask & step.mask) for part in parts) < 2


def _walk(
    query: FuzzyQuery,
    source: Source,
    parts: Sequence[PartSource],
    tables: Sequence[BoolArray],
    rarest: int,
) -> IndexArray:
    """Grow the chains from the rarest step, looking runs up; gives bounds (L + 1, H)."""
    first = find_stretches(query.steps[rarest], source)
    bounds = np.stack([first.starts, first.ends])
    for step in range(rarest + 1, len(query.steps)):
        kept, ends = follow(parts, [rows[step] for rows in tables], bounds[-1])
        bounds = np.vstack([bounds[:, kept], ends])
    for step in reversed(range(rarest)):
        kept, starts = precede(parts, [rows[step] for rows in tables], bounds[0])
        bounds = np.vstack([starts, bounds[:, kept]])
    return bounds


def _join(query: FuzzyQuery, source: Source, rarest: int) -> IndexArray:
    """Join ends of stretches with starts of stretches, linear in them; gives (L + 1, H)."""
    first = find_stretches(query.steps[rarest], source)
    bounds = np.stack([first.starts, first.ends])
    for step in query.steps[rarest + 1 :]:
        following = find_stretches(step, source)
        mine, yours = _meet(bounds[-1], following.starts)
        bounds = np.vstack([bounds[:, mine], following.ends[yours]])
    for step in query.steps[:rarest][::-1]:
        before = find_stretches(step, source)
        mine, yours = _meet(bounds[0], before.ends)
        bounds = np.vstack([before.starts[yours], bounds[:, mine]])
    return bounds


def _meet(mine: IndexArray, yours: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Give the places of the numbers that two ascending arrays share; each has a number once."""
    if len(mine) > len(yours):
        swapped = _meet(yours, mine)
        return swapped[1], swapped[0]
    if not len(mine):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    places = np.searchsorted(yours, mine)
    places[places == len(yours)] = 0
    found = np.flatnonzero(yours[places] == mine)
    return found, places[found]
