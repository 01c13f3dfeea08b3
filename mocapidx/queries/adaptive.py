"""Adaptive fuzzy hits: each step is a maximal stretch within the step's set of alternatives."""

from collections.abc import Callable

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import IndexArray
from mocapidx.queries.source import PartSource, Source
from mocapidx.queries.steps import FuzzyQuery, join_intersecting
from mocapidx.queries.stretches import Stretches, find_stretches, join_runs

__all__ = ["adaptive_hits"]


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
    if len(parts) > 1:
        return _chain(lambda step: find_stretches(query.steps[step], source), len(query.steps), 0)
    return _hits_of_part(query, parts[0])


def _hits_of_part(query: FuzzyQuery, part: PartSource) -> IndexArray:
    """Chain the stretches of one sub-index in run numbers, the rarest step first."""
    admitted = part.admitted(query.steps)
    rarest = int(np.argmin(part.counts(admitted)))
    runs = _chain(lambda step: join_runs(part.runs(admitted[step])), len(query.steps), rarest)
    return part.starts[runs].astype(np.int64)


def _chain(stretches_of: Callable[[int], Stretches], steps: int, rarest: int) -> IndexArray:
    """Join ends of stretches with starts of stretches, outwards from one step.

    Parameters
    ----------
    stretches_of : callable
        Gives the maximal stretches of a step, 0 to `steps` - 1; those of neighbours are disjoint.
    steps : int
        L.
    rarest : int
        The step to begin with.

    Returns
    -------
    ndarray of int64, shape (H, L + 1)
        Bounds of the chains, ascending, in the numbers of the stretches.
    """
    first = stretches_of(rarest)
    bounds = np.stack([first.starts, first.ends])
    for step in range(rarest + 1, steps):
        if not bounds.shape[1]:
            break
        following = stretches_of(step)
        mine, yours = _meet(bounds[-1], following.starts)
        bounds = np.vstack([bounds[:, mine], following.ends[yours]])
    for step in reversed(range(rarest)):
        if not bounds.shape[1]:
            break
        before = stretches_of(step)
        mine, yours = _meet(bounds[0], before.ends)
        bounds = np.vstack([before.starts[yours], bounds[:, mine]])
    return bounds.T if bounds.shape[1] else np.zeros((0, steps + 1), np.int64)


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
