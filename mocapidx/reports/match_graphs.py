"""Match graphs as pictures: the query in the middle, around it what was found, step by step."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from mocapidx.graphs.match_graph import MatchGraph, shortest_paths
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
FIGURE_HEIGHT: Final = 0.62
"""Of a stick figure of two metres, where two rings are 1 apart."""


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
    before = shortest_paths(graph).before
    places = _places(before[:drawn])
    edges = [edge for edge in graph.edges if edge.second < drawn]
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
                linewidth=1.6 if on_tree else 0.5,
                alpha=0.9 if on_tree else 0.35,
                zorder=1 if on_tree else 0,
            )
        size = FIGURE_HEIGHT * _room(places)
        for number in range(drawn):
            _draw_node(axes, graph, number, places[number], poses[number], size)
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.margins(0.1)
        bar = figure.colorbar(colours, ax=axes, shrink=0.5, pad=0.01)
        bar.set_label("average distance of aligned frames, metres", color=INK)
        more = f"; {count(left_out, 'further match', 'further matches')} not drawn"
        axes.set_title(
            f"epsilon {graph.epsilon:g} m{more if left_out else ''}; thick lines: the shortest "
            "paths from the query, in the middle",
            loc="left",
            color=FAINT,
            fontsize=7.5,
        )
        return render(figure, suffix)


def _places(before: Sequence[int]) -> FloatArray:
    """Lay a tree out on rings: each branch gets as much of the circle as it has leaves."""
    children: list[list[int]] = [[] for _ in before]
    for node, parent in enumerate(before):
        if 0 <= parent < len(before):
            children[parent].append(node)
    order, depth = [0], [0] * len(before)
    for node in order:
        for child in children[node]:
            depth[child] = depth[node] + 1
            order.append(child)
    leaves = [1] * len(before)
    for node in reversed(order):
        leaves[node] = max(1, sum(leaves[child] for child in children[node]))
    start = [0.0] * len(before)
    places = np.zeros((len(before), 2))
    radius = max(1.0, leaves[0] / (2 * math.pi))
    for node in order:
        angle = 2 * math.pi * (start[node] + leaves[node] / 2) / leaves[0] + math.pi / 2
        places[node] = depth[node] * radius * np.array([math.cos(angle), math.sin(angle)])
        at = start[node]
        for child in children[node]:
            start[child] = at
            at += leaves[child]
    return places


def _room(places: FloatArray) -> float:
    """Give the least distance of two nodes, within reason."""
    if len(places) < 2:
        return 1.0
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)
    np.fill_diagonal(gaps, np.inf)
    return float(np.clip(gaps.min(), 0.5, 1.5))


def _draw_node(
    axes: "Axes",
    graph: MatchGraph,
    number: int,
    place: FloatArray,
    pose: FloatArray,
    size: float,
) -> None:
    node = graph.nodes[number]
    colour = ACCENT if number == 0 else INK
    points = _upright(pose) * size / 2.0 + place
    for joint, parent in enumerate(PARENTS):
        if parent >= 0 and np.isfinite(points[[joint, parent]]).all():
            ends = points[[joint, parent]]
            axes.plot(*ends.T, color=colour, linewidth=1.4, solid_capstyle="round", zorder=3)
    axes.plot(*place, "o", color="white", markersize=size * 26, zorder=2, alpha=0.75)
    name = shown(node.document.rpartition("/")[2].rpartition(".")[0] or node.document, NAME_LENGTH)
    label = f"{name}\n{node.start_frame / graph.rate:.1f} s"
    if number:
        label += f", {node.distance:.2f} m"
    below = place - np.array([0.0, size * 0.62])
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
