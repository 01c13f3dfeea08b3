"""The layout of a C3D file: its header, its parameters, and where the frames lie.

Everything in a C3D file counts something else in it, and any of these numbers may lie. All are
compared with the size of the file before anything is taken from it.

References
----------
.. [1] The C3D File Format User Guide, Motion Lab Systems, 2008, chapters "The Header Section",
   "The Parameter Section" and "3D Point Data".
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.text import decoded, place
from mocapidx.model import FloatArray
from mocapidx.printable import shown

__all__ = ["BLOCK", "C3dLayout", "Parameter", "floats_of", "read_layout"]

BLOCK: Final = 512  # bytes
MAGIC: Final = 0x50
PROCESSORS: Final = {84: "Intel", 85: "DEC", 86: "SGI"}
SIZES: Final = {-1: 1, 1: 1, 2: 2, 4: 4}  # bytes of one value, by the type of a parameter
MOST_PARAMETERS: Final = 65_536
MOST_COUNTED: Final = 65_535  # frames; what is more is counted elsewhere


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a C3D file.

    Parameters
    ----------
    kind : {-1, 1, 2, 4}
        Letters, bytes, 16-bit integers or floats.
    shape : tuple of int
        As in the file, the fastest dimension first; () is one value.
    offset : int
        Where its values begin, in bytes from the beginning of the file.
    data : bytes
        The values.
    """

    kind: int
    shape: tuple[int, ...]
    offset: int
    data: bytes


@dataclass(frozen=True, slots=True)
class C3dLayout:
    """What a C3D file says of itself, checked against its size.

    Parameters
    ----------
    path : Path
        The file.
    processor : {"Intel", "DEC", "SGI"}
        Whose numbers it holds.
    parameters : mapping of str to Parameter
        By ``GROUP:NAME``, in capitals.
    points : int
        Points a frame.
    analogue : int
        Analogue values a frame.
    frames : int
        Frames of points.
    first_frame : int
        The number that the file gives to its first frame.
    scale : float
        File units of one step where points are integers; negative where they are floats.
    data_start : int
        Where the frames begin, in bytes from the beginning of the file.
    rate : float
        Frames a second as the header says.
    """

    path: Path
    processor: str
    parameters: Mapping[str, Parameter]
    points: int
    analogue: int
    frames: int
    first_frame: int
    scale: float
    data_start: int
    rate: float

    @property
    def value_size(self) -> int:
        """Bytes of one value of a frame."""
        return 4 if self.scale < 0 else 2

    @property
    def frame_size(self) -> int:
        """Bytes of one frame, points and analogue values."""
        return self.value_size * (4 * self.points + self.analogue)

    def text(self, name: str) -> tuple[str, ...]:
        """Return a parameter's texts without their padding; none where it holds no letters."""
        parameter = self.parameters.get(name)
        if parameter is None or parameter.kind != -1:
            return ()
        width = parameter.shape[0] if parameter.shape else 1
        data = parameter.data
        parts = [data[i : i + width] for i in range(0, len(data), width)] if width else []
        return tuple(decoded(part.split(b"\0")[0].strip()) for part in parts)

    def numbers(self, name: str) -> FloatArray:
        """Return a parameter's numbers, integers unsigned; none where it holds no numbers."""
        parameter = self.parameters.get(name)
        if parameter is None or parameter.kind == -1:
            return np.empty(0)
        if parameter.kind == 4:
            return floats_of(parameter.data, self.processor)
        kind = np.dtype(np.uint8 if parameter.kind == 1 else np.uint16)
        kind = kind.newbyteorder(">" if self.processor == "SGI" else "<")
        return np.frombuffer(parameter.data, dtype=kind).astype(np.float64)


def floats_of(data: bytes, processor: str) -> FloatArray:
    """Read the floats of a processor.

    Parameters
    ----------
    data : bytes
        Four a float.
    processor : {"Intel", "DEC", "SGI"}
        Whose floats they are.

    Returns
    -------
    ndarray of float64, shape (N,)
        NaN or infinite where DEC has no value.
    """
    if processor != "DEC":
        kind = ">f4" if processor == "SGI" else "<f4"
        return np.frombuffer(data, dtype=kind).astype(np.float64)
    # a VAX float is an IEEE one with its halves exchanged and an exponent that is larger by 2
    halves = np.frombuffer(data, dtype="<u2").reshape(-1, 2)
    bits = (halves[:, 0].astype(np.uint32) << np.uint32(16)) | halves[:, 1]
    with np.errstate(invalid="ignore"):
        values: FloatArray = bits.view(np.float32).astype(np.float64) / 4
    exponent = bits & np.uint32(0x7F800000)
    values[exponent == 0] = np.where(bits[exponent == 0] >> 31, np.nan, 0.0)
    return values


