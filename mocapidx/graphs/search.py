"""Search a match web: what is like a query, and step by step what is like that.

A single step finds the stretches that are numerically close. As close stretches are also
reliable ones, they become queries themselves, and what they find is reached through them: it
may be far from the query and still the same kind of motion.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.graphs.match_graph import (
    MatchEdge,
    MatchGraph,
    MatchNode,
    fitted_alignment,
    shortest_paths,
)
from mocapidx.graphs.search_paths import SearchPaths
from mocapidx.graphs.sequences import Sequences, find_sequences
from mocapidx.model import FloatArray, IndexArray

__all__ = ["EPSILON", "Match", "SearchRules", "Searchable", "Stretch", "search_once", "search_web"]

EPSILON = 0.18
"""Most that a match may cost, in metres, where nothing else is known."""


class Searchable(Protocol):
    """What a search asks of a web."""

    def frames(self, document: str) -> int:
        """Frames of a document."""

    def pieces(self, document: str) -> Iterable[tuple[str, int, SearchPaths]]:
        """Paths between a document and others.

        Each with the other document and the place of this one's frames in the cells: 0 or 1.
        """


@dataclass(frozen=True, slots=True)
class SearchRules:
    """How a search goes. The last three are repairs of what the paper prints.

    Parameters
    ----------
    epsilon : float
        Most that a match costs: the average distance of aligned frames, in metres.
    same : float
        Two matches that overlap by more than this share are one.
    other : float
        A match that overlaps all known ones by less than this share is a new one; what lies
        between `other` and `same` is dropped.
    most : int
        Matches after which no new ones are added.
    steps : int or None
        Tiers to search; 1: only what is close to the query; None: until nothing new comes.
    slack : float
        Share of the query's length by which an alignment may be too short at either end; it is
        continued evenly. 0, as printed, loses matches at the ends of documents and in pauses.
    union : bool
        Overlap is the share of the union of two stretches; else, as printed, of the shorter
        one, by which fragments count as the whole.
    keep : bool
        A match stays where it was found first; else, as printed, it is averaged with what
        overlaps it, and drifts.

    Raises
    ------
    ParameterError
        If a value is out of its bounds.
    """

    epsilon: float = EPSILON
    same: float = 0.8
    other: float = 0.2
    most: int = 400
    steps: int | None = None
    slack: float = 0.15
    union: bool = True
    keep: bool = True

    def __post_init__(self) -> None:
        if not (0 < self.epsilon <= 10):
            raise ParameterError(f"epsilon must be more than 0 and at most 10 m: {self.epsilon}")
        if not 0 <= self.other <= self.same <= 1:
            raise ParameterError("overlaps must be shares, that of a new match the smaller one")
        if not 0 <= self.slack <= 0.5:
            raise ParameterError(f"slack must be a share from 0 to 0.5, got {self.slack}")
        if self.most < 1 or (self.steps is not None and self.steps < 1):
            raise ParameterError("a search takes at least one match and one step")


@dataclass(frozen=True, slots=True)
class Stretch:
    """Frames of a document, end exclusive."""

    document: str
    start: int
    end: int


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """A stretch that is like a query.

    Parameters
    ----------
    stretch : Stretch
    cost : float
        Average distance of aligned frames, in metres.
    sequences : Sequences
        Where it was found.
    number : int
        Which of them.
    """

    stretch: Stretch
    cost: float
    sequences: Sequences
    number: int

    def cells(self) -> IndexArray:
        """Frames of the query's document and of the match's that go together."""
        return self.sequences.cells(self.number)


def search_once(web: Searchable, query: Stretch, rules: SearchRules) -> list[Match]:
    """Find the stretches that are numerically close to a query.

    Parameters
    ----------
    web : Searchable
    query : Stretch
    rules : SearchRules

    Returns
    -------
    list of Match
        Best first; no two overlap by more than ``rules.same``, nor does one the query.

    Raises
    ------
    ParameterError
        If the query does not lie in its document.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 3.3.
    """
    if not 0 <= query.start < query.end <= web.frames(query.document):
        raise ParameterError(f"{query.document} has no frames {query.start} to {query.end}")
    slack = int(rules.slack * (query.end - query.start) + 1e-9)
    found: dict[str, list[Sequences]] = {}
    for other, role, paths in web.pieces(query.document):
        rows = query.start, query.end - 1
        sequences = find_sequences(paths, role, *rows, slack, rules.epsilon)
        if len(sequences):
            found.setdefault(other, []).append(sequences)
    matches = [
        match
        for other, parts in sorted(found.items())
        for match in _distinct(other, web.frames(other), parts, query, rules)
    ]
    return sorted(matches, key=lambda m: (m.cost, m.stretch.document, m.stretch.start))


def _distinct(
    document: str, frames: int, parts: Sequence[Sequences], query: Stretch, rules: SearchRules
) -> list[Match]:
    """Take the cheapest of the sequences that overlap, again and again."""
    costs = np.concatenate([part.costs for part in parts])
    columns = np.concatenate([part.columns for part in parts])
    starts, ends = np.maximum(columns[:, 0], 0), np.minimum(columns[:, 1] + 1, frames)
    places = [(part, n) for part in parts for n in range(len(part))]
    left = np.lexsort((ends, starts, costs))
    left = left[starts[left] < ends[left]]
    if document == query.document:  # shifted copies of the query are no matches
        shares = _overlaps(starts[left], ends[left], query.start, query.end, rules.union)
        left = left[shares <= rules.same]
    matches = []
    while len(left):
        best = left[0]
        start, end = int(starts[best]), int(ends[best])
        stretch = Stretch(document, start, end)
        matches.append(Match(stretch, float(costs[best]), *places[best]))
        shares = _overlaps(starts[left], ends[left], start, end, rules.union)
        left = left[(shares <= rules.same) & (left != best)]
    return matches


def _overlaps(
    starts: IndexArray, ends: IndexArray, start: int, end: int, union: bool
) -> FloatArray:
    shared = np.maximum(np.minimum(ends, end) - np.maximum(starts, start), 0)
    lengths = ends - starts
    whole = lengths + (end - start) - shared if union else np.minimum(lengths, end - start)
    shares: FloatArray = shared / whole
    return shares


@dataclass(slots=True)
class _Growing:
    """A match graph that is being searched."""

    stretches: list[Stretch]
    tiers: list[int] = field(default_factory=lambda: [0])
    edges: dict[tuple[int, int], tuple[float, IndexArray]] = field(default_factory=dict)

    def greatest_overlap(self, stretch: Stretch, union: bool) -> tuple[float, int]:
        """Share and number of the node that a stretch overlaps most; 0 and -1 if none."""
        near = [
            n
            for n, node in enumerate(self.stretches)
            if node.document == stretch.document
            and node.start < stretch.end
            and stretch.start < node.end
        ]
        if not near:
            return 0.0, -1
        starts = np.array([self.stretches[n].start for n in near])
        ends = np.array([self.stretches[n].end for n in near])
        shares = _overlaps(starts, ends, stretch.start, stretch.end, union)
        return float(shares.max()), near[int(shares.argmax())]

    def link(self, one: int, other: int, match: Match) -> None:
        """Join two nodes, unless a cheaper edge does."""
        pair = min(one, other), max(one, other)
        if one != other and (pair not in self.edges or match.cost < self.edges[pair][0]):
            cells = match.cells()
            self.edges[pair] = match.cost, cells if one < other else cells[:, ::-1]

    def move(self, node: int, stretch: Stretch) -> None:
        """Average a node with what overlaps it; the query stays."""
        if node:
            old = self.stretches[node]
            start, end = (old.start + stretch.start) // 2, (old.end + stretch.end) // 2
            self.stretches[node] = Stretch(old.document, start, end)


def search_web(
    web: Searchable,
    query: Stretch,
    rules: SearchRules,
    rate: float,
    *,
    stop_when_full: bool = False,
) -> tuple[MatchGraph, bool]:
    """Search in steps: what was found is searched for in turn, until nothing new comes.

    Parameters
    ----------
    web : Searchable
    query : Stretch
    rules : SearchRules
    rate : float
        Frames a second of the web, in Hz.
    stop_when_full : bool
        Give up when there are too many matches, else only their edges are still sought.

    Returns
    -------
    graph : MatchGraph
        The query, then the matches by the lengths of their shortest paths from it.
    full : bool
        Whether there would have been more than ``rules.most`` matches.

    Raises
    ------
    ParameterError
        If the query does not lie in its document.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 3.3.
    """
    growing, full, at = _Growing([query]), False, 0
    while at < len(growing.stretches) and not (full and stop_when_full):
        tier = growing.tiers[at] + 1
        if rules.steps is not None and tier > rules.steps:
            break
        for match in search_once(web, growing.stretches[at], rules):
            share, node = growing.greatest_overlap(match.stretch, rules.union)
            if node < 0 or share < rules.other:
                if len(growing.stretches) > rules.most:
                    full = True
                    continue
                growing.stretches.append(match.stretch)
                growing.tiers.append(tier)
                growing.link(at, len(growing.stretches) - 1, match)
            elif share > rules.same:
                growing.link(at, node, match)
                if not rules.keep:
                    growing.move(node, match.stretch)
        at += 1
    return _finished(growing, rules.epsilon, rate), full


def _finished(growing: _Growing, epsilon: float, rate: float) -> MatchGraph:
    """Order the nodes by their distances from the query."""
    edges = []
    for (first, second), (cost, cells) in growing.edges.items():
        one, other = growing.stretches[first], growing.stretches[second]
        path = fitted_alignment(cells, (one.start, one.end), (other.start, other.end))
        edges.append(MatchEdge(first, second, cost, path))
    nodes = tuple(
        MatchNode(stretch.document, stretch.start, stretch.end, tier, None, 0.0)
        for stretch, tier in zip(growing.stretches, growing.tiers, strict=True)
    )
    distances = shortest_paths(MatchGraph(rate, epsilon, nodes, tuple(edges))).distances
    direct = {edge.second: edge.cost for edge in edges if edge.first == 0} | {0: 0.0}
    order = sorted(range(len(nodes)), key=lambda n: (n > 0, distances[n], nodes[n].tier, n))
    place = {old: new for new, old in enumerate(order)}
    ordered = tuple(
        replace(nodes[old], direct=direct.get(old), distance=distances[old]) for old in order
    )
    renamed = [_renamed(edge, place[edge.first], place[edge.second]) for edge in edges]
    renamed.sort(key=lambda edge: (edge.first, edge.second))
    return MatchGraph(rate, epsilon, ordered, tuple(renamed))


def _renamed(edge: MatchEdge, first: int, second: int) -> MatchEdge:
    if first < second:
        return replace(edge, first=first, second=second)
    turned = np.ascontiguousarray(edge.alignment[:, ::-1])
    return MatchEdge(second, first, edge.cost, turned)
