"""Match graphs: stretches of motion that a search found, and which of them are alike.

Nodes are stretches of documents, node 0 is the query. An edge joins two stretches that were
found to be numerically similar; it keeps what the similarity costs and which frame of the one
goes with which of the other.
"""

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import IndexArray

__all__ = [
    "MatchEdge",
    "MatchGraph",
    "MatchNode",
    "ShortestPaths",
    "fitted_alignment",
    "path_edges",
    "shortest_paths",
]

SLOWEST, FASTEST = 1e-3, 1e6  # Hz


@dataclass(frozen=True, slots=True)
class MatchNode:
    """A stretch of a document.

    Parameters
    ----------
    document : str
        Name of the document in its store.
    start_frame, end_frame : int
        At the graph's rate, from 0, end exclusive.
    tier : int
        Searches that led here: 0 for the query, 1 for what it found itself, and so on.
    direct : float or None
        Average frame distance to the query in metres; None where no edge leads to it.
    distance : float
        Length of the shortest path from the query in metres, over the costs of the edges.
    """

    document: str
    start_frame: int
    end_frame: int
    tier: int
    direct: float | None
    distance: float

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.end_frame - self.start_frame


@dataclass(frozen=True, slots=True, eq=False)
class MatchEdge:
    """Two stretches that are numerically similar.

    Parameters
    ----------
    first, second : int
        Nodes, from 0, ``first < second``.
    cost : float
        Average frame distance along the time alignment, in metres.
    alignment : ndarray of int64, shape (N, 2)
        Frames of `first` and of `second` that go together, each counted from the start of its
        stretch; from the first frames of both to the last of both, in steps (1, 1), (1, 0) and
        (0, 1).
    """

    first: int
    second: int
    cost: float
    alignment: IndexArray

    def seen_from(self, node: int) -> IndexArray:
        """Give the alignment with the frames of one end first.

        Parameters
        ----------
        node : int
            One of the edge's ends.

        Returns
        -------
        ndarray of int64, shape (N, 2)
            Frames of `node`, frames of the other end.
        """
        return self.alignment if node == self.first else self.alignment[:, ::-1]


@dataclass(frozen=True, slots=True, eq=False)
class MatchGraph:
    """What a search found.

    Parameters
    ----------
    rate : float
        Frames a second that nodes and alignments are counted in, in Hz.
    epsilon : float
        Most that an alignment cost, in metres.
    nodes : tuple of MatchNode
        The query is node 0.
    edges : tuple of MatchEdge
        At most one for two nodes; ordered by their numbers.

    Raises
    ------
    ParameterError
        If there is no node, the rate is none, or an edge joins nodes that do not exist or fits
        them badly.
    """

    rate: float
    epsilon: float
    nodes: tuple[MatchNode, ...]
    edges: tuple[MatchEdge, ...]

    def __post_init__(self) -> None:
        if not self.nodes:
            raise ParameterError("a match graph has at least one node, the query")
        if not SLOWEST <= self.rate <= FASTEST:
            raise ParameterError(
                f"the rate must be from {SLOWEST:g} to {FASTEST:g} Hz, got {self.rate:g}"
            )
        for number, node in enumerate(self.nodes):
            if not 0 <= node.start_frame < node.end_frame:
                raise ParameterError(
                    f"node {number} goes from frame {node.start_frame} to {node.end_frame}"
                )
        seen = set()
        for edge in self.edges:
            if not 0 <= edge.first < edge.second < len(self.nodes):
                raise ParameterError(f"there is no edge from {edge.first} to {edge.second}")
            if (edge.first, edge.second) in seen:
                raise ParameterError(f"nodes {edge.first} and {edge.second} have two edges")
            seen.add((edge.first, edge.second))
            _check_alignment(edge, self.nodes[edge.first].frames, self.nodes[edge.second].frames)

    def incident(self, node: int) -> list[MatchEdge]:
        """List the edges of a node.

        Parameters
        ----------
        node : int
            From 0.

        Returns
        -------
        list of MatchEdge
            In the order of `edges`.
        """
        return [edge for edge in self.edges if node in (edge.first, edge.second)]


def _check_alignment(edge: MatchEdge, first: int, second: int) -> None:
    path, where = edge.alignment, f"the alignment of nodes {edge.first} and {edge.second}"
    if path.ndim != 2 or path.shape[1] != 2 or not len(path) or path.dtype != np.int64:
        raise ParameterError(f"{where} must be int64 of shape (N, 2), got {path.shape}")
    if path[0].tolist() != [0, 0] or path[-1].tolist() != [first - 1, second - 1]:
        raise ParameterError(f"{where} must lead from the first frames to the last")
    steps = np.diff(path, axis=0)
    if len(steps) and not (((steps == 0) | (steps == 1)).all() and steps.any(axis=1).all()):
        raise ParameterError(f"{where} must go in steps of at most one frame")
    if not (math.isfinite(edge.cost) and edge.cost >= 0):
        raise ParameterError(f"the edge of nodes {edge.first} and {edge.second} costs {edge.cost}")


