"""Distance functions and annotations over time as pictures."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.reports.style import (
    FAINT,
    INCHES_A_CHARACTER,
    INK,
    class_colours,
    drawing,
    new_figure,
    render,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "Curve",
    "Span",
    "Track",
    "annotation_picture",
    "distance_picture",
]

MOST_POINTS: Final = 6000
"""Points of a curve; more are drawn as the lowest and highest of as many stretches."""

NAME_LENGTH: Final = 40


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
        for panel, curve in zip(panels[strips:], curves, strict=True):
            _draw_curve(panel, curve, rate, colours[curve.label])
        for panel in panels:
            panel.set_xlim(0, duration)
            for border in borders:
                panel.axvline(border, color=FAINT, linewidth=0.5, linestyle=":")
            if panel is not panels[-1]:
                panel.tick_params(labelbottom=False)
        panels[-1].set_xlabel("seconds")
        return render(figure, suffix)


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
    highest = float(curve.costs[np.isfinite(curve.costs)].max(initial=0.0))
    axes.set_ylim(0, max(1.05 * highest, 1.6 * curve.tau))
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
    for label in sorted({span.label for span in spans}):
        axes.broken_barh(
            [(span.start, span.end - span.start) for span in spans if span.label == label],
            (bottom, 1.0),
            facecolor=colours[label],
            alpha=0.55 if faint else 1.0,
            edgecolor="white",
            linewidth=0.5,
        )
    for span in spans:
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
