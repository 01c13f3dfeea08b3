"""Inverted lists as pictures: how many segments each feature word has."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from mocapidx.model import IndexArray
from mocapidx.printable import count, shown
from mocapidx.reports.style import CLASS_COLOURS, FAINT, drawing, new_figure, render

__all__ = ["list_sizes_picture"]

LINES: Final = ("-", "--", ":")


def list_sizes_picture(
    sizes: Mapping[str, IndexArray], *, title: str, suffix: str = "png"
) -> bytes:
    """Draw the sizes of inverted lists, the longest first, a curve for each sub-index.

    Parameters
    ----------
    sizes : mapping of str to ndarray of int, shape (lists,)
        For each sub-index, the number of segments in each of its lists.
    title : str
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file.
    """
    with drawing():
        figure = new_figure(6.4, 4.2, title)
        axes = figure.add_subplot()
        for number, (part, own) in enumerate(sizes.items()):
            ordered = np.sort(own)[::-1]
            segments = int(ordered.sum())
            half = int(np.searchsorted(np.cumsum(ordered), segments / 2)) + 1 if segments else 0
            axes.plot(
                np.arange(1, len(ordered) + 1),
                ordered,
                LINES[number % len(LINES)],
                color=CLASS_COLOURS[number],
                linewidth=1.5,
                label=f"{shown(part)}: {count(segments, 'segment')} in "
                f"{count(len(ordered), 'list')}, half of them in {half}",
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter("{x:.0f}")
        axes.set_xlabel("lists, longest first")
        axes.set_ylabel("segments in a list")
        axes.grid(color=FAINT, alpha=0.3, linewidth=0.5)
        axes.legend(frameon=False)
        return render(figure, suffix)
