"""The values of a file's frames, gathered while the file is read."""

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import numpy as np

from mocapidx.model import FloatArray, IndexArray

__all__ = ["FrameTable"]

Reader: TypeAlias = Callable[..., tuple[int, int, int]]

STEP: Final = 1 << 15
"""Values for which there is room at first, and the least by which it grows."""


class FrameTable:
    """Frames of a file in the order of its channels; the memory follows what has been read.

    Parameters
    ----------
    targets : ndarray of int64, shape (C,)
        The channel of each number of a frame, as the text has them.
    scales : ndarray of float64, shape (C,)
        What each number is multiplied by.
    """

    def __init__(self, targets: IndexArray, scales: FloatArray) -> None:
        self._targets, self._scales = targets, scales
        self._order = np.argsort(targets)
        self._values: FloatArray = np.empty((max(STEP // len(targets), 2), len(targets)))
        self.frames = 0

    def expect(self, done: int, size: int) -> None:
        """Make room for a whole file at once, judging by its first bytes: cheaper than bit by bit.

        Parameters
        ----------
        done : int
            Bytes of the file that hold the frames so far.
        size : int
            Bytes of the file.
        """
        likely = int(1.02 * self.frames * (size / max(done, 1)))
        rows = min(likely, size // (8 * len(self._targets)))  # text is rarely shorter than values
        if rows > len(self._values):
            values = np.empty((rows, len(self._targets)))
            values[: self.frames] = self._values[: self.frames]
            self._values = values

    def extend(self, numbers: FloatArray) -> None:
        """Add frames, shape (T, C), with their numbers as the text has them."""
        end = self.frames + len(numbers)
        if end > len(self._values):
            self._grow(end)
        room = self._values[self.frames : end]
        np.take(numbers * self._scales, self._order, axis=1, out=room, mode="clip")
        self.frames = end

    def scan(self, read: Reader, text: bytes, at: int, *layout: Any) -> tuple[int, int]:
        """Let a kernel add the frames that it can read.

        Parameters
        ----------
        read : callable
            A function of the kernel ``text``.
        text : bytes
        at : int
            Where the frames begin.
        *layout
            What the kernel must know besides; if anything, first the number of the first frame.

        Returns
        -------
        at, lines : int
            Where the first frame stands that is irregular, and how many lines end before.
        """
        lines = 0
        while True:
            frames, at, passed = read(
                text, at, *layout, self._targets, self._scales, self._values, self.frames
            )
            self.frames += frames
            lines += passed
            if at == len(text) or len(self._values) > self.frames + 1:
                return at, lines
            if layout:  # the number of the first frame
                layout = (layout[0] + frames, *layout[1:])
            self._grow(0)

    def finish(self) -> FloatArray:
        """Return all values, shape (T, C); nothing can be added any more."""
        self._resize(self.frames)
        return self._values

    def _grow(self, least: int) -> None:
        rows = len(self._values)
        self._resize(max(least, rows + max(rows // 8, STEP // len(self._targets), 2)))

    def _resize(self, rows: int) -> None:
        # In place, as far as the system can: no moment in which all values are there twice.
        # Nobody else refers to the array, and a debugger that does must not change the outcome.
        self._values.resize((rows, len(self._targets)), refcheck=False)
