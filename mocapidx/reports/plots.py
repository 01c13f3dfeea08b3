"""Pictures: templates as matrices, distance functions and annotations over time."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.reports.style import (
    ACCENT,
    FAINT,
    INK,
    class_colours,
    drawing,
    new_figure,
    render,
)
from mocapidx.templates.edit import decided_entries

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "Curve",
    "Span",
    "Track",
    "annotation_picture",
    "distance_picture",
    "template_picture",
]

MOST_POINTS: Final = 6000
"""Points of a curve; more are drawn as the lowest and highest of as many stretches."""

UNDECIDED_DARK: Final = np.array([0.62, 0.30, 0.00])
UNDECIDED_LIGHT: Final = np.array([1.00, 0.86, 0.62])
HIGHEST_COST: Final = 0.5
NAME_LENGTH: Final = 40
INCHES_A_CHARACTER: Final = 0.063


@dataclass(frozen=True, slots=True)
class Span:
    """Something that goes on for a while.

    Parameters
    ----------
    start, end : float
        In seconds.
    label : str
        The class.
    """

    start: float
    end: float
    label: str


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """The distance function of one class.

    Parameters
    ----------
    label : str
        The class.
    costs : ndarray of float, shape (T,)
        Infinite where no match can end.
    tau : float
        The threshold.
    hits : tuple of Span
        What matches below it.
    """

    label: str
    costs: FloatArray
    tau: float
    hits: tuple[Span, ...]


@dataclass(frozen=True, slots=True)
class Track:
    """What is said of one document.

    Parameters
    ----------
    name : str
        The document.
    found : tuple of Span
        Its annotation.
    truth : tuple of Span
        Its labels; empty: none are shown.
    """

    name: str
    found: tuple[Span, ...]
    truth: tuple[Span, ...] = field(default=())


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


def distance_picture(
    curves: Sequence[Curve],
    rate: float,
    *,
    title: str,
    borders: Sequence[float] = (),
    truth: Sequence[Span] = (),
    suffix: str = "png",
) -> bytes:
    """Draw distance functions over time, with their thresholds and hits, and the labels.

    Parameters
    ----------
    curves : sequence of Curve
        A panel each, all of one length.
    rate : float
        In Hz.
    title : str
    borders : sequence of float
        Where one document ends and the next begins, in seconds.
    truth : sequence of Span
        Labels, drawn above the panels.
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file.

    References
    ----------
    .. [1] Mueller, Roeder, SCA 2006, figures 7 and 8.
    """
    duration = max(len(curve.costs) for curve in curves) / rate
    colours = class_colours([*(c.label for c in curves), *(span.label for span in truth)])
    strips = 1 if truth else 0
    with drawing():
        width = float(np.clip(0.22 * duration, 8.0, 18.0))
        figure = new_figure(width, 0.8 + 0.45 * strips + 1.45 * len(curves), title)
        grid = figure.add_gridspec(
            len(curves) + strips, 1, height_ratios=[0.28] * strips + [1.0] * len(curves)
        )
        panels = [figure.add_subplot(grid[n]) for n in range(len(curves) + strips)]
        if strips:
            _draw_strip(panels[0], truth, colours, duration, 0.0, width, faint=True)
            _bare(panels[0])
            panels[0].set_ylim(0, 1)
            panels[0].set_ylabel("labels", rotation=0, ha="right", va="center")
        top = _highest(curves)
        for panel, curve in zip(panels[strips:], curves, strict=True):
            _draw_curve(panel, curve, rate, colours[curve.label])
            panel.set_ylim(0, top)
        for panel in panels:
            panel.set_xlim(0, duration)
            for border in borders:
                panel.axvline(border, color=FAINT, linewidth=0.5, linestyle=":")
            if panel is not panels[-1]:
                panel.tick_params(labelbottom=False)
        panels[-1].set_xlabel("seconds")
        return render(figure, suffix)


def _highest(curves: Sequence[Curve]) -> float:
    """Upper end of the axis of costs, the same for all panels."""
    finite = np.concatenate([curve.costs[np.isfinite(curve.costs)] for curve in curves])
    tau = max(curve.tau for curve in curves)
    return max(min(1.05 * float(finite.max(initial=0.0)), HIGHEST_COST), 1.6 * tau, 0.02)


def _draw_curve(axes: "Axes", curve: Curve, rate: float, colour: str) -> None:
    for hit in curve.hits:
        axes.axvspan(hit.start, hit.end, color=colour, alpha=0.22, linewidth=0)
    times, costs = _envelope(curve.costs, rate)
    axes.plot(times, costs, color=INK, linewidth=0.9)
    ends = [min(max(round(hit.end * rate) - 1, 0), len(curve.costs) - 1) for hit in curve.hits]
    axes.plot(
        [end / rate for end in ends],
        curve.costs[ends],
        linestyle="none",
        marker="o",
        markersize=4,
        markerfacecolor=colour,
        markeredgecolor=INK,
        markeredgewidth=0.6,
    )
    axes.axhline(curve.tau, color=colour, linewidth=0.9, linestyle=(0, (4, 2)))
    axes.set_ylabel("cost")
    axes.set_title(shown(curve.label, NAME_LENGTH), loc="left")
    axes.annotate(
        f"τ {curve.tau:.3g}",
        (1, curve.tau),
        xycoords=("axes fraction", "data"),
        xytext=(3, 0),
        textcoords="offset points",
        va="center",
        fontsize=7,
        annotation_clip=False,
    )
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _envelope(costs: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Give a curve few enough points; infinite costs become gaps."""
    values = np.where(np.isfinite(costs), costs, np.nan).astype(np.float64)
    times = np.arange(len(values)) / rate
    if len(values) <= MOST_POINTS:
        return times, values
    stretch = -(-2 * len(values) // MOST_POINTS)
    firsts = np.arange(0, len(values), stretch)
    lows = np.fmin.reduceat(values, firsts)
    highs = np.fmax.reduceat(values, firsts)
    return np.repeat(times[firsts], 2), np.column_stack((lows, highs)).ravel()


def annotation_picture(tracks: Sequence[Track], *, title: str, suffix: str = "png") -> bytes:
    """Draw annotations as timelines, one for each document, above them the labels.

    Parameters
    ----------
    tracks : sequence of Track
    title : str
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file.
    """
    spans = [span for track in tracks for span in (*track.found, *track.truth)]
    duration = max((span.end for span in spans), default=1.0)
    colours = class_colours(span.label for span in spans)
    rows = sum(1.6 + 0.8 * bool(track.truth) for track in tracks)
    with drawing():
        width = float(np.clip(0.22 * duration, 8.0, 18.0))
        figure = new_figure(width, 1.0 + 0.3 * rows, title)
        axes = figure.add_subplot()
        ticks: list[tuple[float, str]] = []
        nameless: set[str] = set()
        level = 0.0
        for track in tracks:
            if track.truth:
                nameless |= _draw_strip(
                    axes, track.truth, colours, duration, level, width, faint=True
                )
                ticks.append((level + 0.5, "labels"))
                level += 1.1
            nameless |= _draw_strip(axes, track.found, colours, duration, level, width)
            ticks.append((level + 0.5, shown(track.name, NAME_LENGTH)))
            level += 1.7
        axes.set_xlim(0, duration)
        axes.set_ylim(level - 0.4, -0.3)
        axes.set_yticks([place for place, _ in ticks], [name for _, name in ticks])
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("seconds")
        for side in ("top", "right", "left"):
            axes.spines[side].set_visible(False)
        if nameless:
            _class_legend(figure, {label: colours[label] for label in sorted(nameless)})
        return render(figure, suffix)


def _draw_strip(
    axes: "Axes",
    spans: Sequence[Span],
    colours: dict[str, str],
    duration: float,
    bottom: float,
    width: float,
    *,
    faint: bool = False,
) -> set[str]:
    """Draw spans as bars, with their names where there is room; return the classes without."""
    nameless = set()
    for span in spans:
        axes.broken_barh(
            [(span.start, span.end - span.start)],
            (bottom, 1.0),
            facecolor=colours[span.label],
            alpha=0.55 if faint else 1.0,
            edgecolor="white",
            linewidth=0.5,
        )
        name = shown(span.label, NAME_LENGTH)
        room = (min(span.end, duration) - span.start) / duration * (width - 1.5)
        if room > INCHES_A_CHARACTER * 1.1 * len(name):
            axes.text(
                (span.start + min(span.end, duration)) / 2,
                bottom + 0.5,
                name,
                ha="center",
                va="center",
                fontsize=7,
                color=_readable_on(colours[span.label], faint),
                clip_on=True,
            )
        else:
            nameless.add(span.label)
    return nameless


def _readable_on(colour: str, faint: bool) -> str:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    bright = 0.299 * red + 0.587 * green + 0.114 * blue
    return INK if faint or bright > 140 else "white"


def _bare(axes: "Axes") -> None:
    axes.set_yticks([])
    axes.tick_params(axis="x", length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _class_legend(figure: "Figure", colours: dict[str, str]) -> None:
    from matplotlib.patches import Patch

    figure.legend(
        handles=[
            Patch(facecolor=colour, label=shown(label, NAME_LENGTH))
            for label, colour in colours.items()
        ],
        loc="outside lower center",
        ncols=min(len(colours), 6) or 1,
        frameon=False,
        handlelength=1.2,
    )