@dataclass(frozen=True, slots=True, eq=False)
class ShortestPaths:
    """The cheapest way from one node to each other.

    Parameters
    ----------
    source : int
        Where the paths begin.
    distances : tuple of float
        A node, in metres; infinite where no path leads.
    before : tuple of int
        The node before each on its path; -1 for the source and where no path leads.
    """

    source: int
    distances: tuple[float, ...]
    before: tuple[int, ...]

    def path(self, node: int) -> list[int]:
        """List the nodes from the source to a node, both included.

        Parameters
        ----------
        node : int
            From 0.

        Returns
        -------
        list of int
            Empty where no path leads.
        """
        if math.isinf(self.distances[node]):
            return []
        path = [node]
        while path[-1] != self.source:
            path.append(self.before[path[-1]])
        return path[::-1]


def shortest_paths(graph: MatchGraph, source: int = 0) -> ShortestPaths:
    """Find the cheapest path from one node to every other (Dijkstra).

    Parameters
    ----------
    graph : MatchGraph
    source : int
        From 0; the query by default.

    Returns
    -------
    ShortestPaths
        Of equally cheap paths that whose last step starts at the smaller node.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 3.3.
    """
    neighbours: list[list[tuple[int, float]]] = [[] for _ in graph.nodes]
    for edge in graph.edges:
        neighbours[edge.first].append((edge.second, edge.cost))
        neighbours[edge.second].append((edge.first, edge.cost))
    distances, before = cheapest_ways(neighbours, source)
    return ShortestPaths(source, tuple(distances), tuple(before))


def cheapest_ways(
    neighbours: Sequence[Sequence[tuple[int, float]]], source: int
) -> tuple[list[float], list[int]]:
    """Run Dijkstra's algorithm on lists of neighbours and costs."""
    distances, before = [math.inf] * len(neighbours), [-1] * len(neighbours)
    distances[source] = 0.0
    waiting, done = [(0.0, source)], [False] * len(neighbours)
    while waiting:
        distance, node = heapq.heappop(waiting)
        if done[node]:
            continue
        done[node] = True
        for other, cost in neighbours[node]:
            total = distance + cost
            if done[other] or total > distances[other]:
                continue
            if total < distances[other] or node < before[other]:
                distances[other], before[other] = total, node
                heapq.heappush(waiting, (total, other))
    return distances, before


def path_edges(graph: MatchGraph, paths: ShortestPaths, node: int) -> list[MatchEdge]:
    """List the edges along the cheapest path to a node.

    Parameters
    ----------
    graph : MatchGraph
    paths : ShortestPaths
        Of this graph.
    node : int
        From 0.

    Returns
    -------
    list of MatchEdge
        From the source on; empty for the source and where no path leads.
    """
    by_ends = {(edge.first, edge.second): edge for edge in graph.edges}
    way = paths.path(node)
    return [by_ends[min(one, other), max(one, other)] for one, other in pairwise(way)]


def fitted_alignment(
    cells: IndexArray, first: tuple[int, int], second: tuple[int, int]
) -> IndexArray:
    """Cut a path of cells to two stretches, and lead it to their corners.

    Parameters
    ----------
    cells : ndarray of int64, shape (N, 2)
        Frames of two documents that go together, in steps of at most one frame.
    first, second : tuple of int
        Stretches of the two documents: first frame, end (exclusive).

    Returns
    -------
    ndarray of int64, shape (M, 2)
        An alignment as `MatchEdge` keeps it: frames are counted from the starts of the
        stretches. Where the path does not reach a corner, a straight line does.
    """
    starts = np.array([first[0], second[0]], dtype=np.int64)
    lasts = np.array([first[1], second[1]], dtype=np.int64) - 1 - starts
    inside = cells - starts
    inside = inside[((inside >= 0) & (inside <= lasts)).all(axis=1)]
    origin = np.zeros(2, dtype=np.int64)
    if not len(inside):
        return np.concatenate((origin[None], _line(origin, lasts)))
    ends = _line(origin, inside[0]), _line(inside[-1], lasts)
    return np.concatenate((origin[None], ends[0], inside[1:], ends[1]))


def _line(start: IndexArray, end: IndexArray) -> IndexArray:
    """Give the cells after `start` on the straight way to `end`, which is the last."""
    steps = int((end - start).max())
    shares = np.arange(1, steps + 1)[:, None]
    # Halves are rounded up in whole numbers, so that every machine draws the same line.
    cells: IndexArray = start + (2 * shares * (end - start) + steps) // (2 * max(steps, 1))
    return cells
