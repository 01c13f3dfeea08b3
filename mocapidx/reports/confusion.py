"""Confusion tables as pictures: what was said while something happened."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from mocapidx.printable import shown
from mocapidx.reports.style import FAINT, INCHES_A_CHARACTER, INK, drawing, new_figure, render

__all__ = ["confusion_picture"]

INCHES_A_CELL: Final = 0.42
LEAST: Final = 0.005  # a smaller share is no number in its cell


def confusion_picture(
    seconds: Mapping[tuple[str, str], float],
    truth: Sequence[str],
    said: Sequence[str],
    *,
    title: str,
    suffix: str = "png",
) -> bytes:
    """Draw how the time of each true class is shared out among what was said.

    Parameters
    ----------
    seconds : mapping of (str, str) to float
        Of a true class and what was said of it.
    truth : sequence of str
        Rows, from above.
    said : sequence of str
        Columns, from the left.
    title : str
    suffix : {"png", "svg"}

    Returns
    -------
    bytes
        Of the file; the darker a cell, the greater its share of the row, also printed in
        percent. The seconds of each row stand at its right.
    """
    table = np.array([[seconds.get((row, column), 0.0) for column in said] for row in truth])
    sums = table.sum(axis=1, keepdims=True)
    shares = np.divide(table, sums, out=np.zeros_like(table), where=sums > 0)
    rows, columns = ([shown(name, 40) for name in names] for names in (truth, said))
    margin = INCHES_A_CHARACTER * max(map(len, rows)) + 0.5
    below = INCHES_A_CHARACTER * max(map(len, columns)) + 0.7
    with drawing():
        figure = new_figure(
            max(margin + INCHES_A_CELL * len(columns) + 0.9, 3.6),
            below + INCHES_A_CELL * len(rows) + 0.5,
            title,
        )
        axes = figure.add_subplot()
        axes.imshow(shares, cmap="Greys", vmin=0.0, vmax=1.0, aspect="auto")
        for row, column in np.argwhere(shares >= LEAST).tolist():
            share = shares[row, column]
            axes.text(
                column,
                row,
                f"{100 * share:.0f}",
                ha="center",
                va="center",
                color="white" if share > 0.5 else INK,
                fontsize=7,
            )
        axes.set_xticks(range(len(columns)), columns, rotation=90)
        axes.set_yticks(range(len(rows)), rows)
        axes.set_xlabel("said (percent of the row)")
        axes.set_ylabel("true")
        axes.tick_params(length=0)
        right = axes.secondary_yaxis("right")
        right.set_yticks(range(len(rows)), [f"{total:.1f} s" for total in sums[:, 0]])
        right.tick_params(length=0, colors=FAINT)
        return render(figure, suffix)
