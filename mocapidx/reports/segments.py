"""Feature matrices as pictures: every feature over time, and the segments of each sub-index."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from mocapidx.model import BoolArray, IndexArray
from mocapidx.printable import count, shown
from mocapidx.reports.style import (
    ACCENT,
    FAINT,
    INCHES_A_CHARACTER,
    INK,
    drawing,
    new_figure,
    render,
)
from mocapidx.segments.runs import find_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["feature_matrix_picture"]

INCHES_A_FEATURE: Final = 0.14
INCHES_A_FRAME: Final = 0.012
UNTRUSTED: Final = "#d9d9d9"


def feature_matrix_picture(
    matrix: BoolArray,
    names: Sequence[str],
    parts: Sequence[str],
    rate: float,
    *,
    title: str,
    start: float = 0.0,
    untrusted: Sequence[bool] | None = None,
    suffix: str = "png",
) -> bytes:
    """Draw a feature matrix, a panel for each part, with the segments of the part below it.

    Parameters
    ----------
    matrix : ndarray of bool, shape (T, F)
        Dark where a feature is on.
    names, parts : sequence of str, length F
        Of the features; those of a part stand together, and make its sub-index.
    rate : float
        In Hz.
    title : str
    start : float
        Seconds at the first frame.
    untrusted : sequence of bool, length F, optional
        Features that the skeleton can't tell are grey.
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, "Efficient content-based retrieval of motion capture data",
       SIGGRAPH 2005, section 3.
    """
    hidden = np.zeros(len(names), bool) if untrusted is None else np.asarray(untrusted, bool)
    groups = {part: [i for i, own in enumerate(parts) if own == part] for part in parts}
    names = [shown(name, 50) for name in names]
    margin = INCHES_A_CHARACTER * max(map(len, names))
    width = float(np.clip(INCHES_A_FRAME * len(matrix), 3.6, 16.0))
    heights = [len(group) + 2 for group in groups.values()]
    with drawing():
        height = INCHES_A_FEATURE * sum(heights) + 0.45 * len(groups) + 0.9
        figure = new_figure(margin + width + 0.6, height, title)
        panels = figure.subplots(len(groups), 1, sharex=True, squeeze=False, height_ratios=heights)[
            :, 0
        ]
        for axes, (part, group) in zip(panels, groups.items(), strict=True):
            bounds = _draw_part(axes, matrix[:, group], hidden[group], start, rate)
            axes.set_yticks(
                [*np.arange(len(group)) + 0.5, len(group) + 1.25],
                [*(names[i] for i in group), "segments"],
            )
            segments = count(len(bounds) - 1, "segment")
            axes.set_title(f"{part}: {segments}", loc="left", color=INK)
        panels[-1].set_xlabel("seconds")
        return render(figure, suffix)


def _draw_part(
    axes: "Axes", matrix: BoolArray, hidden: BoolArray, start: float, rate: float
) -> IndexArray:
    """Draw the features of a part and its segments; return the bounds of these in frames."""
    frames, features = matrix.shape
    end = start + frames / rate
    shade = np.where(hidden, 0.85, np.where(matrix, 0.15, 1.0))
    axes.imshow(
        shade.T,
        aspect="auto",
        interpolation="nearest",
        cmap="gray",
        vmin=0.0,
        vmax=1.0,
        extent=(start, end, features, 0),
    )
    for row in range(1, features):
        axes.axhline(row, color=FAINT, linewidth=0.2)
    seen = np.where(hidden, False, matrix)
    _, bounds = find_runs(seen @ (np.uint64(1) << np.arange(features, dtype=np.uint64)))
    for number, (first, last) in enumerate(pairwise(bounds.tolist())):
        axes.axvspan(
            start + first / rate,
            start + last / rate,
            0.0,
            1.5 / (features + 2),
            facecolor=ACCENT if number % 2 else "#b4cfe2",
            linewidth=0,
        )
    axes.set_ylim(features + 2, 0)
    axes.set_xlim(start, end)
    axes.tick_params(axis="y", length=0, labelsize=7)
    return bounds
