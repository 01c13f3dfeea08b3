"""Stretches of C3D files as their own bytes: points, residuals and analogue values stay.

Header and parameters are kept whole; only the places that count frames are mended. Frames keep
the numbers that they had, so that the times of events still mean what they meant.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.c3d_layout import BLOCK, C3dLayout, Parameter, read_layout
from mocapidx.formats.text import Limits, place, read_binary

__all__ = ["C3dFrames", "c3d_frames"]

MOST: Final = 65_535  # that a header counts to
FIRST_WORD, LAST_WORD = 6, 8  # bytes where the header has its first and last frame


@dataclass(frozen=True, slots=True)
class C3dFrames:
    """A C3D file and where its frames stand.

    Parameters
    ----------
    layout : C3dLayout
        What the file says of itself.
    data : bytes
        All of it.
    """

    layout: C3dLayout
    data: bytes

    def __len__(self) -> int:
        return self.layout.frames

    def cut(self, start: int, end: int) -> bytes:
        """Return the bytes of a stretch.

        Parameters
        ----------
        start, end : int
            Frames of the file, from 0, end exclusive.

        Returns
        -------
        bytes
            A whole file. Frames are numbered as before where the header can count so far, else
            from 1.

        Raises
        ------
        FormatError
            If the file has no such frames.
        """
        layout = self.layout
        if not 0 <= start < end <= layout.frames:
            raise FormatError(
                f"{place(layout.path)}: has {layout.frames} frames, none from {start} to {end}"
            )
        count = end - start
        first = layout.first_frame + start
        if first + count - 1 >= MOST:
            first = 1
        head = bytearray(self.data[: layout.data_start])
        self._number(head, first, first + count - 1)
        begin = layout.data_start + start * layout.frame_size
        frames = self.data[begin : begin + count * layout.frame_size]
        return bytes(head) + frames + bytes(-len(frames) % BLOCK)

    def _number(self, head: bytearray, first: int, last: int) -> None:
        parameters = self.layout.parameters
        self._put_word(head, FIRST_WORD, first)
        self._put_word(head, LAST_WORD, last)
        for name in ("POINT:FRAMES", "POINT:LONG_FRAMES"):
            if name in parameters:
                self._put_count(head, parameters[name], last - first + 1)
        for which, number in (("START", first), ("END", last)):
            field = parameters.get(f"TRIAL:ACTUAL_{which}_FIELD")
            if field is not None and field.kind == 2 and len(field.data) >= 4:
                self._put_word(head, field.offset, number & MOST)
                self._put_word(head, field.offset + 2, number >> 16)

    def _put_count(self, head: bytearray, parameter: Parameter, count: int) -> None:
        if parameter.kind == 2 and len(parameter.data) >= 2:
            self._put_word(head, parameter.offset, count)
        elif parameter.kind == 4 and len(parameter.data) >= 4:
            head[parameter.offset : parameter.offset + 4] = self._float(count)

    def _put_word(self, head: bytearray, at: int, number: int) -> None:
        order = "big" if self.layout.processor == "SGI" else "little"
        head[at : at + 2] = min(number, MOST).to_bytes(2, order)  # type: ignore[arg-type]

    def _float(self, number: int) -> bytes:
        if self.layout.processor != "DEC":
            return np.array(number, ">f4" if self.layout.processor == "SGI" else "<f4").tobytes()
        # a VAX float is an IEEE one with its halves exchanged and an exponent larger by 2
        return np.array(4.0 * number, "<f4").view("<u2")[::-1].tobytes()


def c3d_frames(path: Path, limits: Limits) -> C3dFrames:
    """Find the frames of a C3D file.

    Parameters
    ----------
    path : Path
        The file.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    C3dFrames

    Raises
    ------
    FormatError
        If it is no C3D file, or its numbers don't fit together.
    """
    data = read_binary(path, limits)
    return C3dFrames(read_layout(path, data), data)
