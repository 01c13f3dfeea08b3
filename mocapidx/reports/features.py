"""Features over time as pictures: their values, both thresholds, and where they are on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from mocapidx.model import BoolArray, FloatArray
from mocapidx.printable import shown
from mocapidx.reports.style import CLASS_COLOURS, FAINT, INK, drawing, new_figure, render
from mocapidx.segments.runs import find_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["FeaturePanel", "LeafCurve", "feature_picture"]

ON: Final = "#4477aa"
LONGEST_TEXT: Final = 110
STRONG: Final = (0, (5, 2))
WEAK: Final = (0, (1, 2))


@dataclass(frozen=True, slots=True, eq=False)
class LeafCurve:
    """The value of one generic feature over time.

    Parameters
    ----------
    text : str
        Its formula.
    values : ndarray of float, shape (T,)
        NaN where unknown.
    unit : str
    on, off : tuple of float
        The ends of the stronger and of the weaker test.
    """

    text: str
    values: FloatArray
    unit: str
    on: tuple[float, ...]
    off: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class FeaturePanel:
    """A feature: the values of all that it is made of, and where it is on.

    Parameters
    ----------
    title : str
    curves : tuple of LeafCurve
        At least one.
    bits : ndarray of bool, shape (T,)
    """

    title: str
    curves: tuple[LeafCurve, ...]
    bits: BoolArray


def feature_picture(
    panels: Sequence[FeaturePanel],
    rate: float,
    *,
    title: str,
    start: float = 0.0,
    suffix: str = "png",
) -> bytes:
    """Draw features over time, a panel each: values, thresholds, shaded where the feature is on.

    Parameters
    ----------
    panels : sequence of FeaturePanel
        All of one length.
    rate : float
        In Hz.
    title : str
    start : float
        The time of the first frame, in seconds.
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file.

    References
    ----------
    .. [1] Mueller, Roeder, "A relational approach to content-based analysis of motion capture
       data", figures 11 and 14.
    """
    frames = len(panels[0].bits)
    width = float(np.clip(0.9 * frames / rate, 7.5, 16.0))
    if any(len(panel.curves) > 1 for panel in panels):
        width += 2.0  # their formulas stand beside the panel
    with drawing():
        figure = new_figure(width, 1.1 + 1.55 * len(panels), title)
        grid = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        for axes, panel in zip(grid, panels, strict=True):
            _draw_panel(axes, panel, rate, start)
            axes.set_xlim(start, start + frames / rate)
            if axes is not grid[-1]:
                axes.tick_params(labelbottom=False)
        grid[-1].set_xlabel("seconds")
        _legend(figure)
        return render(figure, suffix)


def _draw_panel(axes: "Axes", panel: FeaturePanel, rate: float, start: float) -> None:
    states, bounds = find_runs(panel.bits.view(np.uint8))
    edges = start + bounds / rate
    for on, begin, end in zip(states.tolist(), edges[:-1], edges[1:], strict=True):
        if on:
            axes.axvspan(begin, end, color=ON, alpha=0.18, linewidth=0)
    times = start + (np.arange(len(panel.bits)) + 0.5) / rate
    several = len(panel.curves) > 1
    drawn: set[tuple[object, ...]] = set()
    for n, curve in enumerate(panel.curves):
        colour = CLASS_COLOURS[n % len(CLASS_COLOURS)] if several else INK
        axes.plot(times, curve.values, color=colour, linewidth=1.0, label=curve.text)
        for ends, dashes in ((curve.on, STRONG), (curve.off, WEAK)):
            for end in ends:
                if (end, dashes) not in drawn:  # parts of a combination often share thresholds
                    drawn.add((end, dashes))
                    axes.axhline(end, color=FAINT, linewidth=0.9, linestyle=dashes)
    _make_room(axes, panel.curves)
    axes.set_ylabel(", ".join(dict.fromkeys(curve.unit for curve in panel.curves)))
    axes.set_title(shown(panel.title, LONGEST_TEXT), loc="left")
    if several:
        axes.legend(
            loc="upper left",
            bbox_to_anchor=(1.0, 1.0),
            frameon=False,
            fontsize=6.5,
            handlelength=1.2,
        )
    else:
        axes.set_title(
            shown(panel.curves[0].text, LONGEST_TEXT), loc="right", color=FAINT, fontsize=7
        )
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    figure.legend(
        handles=[
            Line2D([], [], color=FAINT, linestyle=STRONG, label="turns on"),
            Line2D([], [], color=FAINT, linestyle=WEAK, label="turns off"),
            Patch(facecolor=ON, alpha=0.18, label="on"),
        ],
        loc="outside lower left",
        ncols=3,
        frameon=False,
        handlelength=2.2,
    )


def _make_room(axes: "Axes", curves: Sequence[LeafCurve]) -> None:
    """Show all values and all thresholds."""
    numbers = [curve.values[np.isfinite(curve.values)] for curve in curves]
    numbers += [np.array(curve.on + curve.off) for curve in curves]
    every = np.concatenate(numbers)
    low, high = float(every.min()), float(every.max())
    room = 0.06 * (high - low) or 0.5
    axes.set_ylim(low - room, high + room)
