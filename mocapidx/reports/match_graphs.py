"""Match graphs as pictures: a pose for the query and for each match, the nearest first."""

import heapq
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from mocapidx.graphs.match_graph import MatchEdge, MatchGraph
from mocapidx.model import FloatArray
from mocapidx.printable import count, shown
from mocapidx.reports.style import ACCENT, FAINT, INK, drawing, new_figure, render
from mocapidx.skeleton.joints import INDEX, PARENTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["MOST_DRAWN", "match_graph_picture"]

MOST_DRAWN: Final = 60
"""Nodes of a picture; more would be too small to see."""

INCHES: Final = 9.0
NAME_LENGTH: Final = 22
FIGURE_HEIGHT: Final = 0.6
"""Of a stick figure of two metres, where neighbours are 1 apart."""


def match_graph_picture(
    graph: MatchGraph, poses: Sequence[FloatArray], *, suffix: str = "png"
) -> bytes:
    """Draw a match graph with a pose on each node.

    Parameters
    ----------
    graph : MatchGraph
        The nearest `MOST_DRAWN` nodes are drawn.
    poses : sequence of ndarray of float, shape (24, 3)
        Of each of them, in metres.
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, figure 10.
    """
    drawn = min(len(graph.nodes), MOST_DRAWN)
    edges = [edge for edge in graph.edges if edge.second < drawn]
    before = _spanning_tree(edges, drawn)
    places = _places(drawn)
    left_out = len(graph.nodes) - drawn
    with drawing():
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        figure = new_figure(INCHES, INCHES, f"matches of {shown(graph.nodes[0].document, 60)}")
        axes = figure.add_subplot()
        costs = Normalize(0.0, max(graph.epsilon, 1e-6))
        colours = ScalarMappable(costs, "viridis")
        for edge in edges:
            ends = places[[edge.first, edge.second]]
            on_tree = before[edge.second] == edge.first or before[edge.first] == edge.second
            axes.plot(
                *ends.T,
                color=colours.to_rgba(np.array([edge.cost]))[0],
                linewidth=2.2 if on_tree else 0.5,
                alpha=0.8 if on_tree else 0.12,
                zorder=1 if on_tree else 0,
            )
        for number in range(drawn):
            _draw_node(axes, graph, number, places[number], poses[number])
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.margins(0.1)
        bar = figure.colorbar(colours, ax=axes, shrink=0.5, pad=0.01)
        bar.set_label("average distance of aligned frames, metres", color=INK)
        more = f"; {count(left_out, 'further match', 'further matches')} not drawn"
        axes.set_title(
            f"epsilon {graph.epsilon:g} m{more if left_out else ''}; thick lines: the tree of "
            "the cheapest edges; in the order of their distances from the query, upper left",
            loc="left",
            color=FAINT,
            fontsize=7.5,
        )
        return render(figure, suffix)


def _spanning_tree(edges: Sequence[MatchEdge], nodes: int) -> list[int]:
    """Join the nodes to the query by the edges that cost the least; -1 has no node before it."""
    neighbours: list[list[tuple[float, int, int]]] = [[] for _ in range(nodes)]
    for edge in edges:
        neighbours[edge.first].append((edge.cost, edge.first, edge.second))
        neighbours[edge.second].append((edge.cost, edge.second, edge.first))
    before, joined = [-1] * nodes, {0}
    waiting = list(neighbours[0])
    heapq.heapify(waiting)
    while waiting:
        _, parent, node = heapq.heappop(waiting)
        if node not in joined:
            joined.add(node)
            before[node] = parent
            for entry in neighbours[node]:
                heapq.heappush(waiting, entry)
    return before


def _places(nodes: int) -> FloatArray:
    """Lay the nodes out row by row, the query at the upper left, the nearest after it."""
    columns = math.ceil(math.sqrt(nodes))
    numbers = np.arange(nodes)
    return np.column_stack((numbers % columns, -(numbers // columns))).astype(np.float64)


def _draw_node(
    axes: "Axes",
    graph: MatchGraph,
    number: int,
    place: FloatArray,
    pose: FloatArray,
) -> None:
    node = graph.nodes[number]
    colour = ACCENT if number == 0 else INK
    points = _upright(pose) * FIGURE_HEIGHT / 2.0 + place
    for joint, parent in enumerate(PARENTS):
        if parent >= 0 and np.isfinite(points[[joint, parent]]).all():
            ends = points[[joint, parent]]
            axes.plot(*ends.T, color=colour, linewidth=1.4, solid_capstyle="round", zorder=3)
    axes.plot(*place, "o", color="white", markersize=15, zorder=2, alpha=0.6)
    name = shown(node.document.rpartition("/")[2].rpartition(".")[0] or node.document, NAME_LENGTH)
    label = f"{name}\n{node.start_frame / graph.rate:.1f} s"
    if number:
        label += f", {node.distance:.2f} m"
    below = place - np.array([0.0, 0.33])
    axes.text(
        below[0], below[1], label, ha="center", va="top", fontsize=4.5, color=colour, zorder=4
    )


def _upright(pose: FloatArray) -> FloatArray:
    """Look at a pose from the front, somewhat from the side; its middle is the origin."""
    across = pose[INDEX["lhip"]] - pose[INDEX["rhip"]]
    angle = math.atan2(across[2], across[0]) if np.isfinite(across).all() else 0.0
    turn = angle - math.radians(40)
    flat = pose[:, 0] * math.cos(turn) + pose[:, 2] * math.sin(turn)
    points = np.column_stack((flat, pose[:, 1]))
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    return np.asarray(points - (low + high) / 2)
