"""The table of speeds: its rows, and how they are written."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from bench.measure import Growth

__all__ = ["HEADER", "Row", "line", "seconds_as_text"]

HEADER = (
    "| what | ours | peer | times faster | limit | times the limit | growth (slope) |\n"
    "| --- | --- | --- | --- | --- | --- | --- |"
)


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Parameters
    ----------
    what : str
        The work.
    ours : float or str
        Seconds, or text where it is something else.
    peer : str
        Who else did the same work.
    theirs : float, optional
        Seconds.
    limit : str
        What can't be avoided.
    least : float, optional
        Its seconds.
    growth : Growth, optional
        Of ours with the work.
    wanted : str
        What was aimed at, such as ``at least 30 times``.
    """

    what: str
    ours: float | str
    peer: str = ""
    theirs: float | None = None
    limit: str = ""
    least: float | None = None
    growth: Growth | None = None
    wanted: str = ""

    @property
    def faster(self) -> float | None:
        """How many times faster than the peer."""
        if self.theirs is None or isinstance(self.ours, str):
            return None
        return self.theirs / self.ours

    @property
    def of_limit(self) -> float | None:
        """How many times as long as the limit."""
        if self.least is None or isinstance(self.ours, str):
            return None
        return self.ours / self.least


def line(row: Row) -> str:
    """Write a row as Markdown."""
    peer = row.peer if row.theirs is None else f"{row.peer}: {seconds_as_text(row.theirs)}"
    limit = row.limit if row.least is None else f"{row.limit}: {seconds_as_text(row.least)}"
    cells = (
        row.what + (f" ({row.wanted})" if row.wanted else ""),
        row.ours if isinstance(row.ours, str) else seconds_as_text(row.ours),
        peer,
        _digits(row.faster),
        limit,
        _digits(row.of_limit),
        "" if row.growth is None else _growth(row.growth),
    )
    return "| " + " | ".join(cells) + " |"


def seconds_as_text(seconds: float) -> str:
    """Write a time in the unit that suits it."""
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * factor >= 1:
            return f"{_digits(seconds * factor)} {unit}"
    return f"{seconds * 1e9:.0f} ns"


def _growth(growth: Growth) -> str:
    ratios: Iterable[str] = (_digits(each / growth.seconds[0]) for each in growth.seconds[1:])
    return f"{', '.join(ratios)} at {_listed(growth.times[1:])} times ({growth.slope:.2f})"


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers))


def _digits(value: float | None) -> str:
    """Write a number to three digits."""
    if value is None:
        return ""
    places = max(0, 2 - math.floor(math.log10(value))) if value > 0 else 0
    return f"{value:,.{min(places, 3)}f}"
