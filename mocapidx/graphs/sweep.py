"""How many matches there are for each epsilon, and where to stop.

As epsilon grows, a search finds first the nearest variants of a motion, then all of its kind.
Then one stray match leads to another kind, that to a third, and the number jumps.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from mocapidx.graphs.match_graph import MatchGraph
from mocapidx.graphs.search import Searchable, SearchRules, Stretch, search_web

__all__ = ["SWEPT", "SweepStep", "chosen_step", "sweep_web"]

SWEPT: Final = tuple(round(0.04 + 0.01 * step, 2) for step in range(19))
"""Epsilons that are tried, in metres: 0.04 to 0.22."""

JUMP: Final = 4.0
"""A number of matches jumps where it grows by more than this factor ..."""

FEW: Final = 5
"""... after so many were added to it: from 1 to 9 is no jump yet."""


HALVINGS: Final = 4
"""Of the step from no match to too many."""


@dataclass(frozen=True, slots=True, eq=False)
class SweepStep:
    """What a search finds for one epsilon.

    Parameters
    ----------
    epsilon : float
        In metres.
    graph : MatchGraph
    full : bool
        Whether there would have been more matches than the most allowed.
    """

    epsilon: float
    graph: MatchGraph
    full: bool

    @property
    def matches(self) -> int:
        """Number of matches, without the query."""
        return len(self.graph.nodes) - 1


def sweep_web(
    web: Searchable,
    query: Stretch,
    rules: SearchRules,
    rate: float,
    epsilons: tuple[float, ...] = SWEPT,
) -> Iterator[SweepStep]:
    """Search with one epsilon after another, until a search is full.

    Parameters
    ----------
    web : Searchable
    query : Stretch
    rules : SearchRules
        All but its epsilon.
    rate : float
        Frames a second of the web, in Hz.
    epsilons : tuple of float
        Ascending, in metres.

    Yields
    ------
    SweepStep
    """
    quiet, known = 0.0, False
    for epsilon in epsilons:
        step = _step(web, query, rules, rate, epsilon)
        if step.full and not known:
            yield from _between(web, query, rules, rate, (quiet, epsilon))
        yield step
        if step.full:
            return
        quiet, known = epsilon, step.matches > 0


def _between(
    web: Searchable, query: Stretch, rules: SearchRules, rate: float, ends: tuple[float, float]
) -> Iterator[SweepStep]:
    """Look for a few matches where one step leads from none to too many."""
    quiet, loud = ends
    for _ in range(HALVINGS):
        middle = round((quiet + loud) / 2, 6)
        step = _step(web, query, rules, rate, middle)
        if step.full:
            loud = middle
        else:
            yield step
            quiet = middle


def _step(
    web: Searchable, query: Stretch, rules: SearchRules, rate: float, epsilon: float
) -> SweepStep:
    rules = replace(rules, epsilon=epsilon)
    return SweepStep(epsilon, *search_web(web, query, rules, rate, stop_when_full=True))


def chosen_step(steps: Sequence[SweepStep]) -> SweepStep:
    """Choose the largest epsilon before the number of matches jumps.

    Parameters
    ----------
    steps : sequence of SweepStep
        At least one, by ascending epsilons.

    Returns
    -------
    SweepStep
        The last one before the first jump, or before the first that is full; the last of all
        where there is none.
    """
    for step, following in pairwise(steps):
        jumps = following.matches > JUMP * (step.matches + FEW)
        if step.matches and (jumps or following.full):
            return step
    return steps[-1]
