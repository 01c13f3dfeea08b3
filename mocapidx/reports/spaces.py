"""Spaces of motion as pictures: which parameters can be had, and what new motion looks like."""

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np

from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.reports.style import ACCENT, FAINT, INK, drawing, new_figure, render
from mocapidx.skeleton.joints import INDEX, PARENTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["poses_picture", "region_picture"]

EXAMPLE: Final = "#cc3311"
SAMPLE: Final = "#9a9a9a"
LEFT, RIGHT, MIDDLE = "#0072b2", "#cc3311", INK
PANEL: Final = 3.0  # inches
MOST_PANELS: Final = 6


def region_picture(
    names: Sequence[str],
    units: Sequence[str],
    examples: FloatArray,
    samples: FloatArray,
    *,
    targets: FloatArray | None = None,
    reached: FloatArray | None = None,
    pose: FloatArray | None = None,
    title: str = "",
    suffix: str = "png",
) -> bytes:
    """Draw the accessible region of a space, seen along each of its axes.

    Parameters
    ----------
    names, units : sequence of str, length D
        Of the parameters.
    examples : ndarray of float, shape (E, D)
        Parameters of the examples: squares.
    samples : ndarray of float, shape (S, D)
        Of the samples: dots.
    targets, reached : ndarray of float, shape (N, D), optional
        What was asked, a cross, and what comes nearest to it, a ring.
    pose : ndarray of float, shape (24, 3), optional
        Where three parameters are a place: a body to set it in relation to.
    title : str
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, figure 14.
    """
    dimensions = len(names)
    pairs = _views(dimensions, pose is not None)
    with drawing():
        columns = min(len(pairs), 3)
        rows = -(-len(pairs) // columns)
        figure = new_figure(PANEL * columns + 0.6, PANEL * rows + 0.9, title or "accessible region")
        for number, (across, up) in enumerate(pairs, start=1):
            axes = figure.add_subplot(rows, columns, number)
            if pose is not None:
                _draw_pose(axes, pose[:, across], pose[:, up], faint=True)
            spread = np.zeros(len(samples))
            if dimensions == 1:  # one number: side by side, so that the dots don't hide each other
                spread = np.linspace(-0.4, 0.4, len(samples))
            for points, style in (
                (samples, {"color": SAMPLE, "marker": ".", "s": 5.0}),
                (examples, {"color": EXAMPLE, "marker": "s", "s": 16.0}),
            ):
                y = points[:, up] if dimensions > 1 else spread[: len(points)]
                axes.scatter(points[:, across], y, linewidths=0, **style)  # type: ignore[arg-type]
            if targets is not None and reached is not None:
                _draw_targets(axes, targets, reached, across, up if dimensions > 1 else None)
            axes.set_xlabel(_label(names[across], units[across]))
            if dimensions > 1:
                axes.set_ylabel(_label(names[up], units[up]))
                if units[across] == units[up]:
                    axes.set_aspect("equal", adjustable="datalim")
            else:
                axes.set_yticks([])
        _legend(figure, targets is not None)
        return render(figure, suffix)


def _views(dimensions: int, is_place: bool) -> list[tuple[int, int]]:
    """Return pairs of parameters to be drawn against each other."""
    if dimensions == 1:
        return [(0, 0)]
    if is_place:
        return [(0, 1), (2, 1), (0, 2)]  # from the front, from the side, from above
    return list(combinations(range(dimensions), 2))[:MOST_PANELS]


def _label(name: str, unit: str) -> str:
    return f"{shown(name, 40)}, {unit}" if unit else shown(name, 40)


def _draw_targets(
    axes: "Axes", targets: FloatArray, reached: FloatArray, across: int, up: int | None
) -> None:
    for target, found in zip(targets, reached, strict=True):
        x = [target[across], found[across]]
        y = [0.0, 0.0] if up is None else [target[up], found[up]]
        axes.plot(x, y, color=ACCENT, linewidth=0.8)
        axes.plot(x[:1], y[:1], color=ACCENT, marker="x", markersize=6, linewidth=0)
        axes.plot(
            x[1:], y[1:], color=ACCENT, marker="o", markersize=5, fillstyle="none", linewidth=0
        )


def _legend(figure: "Figure", with_targets: bool) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=EXAMPLE, marker="s", markersize=4, linewidth=0, label="examples"),
        Line2D([], [], color=SAMPLE, marker=".", linewidth=0, label="samples of blends"),
    ]
    if with_targets:
        handles += [
            Line2D([], [], color=ACCENT, marker="x", linewidth=0, label="asked"),
            Line2D(
                [], [], color=ACCENT, marker="o", fillstyle="none", linewidth=0, label="reached"
            ),
        ]
    figure.legend(handles=handles, loc="outside lower left", ncols=len(handles), frameon=False)


def poses_picture(
    positions: FloatArray,
    rate: float,
    *,
    count: int = 10,
    title: str = "",
    suffix: str = "png",
) -> bytes:
    """Draw a motion as stick figures, from the side and from the front.

    Parameters
    ----------
    positions : ndarray of float, shape (T, 24, 3)
        The canonical joints in metres, Y up, in a frame that faces Z.
    rate : float
        In Hz.
    count : int
        How many poses, evenly spread over time.
    title : str
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file. Left is blue, right is red; seen from the front, its left is on the right.
    """
    frames = np.unique(np.linspace(0, len(positions) - 1, count).round().astype(np.int64))
    span = np.nanmax(positions, axis=(0, 1)) - np.nanmin(positions, axis=(0, 1))
    gap = max(0.9, 0.55 * float(span[[0, 2]].max()))
    with drawing():
        width = 1.15 * len(frames) + 0.6
        figure = new_figure(width, 4.6, title or "motion")
        for row, (across, name) in enumerate(((2, "from the left"), (0, "from the front")), 1):
            axes = figure.add_subplot(2, 1, row)
            for place, frame in enumerate(frames.tolist()):
                x = positions[frame, :, across] + place * gap
                _draw_pose(axes, x, positions[frame, :, 1], faint=False)
                axes.annotate(
                    f"{frame / rate:.2f} s",
                    (float(x[INDEX["root"]]), 0),
                    xytext=(0, -11),
                    textcoords="offset points",
                    ha="center",
                    color=FAINT,
                    fontsize=7,
                    annotation_clip=False,
                )
            axes.axhline(0.0, color=FAINT, linewidth=0.5)
            axes.set_aspect("equal")
            axes.set_axis_off()
            axes.set_title(name, loc="left", color=FAINT, fontsize=7.5)
        return render(figure, suffix)


def _draw_pose(axes: "Axes", x: FloatArray, y: FloatArray, *, faint: bool) -> None:
    """Draw the bones between the joints that are there."""
    for joint, parent in enumerate(PARENTS.tolist()):
        if parent < 0 or not np.isfinite([x[joint], x[parent]]).all():
            continue
        name = next(name for name, index in INDEX.items() if index == joint)
        colour = LEFT if name[0] == "l" else RIGHT if name[0] == "r" else MIDDLE
        axes.plot(
            [x[parent], x[joint]],
            [y[parent], y[joint]],
            color="#cccccc" if faint else colour,
            linewidth=1.6 if faint else 1.1,
            solid_capstyle="round",
        )