def read_layout(path: Path, data: bytes) -> C3dLayout:
    """Read header and parameters of a C3D file and check them against its size.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : bytes
        All of it.

    Returns
    -------
    C3dLayout

    Raises
    ------
    FormatError
        If it is no C3D file, is cut off, or if its numbers don't fit together.
    """
    where = place(path)
    if not data:
        raise FormatError(f"{where}: not a C3D file: it is empty")
    if len(data) < 2 * BLOCK or data[1] != MAGIC:
        raise FormatError(f"{where}: not a C3D file: it has no C3D header")
    start = (data[0] - 1) * BLOCK
    if data[0] < 2 or start + 4 > len(data):
        raise FormatError(
            f"{where}: its parameters should begin in block {data[0]}, "
            f"the file has {len(data) // BLOCK} blocks of 512 bytes; is it cut off?"
        )
    processor = PROCESSORS.get(data[start + 3])
    if processor is None:
        raise FormatError(
            f"{where}: unknown processor {data[start + 3]}, expected 84 (Intel), 85 (DEC) or "
            "86 (SGI); is the file damaged?"
        )
    big = ">" if processor == "SGI" else "<"
    words = np.frombuffer(data, dtype=f"{big}u2", count=BLOCK // 2).astype(np.int64)
    data_start = int(words[8] - 1) * BLOCK
    # whether a record of length 0 ends the parameters or not, the frames certainly do
    end = data_start if start < data_start < len(data) else len(data)
    parameters = dict(_parameters(where, data[:end], start + 4, big == ">"))
    layout = C3dLayout(
        path=path,
        processor=processor,
        parameters=parameters,
        points=int(words[1]),
        analogue=int(words[2]),
        frames=max(int(words[4] - words[3]) + 1, 0),
        first_frame=int(words[3]),
        scale=float(floats_of(data[12:16], processor)[0]),
        data_start=data_start,
        rate=float(floats_of(data[20:24], processor)[0]),
    )
    return _checked(layout, start, len(data))


def _parameters(where: str, data: bytes, at: int, big: bool) -> Iterator[tuple[str, Parameter]]:
    """Yield all parameters; groups may come after the parameters that belong to them."""
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Parameter]] = []
    for _ in range(MOST_PARAMETERS):
        if at + 2 > len(data) or data[at] == 0:
            break
        length, group = abs(_signed(data[at])), _signed(data[at + 1])
        after = at + 2 + length
        step = data[after : after + 2]
        if len(step) < 2:
            raise FormatError(f"{where}: ends within its parameters; is the file cut off?")
        name = decoded(data[at + 2 : after].upper().strip())
        if group < 0:
            groups[-group] = name
        elif group > 0:
            found.append((group, name, _parameter(where, name, data, after + 2, big)))
        offset = int.from_bytes(step, "big" if big else "little")
        if offset == 0:
            break
        at = after + offset
        if group > 0 and found[-1][2].offset + len(found[-1][2].data) > at:
            raise FormatError(
                f"{where}: parameter {shown(name)} runs into the next one; is the file damaged?"
            )
    else:
        raise FormatError(f"{where}: more than {MOST_PARAMETERS} parameters; is it damaged?")
    for group, name, parameter in found:
        yield f"{groups.get(group, '')}:{name}", parameter


def _parameter(where: str, name: str, data: bytes, at: int, big: bool) -> Parameter:
    head = data[at : at + 2]
    shape = tuple(data[at + 2 : at + 2 + head[1]]) if len(head) == 2 else ()
    kind = _signed(head[0]) if len(head) == 2 else 0
    size = SIZES.get(kind)
    if size is None or len(shape) < head[1]:
        raise FormatError(
            f"{where}: parameter {shown(name)} is of no known type; is the file damaged?"
        )
    begin = at + 2 + len(shape)
    for count in shape:
        size *= count  # Python's integers don't overflow
    if begin + size > len(data):
        raise FormatError(
            f"{where}: parameter {shown(name)} is larger than the file; is it damaged?"
        )
    return Parameter(kind, shape, begin, data[begin : begin + size])


def _signed(byte: int) -> int:
    return byte - 256 if byte > 127 else byte


def _checked(layout: C3dLayout, parameters: int, size: int) -> C3dLayout:
    where = place(layout.path)
    used = layout.numbers("POINT:USED")
    if len(used) and used[0] != layout.points:
        raise FormatError(
            f"{where}: its header says {layout.points} points, POINT:USED says {used[0]:g}; "
            "is the file damaged?"
        )
    if not layout.points:
        raise FormatError(f"{where}: has no points, so there is no motion in it")
    if not np.isfinite(layout.scale) or layout.scale == 0:
        raise FormatError(f"{where}: its scale is {layout.scale:g}; is the file damaged?")
    if not BLOCK <= layout.data_start <= size:
        raise FormatError(
            f"{where}: its data should begin at byte {layout.data_start}, the file has {size}; "
            "is it cut off?"
        )
    if layout.data_start <= parameters:
        raise FormatError(
            f"{where}: its data should begin at byte {layout.data_start}, its parameters at "
            f"{parameters}; is the file damaged?"
        )
    frames = _frames(layout)
    room = (size - layout.data_start) // layout.frame_size
    if frames > room:
        raise FormatError(
            f"{where}: says {frames} frames of {layout.points} points, has {room}; is it cut off?"
        )
    if frames < 1:
        raise FormatError(f"{where}: says {frames} frames; there is no motion in the file")
    return replace(layout, frames=frames)


def _frames(layout: C3dLayout) -> int:
    """Return the number of frames; the header counts to 65535 only."""
    last = layout.first_frame + layout.frames - 1
    counted = layout.numbers("POINT:FRAMES")
    if (layout.frames and last < MOST_COUNTED) or not len(counted):
        return layout.frames
    ends = [layout.numbers(f"TRIAL:ACTUAL_{which}_FIELD") for which in ("START", "END")]
    if all(len(words) == 2 for words in ends):
        first, last = (int(low) + (int(high) << 16) for low, high in ends)
        return last - first + 1
    long = layout.numbers("POINT:LONG_FRAMES")
    frames = (long if len(long) else counted)[0]
    return int(frames) if np.isfinite(frames) and 0 <= frames < 1e12 else 0
