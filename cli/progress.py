"""How far a command is: a bar on a terminal, else a plain line a minute for the log."""

import sys
import time
from typing import Any

from .main import say

__all__ = ["Bar"]

PAUSE = 60  # seconds between two lines in a log


class Bar:
    """A bar that shows how much is done of all there is to do, the rate and the time left.

    Parameters
    ----------
    unit : str
        What is counted.
    quiet : bool
        Draw none, write nothing.
    """

    def __init__(self, unit: str, quiet: bool) -> None:
        self.unit = unit
        self.quiet = quiet
        self.bar: Any = None
        self.start = self.told = time.monotonic()

    def __enter__(self) -> "Bar":
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()

    def show(self, done: int, total: int, frames: int | None = None) -> None:
        """Move the bar, or say how far it is if nothing was said for a minute."""
        if self.quiet:
            return
        if not sys.stderr.isatty():
            self.tell(done, total, frames)
            return
        if self.bar is None:
            from tqdm import tqdm  # with the first step, not with every command

            self.bar = tqdm(total=total, unit=self.unit, file=sys.stderr, dynamic_ncols=True)
        if frames is not None:
            seconds = max(self.bar.format_dict["elapsed"], 1e-9)
            text = f"{frames} frames, {frames / seconds:.0f}/s"
            self.bar.set_postfix_str(text, refresh=False)
        self.bar.update(done - self.bar.n)

    def tell(self, done: int, total: int, frames: int | None) -> None:
        """Write a line for the log, at most one a minute."""
        now = time.monotonic()
        if now - self.told < PAUSE or not done:
            return
        self.told = now
        seconds = now - self.start
        rate = f"{done / seconds:.1f} {self.unit}/s"
        if frames is not None:
            rate = f"{frames} frames, {frames / seconds:.0f}/s"
        left = seconds / done * (total - done) / 60
        say(f"{done} of {total} {self.unit}, {rate}, about {left:.0f} min left")

    def write(self, line: str) -> None:
        """Print a line above the bar, also where no bar is drawn."""
        if self.quiet:
            return
        if self.bar is not None:
            self.bar.clear()
        say(line)
        if self.bar is not None:
            self.bar.refresh()
