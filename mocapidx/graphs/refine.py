"""Match graphs at a higher rate: searched at one rate, aligned at that of the store.

The rate of a web decides what is found; a higher one only says more exactly which frame goes
with which. So it is enough to refine what was found: each alignment is laid out at the
higher rate, and the best path in a narrow band around it takes its place.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from mocapidx.graphs.match_graph import MatchEdge, MatchGraph, MatchNode, fitted_alignment
from mocapidx.model import FloatArray, IndexArray

__all__ = ["best_path", "refined_graph"]


def refined_graph(
    graph: MatchGraph,
    stride: int,
    frames: Mapping[str, int],
    distances: Callable[[MatchNode, MatchNode], FloatArray],
) -> MatchGraph:
    """Give a match graph at a multiple of its rate.

    Parameters
    ----------
    graph : MatchGraph
    stride : int
        New frames for one old frame.
    frames : mapping of str to int
        Of the documents, at the new rate.
    distances : callable
        Gives the distances of all frames of two stretches at the new rate, in metres.

    Returns
    -------
    MatchGraph
        Costs of edges and distances stay those of the search.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 3.2, "built at a low resolution".
    """
    if stride == 1:
        return graph
    nodes = tuple(
        replace(
            node,
            start_frame=node.start_frame * stride,
            end_frame=min(node.end_frame * stride, frames[node.document]),
        )
        for node in graph.nodes
    )
    edges = []
    for edge in graph.edges:
        first, second = nodes[edge.first], nodes[edge.second]
        ends = (0, first.frames), (0, second.frames)
        coarse = fitted_alignment(_drawn_out(edge.alignment * stride), *ends)
        path = best_path(distances(first, second), coarse, stride)
        edges.append(MatchEdge(edge.first, edge.second, edge.cost, path))
    return MatchGraph(graph.rate * stride, graph.epsilon, nodes, tuple(edges))


def _drawn_out(cells: IndexArray) -> IndexArray:
    """Fill the gaps of a path with straight lines."""
    gaps = np.diff(cells, axis=0).max(axis=1)
    start = np.repeat(cells[:-1], gaps, axis=0)
    total = np.repeat(np.diff(cells, axis=0), gaps, axis=0)
    step = np.arange(len(start)) - np.repeat(np.cumsum(gaps) - gaps, gaps)
    whole = np.repeat(gaps, gaps)[:, None]
    lines = start + (2 * step[:, None] * total + whole) // (2 * whole)
    return np.concatenate((lines, cells[-1:]))


def best_path(distances: FloatArray, around: IndexArray, pad: int) -> IndexArray:
    """Find the path of the least total distance in a band around another path.

    Parameters
    ----------
    distances : ndarray of float, shape (rows, columns)
    around : ndarray of int64, shape (N, 2)
        From the first corner to the last.
    pad : int
        The band reaches so many cells beyond it, along rows and columns.

    Returns
    -------
    ndarray of int64, shape (M, 2)
        From corner to corner; of equal ways the more even one.
    """
    rows, columns = distances.shape
    low, high = np.full(rows, columns), np.full(rows, -1)
    for shift in range(-pad, pad + 1):
        at = np.clip(around[:, 0] + shift, 0, rows - 1)
        np.minimum.at(low, at, np.maximum(around[:, 1] - pad, 0))
        np.maximum.at(high, at, np.minimum(around[:, 1] + pad, columns - 1))
    totals = np.full((rows + 1, columns + 1), np.inf)
    totals[0, 0] = 0.0
    values = np.asarray(distances, dtype=np.float64).tolist()
    for row in range(rows):
        above, here = totals[row].tolist(), [np.inf] * (columns + 1)
        for column in range(int(low[row]), int(high[row]) + 1):
            least = min(above[column], above[column + 1], here[column])
            here[column + 1] = least + values[row][column]
        totals[row + 1] = here
    path = [(rows - 1, columns - 1)]
    while path[-1] != (0, 0):
        i, j = path[-1]
        before = (totals[i, j], 0), (totals[i, j + 1], 1), (totals[i + 1, j], 2)
        choice = min(before)[1]
        path.append((i - (choice != 2), j - (choice != 1)))
    return np.array(path[::-1], dtype=np.int64)
