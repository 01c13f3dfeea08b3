"""Stretches of BVH and AMC files as their own text: the numbers keep every digit."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.decimals import decimal
from mocapidx.formats.text import Limits, place, read_text
from mocapidx.model import IndexArray

__all__ = ["TextFrames", "amc_frames", "bvh_frames", "with_rate"]

# What readers take for blank in a line: some control characters, and between numbers all.
FRAMES: Final = re.compile(rb"(?im)^[^\S\n]*frames[^\S\n]*:[^\S\n]*(\+?[0-9]{1,18})[^\S\n]*$")
ROW: Final = re.compile(rb"[^\x00-\x20][^\n]*")
KEYWORD: Final = re.compile(rb"(?m)^[^\S\n]*:")
FRAME_LINE: Final = re.compile(
    rb"(?m)^[\x00-\x09\x0b-\x20]*([0-9]{1,15})(?=[\x00-\x09\x0b-\x20]*$)"
)


@dataclass(frozen=True, slots=True)
class TextFrames:
    """A motion file as text, and where its frames stand.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : bytes
        Its text.
    bounds : ndarray of int64, shape (T, 2)
        Where each frame begins and ends, in bytes.
    count : tuple of int or None
        Where the number of frames stands (BVH); None: each frame begins with its own number
        (AMC).
    """

    path: Path
    data: bytes
    bounds: IndexArray
    count: tuple[int, int] | None

    def __len__(self) -> int:
        return len(self.bounds)

    def cut(self, start: int, end: int) -> bytes:
        """Return the text of a stretch.

        Parameters
        ----------
        start, end : int
            Frames of the file, from 0, end exclusive.

        Returns
        -------
        bytes
            A whole file: header, then the frames as they stand. Numbers of frames begin at 1.

        Raises
        ------
        FormatError
            If the file has no such frames.
        """
        if not 0 <= start < end <= len(self.bounds):
            raise FormatError(
                f"{place(self.path)}: has {len(self.bounds)} frames, none from {start} to {end}"
            )
        head = self.data[: self.bounds[0, 0]]
        if self.count is not None:
            before, after = self.count
            rows = self.data[self.bounds[start, 0] : self.bounds[end - 1, 1]]
            return b"%b%d%b%b\n" % (head[:before], end - start, head[after:], rows)
        stops = [*self.bounds[start + 1 : end + 1, 0].tolist(), len(self.data)]
        frames = [
            b"%d%b" % (number, self.data[after:stop])
            for number, (after, stop) in enumerate(
                zip(self.bounds[start:end, 1].tolist(), stops, strict=False), start=1
            )
        ]
        return head + b"".join(frames)


def bvh_frames(path: Path, limits: Limits) -> TextFrames:
    """Find the frames of a BVH file.

    Parameters
    ----------
    path : Path
        A file that `read_bvh` reads.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    TextFrames

    Raises
    ------
    FormatError
        If the file can't be read or does not say how many frames it has.
    """
    data = read_text(path, limits)
    frames = FRAMES.search(data)
    time = ROW.search(data, frames.end()) if frames else None
    if frames is None or time is None:
        raise FormatError(f"{place(path)}: expected 'Frames: N' and 'Frame Time: S'")
    spans = [row.span() for row in ROW.finditer(data, time.end())]
    return TextFrames(path, data, np.array(spans, np.int64).reshape(-1, 2), frames.span(1))


def amc_frames(path: Path, limits: Limits) -> TextFrames:
    """Find the frames of an AMC file.

    Parameters
    ----------
    path : Path
        A file that `read_amc` reads.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    TextFrames

    Raises
    ------
    FormatError
        If the file can't be read.
    """
    data = read_text(path, limits)
    spans = [line.span(1) for line in FRAME_LINE.finditer(data)]
    return TextFrames(path, data, np.array(spans, np.int64).reshape(-1, 2), None)


def with_rate(text: bytes, rate: float) -> bytes:
    """Let an AMC say its rate, which few do.

    Parameters
    ----------
    text : bytes
        The file.
    rate : float
        Frames a second, in Hz.

    Returns
    -------
    bytes
        With a line ``:SAMPLES-PER-SECOND`` before the other keywords: readers that know none
        but ``:DEGREES`` look for that one last.
    """
    first = KEYWORD.search(text) or FRAME_LINE.search(text)
    at = 0 if first is None else first.start()
    end = b"\r\n" if b"\r\n" in text else b"\n"
    return b"%b:SAMPLES-PER-SECOND %b%b%b" % (text[:at], decimal(rate).encode(), end, text[at:])
