"""The progress bar of the commands: on a terminal only, never in a log."""

import sys
from typing import Any

from .main import say

__all__ = ["Bar"]


class Bar:
    """A bar that shows how much is done of all there is to do.

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
        self.hidden = quiet or not sys.stderr.isatty()
        self.bar: Any = None

    def __enter__(self) -> "Bar":
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()

    def show(self, done: int, total: int, frames: int | None = None) -> None:
        """Move the bar; tqdm is imported with the first step."""
        if self.hidden:
            return
        if self.bar is None:
            from tqdm import tqdm

            self.bar = tqdm(total=total, unit=self.unit, file=sys.stderr)
        if frames is not None:
            seconds = max(self.bar.format_dict["elapsed"], 1e-9)
            text = f"{frames} frames, {frames / seconds:.0f}/s"
            self.bar.set_postfix_str(text, refresh=False)
        self.bar.update(done - self.bar.n)

    def write(self, line: str) -> None:
        """Print a line above the bar, also where no bar is drawn."""
        if self.quiet:
            return
        if self.bar is not None:
            self.bar.clear()
        say(line)
        if self.bar is not None:
            self.bar.refresh()
