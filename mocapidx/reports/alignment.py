"""Alignments as pictures: matched segments, the region around them, and the path through it."""

import textwrap
from typing import TYPE_CHECKING, Final

import numpy as np

from mocapidx.alignment.banded import WarpingPath
from mocapidx.alignment.coarse import Region, SegmentMatch
from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.reports.style import ACCENT, FAINT, INK, drawing, new_figure, render

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["alignment_picture"]

REGION: Final = "#dedede"
SEGMENT: Final = "#b4cfe2"
LONGEST_SIDE: Final = 6.5
SHORTEST_SIDE: Final = 2.4
NAME_LENGTH: Final = 60
INCHES_A_LETTER: Final = 0.06


def alignment_picture(
    names: tuple[str, str],
    frames: tuple[int, int],
    starts: tuple[int, int],
    rate: float,
    *,
    match: SegmentMatch | None = None,
    region: Region | None = None,
    path: WarpingPath | None = None,
    title: str = "",
    subtitle: str = "",
    suffix: str = "png",
) -> bytes:
    """Draw an alignment: one motion upwards, the other to the right.

    Parameters
    ----------
    names : (str, str)
        Of the motions.
    frames, starts : (int, int)
        How many frames of each are aligned, and the first one's number.
    rate : float
        In Hz.
    match : SegmentMatch, optional
        Matched segments: rectangles.
    region : Region, optional
        The cells that were looked at: grey.
    path : WarpingPath, optional
        The warping path: a line.
    title, subtitle : str
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, "Efficient content-based retrieval of motion capture
       data", SIGGRAPH 2005, figure 11.
    """
    sides = np.array(frames) / max(frames) * LONGEST_SIDE
    height, width = np.maximum(sides, SHORTEST_SIDE).tolist()
    offsets = np.array(starts) / rate
    with drawing():
        figure = new_figure(width + 1.0, height + 1.5, title or "alignment")
        axes = figure.add_subplot()
        if region is not None:
            edges = offsets[0] + np.arange(frames[0] + 1) / rate
            lows, highs = (offsets[1] + ends / rate for ends in (region.lows, region.highs))
            axes.fill_betweenx(
                edges,
                np.append(lows, lows[-1]),
                np.append(highs, highs[-1]),
                step="post",
                color=REGION,
                linewidth=0,
            )
        if match is not None:
            _draw_segments(axes, match, offsets, rate)
        if path is not None:
            times = [(side + 0.5) / rate for side in (path.columns, path.rows)]
            axes.plot(offsets[1] + times[0], offsets[0] + times[1], color=INK, linewidth=1.3)
        axes.set_xlim(offsets[1], offsets[1] + frames[1] / rate)
        axes.set_ylim(offsets[0], offsets[0] + frames[0] / rate)
        axes.set_xlabel(f"{shown(names[1], NAME_LENGTH)}, seconds")
        axes.set_ylabel(f"{shown(names[0], NAME_LENGTH)}, seconds")
        if subtitle:
            lines = textwrap.wrap(shown(subtitle, None), int(width / INCHES_A_LETTER))
            axes.set_title("\n".join(lines), loc="left", color=FAINT, fontsize=7.5)
        _legend(figure, match is not None, region is not None, path is not None)
        return render(figure, suffix)


def _draw_segments(axes: "Axes", match: SegmentMatch, offsets: FloatArray, rate: float) -> None:
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    up = (offsets[0] + match.bounds / rate).tolist()
    right = (offsets[1] + match.other_bounds / rate).tolist()
    corners = zip(right[:-1], right[1:], up[:-1], up[1:], strict=True)
    rectangles = [Rectangle((x, y), end - x, top - y) for x, end, y, top in corners]
    axes.add_collection(
        PatchCollection(rectangles, facecolor=SEGMENT, edgecolor=ACCENT, linewidth=0.7)
    )


def _legend(figure: "Figure", segments: bool, region: bool, path: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Patch | Line2D] = []
    if segments:
        handles.append(Patch(facecolor=SEGMENT, edgecolor=ACCENT, label="matched segments"))
    if region:
        handles.append(Patch(facecolor=REGION, label="region"))
    if path:
        handles.append(Line2D([], [], color=INK, linewidth=1.3, label="warping path"))
    figure.legend(
        handles=handles,
        loc="outside lower left",
        ncols=max(len(handles), 1),
        frameon=False,
        handlelength=1.2,
        columnspacing=1.2,
    )
