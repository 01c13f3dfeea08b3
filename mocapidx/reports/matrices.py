"""Templates as pictures: what the examples of a class agree on."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.reports.style import (
    ACCENT,
    FAINT,
    INCHES_A_CHARACTER,
    drawing,
    new_figure,
    render,
)
from mocapidx.templates.edit import decided_entries

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["template_picture"]

UNDECIDED_DARK: Final = np.array([0.62, 0.30, 0.00])
UNDECIDED_LIGHT: Final = np.array([1.00, 0.86, 0.62])


def template_picture(
    matrix: FloatArray,
    delta: float,
    names: Sequence[str],
    parts: Sequence[str],
    rate: float,
    *,
    title: str,
    subtitle: str = "",
    keyframes: Sequence[int] = (),
    suffix: str = "png",
) -> bytes:
    """Draw a template: rows are features, columns are frames, black is 0 and white is 1.

    Parameters
    ----------
    matrix : ndarray of float64, shape (K, F)
        The template; undecided entries are drawn in colour, darker towards 0.
    delta : float
        What is below `delta` or above ``1 - delta`` is decided.
    names : sequence of str, length F
        Of the features.
    parts : sequence of str, length F
        Features of one part stand together.
    rate : float
        In Hz.
    title, subtitle : str
    keyframes : sequence of int
        Columns that are marked.
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file.

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, figures 4 and 6.
    """
    frames, features = matrix.shape
    names = [shown(name, 60) for name in names]
    margin = INCHES_A_CHARACTER * max(map(len, names))
    order = sorted(range(features), key=lambda i: list(dict.fromkeys(parts)).index(parts[i]))
    with drawing():
        width = float(np.clip(0.055 * frames, 3.6, 14.0))
        figure = new_figure(margin + width + 0.9, 0.155 * features + 1.7, title)
        axes = figure.add_subplot()
        axes.imshow(
            _entry_colours(matrix, delta)[order],
            aspect="auto",
            interpolation="nearest",
            extent=(0, frames, features, 0),
        )
        axes.set_yticks(np.arange(features) + 0.5, [names[i] for i in order])
        axes.tick_params(axis="y", length=0, labelsize=7)
        _divide_rows(axes, [parts[i] for i in order], frames)
        axes.set_xlabel("frame of the template")
        _seconds_above(axes, rate)
        for row in keyframes:
            axes.axvspan(row, row + 1, facecolor="none", edgecolor=ACCENT, linewidth=1.2)
        if subtitle:
            axes.set_title(shown(subtitle, None), loc="left", color=FAINT, fontsize=7.5)
        _entry_legend(figure, bool(keyframes))
        return render(figure, suffix)


def _entry_colours(matrix: FloatArray, delta: float) -> FloatArray:
    """RGB of each entry, shape (F, K, 3): grey where decided, else between two oranges."""
    value = matrix.T[..., None]
    ones, zeros = decided_entries(matrix, delta)
    undecided = UNDECIDED_DARK + value * (UNDECIDED_LIGHT - UNDECIDED_DARK)
    return np.where((ones | zeros).T[..., None], np.repeat(value, 3, axis=2), undecided)


def _divide_rows(axes: "Axes", parts: Sequence[str], frames: int) -> None:
    """Draw a line between features, a strong one between parts, and name the parts."""
    first = 0
    for row in range(1, len(parts) + 1):
        border = row == len(parts) or parts[row] != parts[row - 1]
        axes.axhline(row, color=ACCENT if border else FAINT, linewidth=1.0 if border else 0.25)
        if border:
            axes.annotate(
                shown(parts[first]),
                (frames, (first + row) / 2),
                xytext=(4, 0),
                textcoords="offset points",
                rotation=-90,
                va="center",
                color=ACCENT,
                annotation_clip=False,
            )
            first = row


def _seconds_above(axes: "Axes", rate: float) -> None:
    def to_seconds(frames: Any) -> Any:
        return frames / rate

    def to_frames(seconds: Any) -> Any:
        return seconds * rate

    axes.secondary_xaxis("top", functions=(to_seconds, to_frames)).set_xlabel("seconds")


def _entry_legend(figure: "Figure", with_keyframes: bool) -> None:
    from matplotlib.patches import Patch

    middle = tuple((UNDECIDED_DARK + UNDECIDED_LIGHT) / 2)
    patches = [
        Patch(facecolor="white", edgecolor=FAINT, label="1"),
        Patch(facecolor="black", edgecolor=FAINT, label="0"),
        Patch(facecolor=middle, edgecolor=FAINT, label="undecided (darker: nearer 0)"),
    ]
    if with_keyframes:
        patches.append(Patch(facecolor="none", edgecolor=ACCENT, label="keyframe"))
    figure.legend(
        handles=patches,
        loc="outside lower right",
        ncols=len(patches),
        frameon=False,
        handlelength=1.2,
        columnspacing=1.2,
    )
