"""TRC: marker trajectories as text, three columns a marker (Motion Analysis, OpenSim)."""

from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.c3d import UNITS, named_apart
from mocapidx.formats.cells import cells_of, number_table
from mocapidx.formats.numbers import parse_number
from mocapidx.formats.rates import EXPECTED, is_rate
from mocapidx.formats.text import Limits, decoded, place, read_text
from mocapidx.model import PointRecording
from mocapidx.printable import shown

__all__ = ["read_trc"]

MAGIC: Final = b"pathfiletype"
HEADER: Final = 5  # lines: file, keys, values, names, axes


def read_trc(path: Path, limits: Limits) -> PointRecording:
    """Read a TRC file.

    Parameters
    ----------
    path : Path
        The file; its cells stand between tabs or commas.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    PointRecording
        A cell that is empty or says NaN is a marker that was not seen. Rows are counted; where
        the header says another number, as it does in files that were cut by hand, a remark tells.

    Raises
    ------
    FormatError
        If the file is no TRC file, is cut off or exceeds a limit.
    """
    where = place(path)
    data = read_text(path, limits)
    lines = data.split(b"\n", HEADER)
    if not lines[0].lower().startswith(MAGIC):
        raise FormatError(f"{where}: not a TRC file: line 1 does not begin with PathFileType")
    if len(lines) <= HEADER:
        raise FormatError(f"{where}: ends within its header; is the file cut off?")
    header = _header(where, lines[1], lines[2])
    names = [decoded(cell) for cell in cells_of(lines[3])[2:] if cell]
    if not names:
        raise FormatError(f"{where}:4: names no markers")
    limits.check_joints(len(names), path, 4)
    said = _whole(header.get("nummarkers"), len(names))
    if said != len(names):
        raise FormatError(f"{where}:4: names {len(names)} markers, line 3 says {said}")
    values, numbered = number_table(lines[HEADER], 2 + 3 * len(names), where, HEADER + 1)
    limits.check_frames(len(values), path)
    if not len(values):
        raise FormatError(f"{where}: has no frames; there is no motion in the file")
    frames = _whole(header.get("numframes"), len(values))
    remark = f"its header says {frames} frames, it has {len(values)}: is it cut off?"
    jumps = np.flatnonzero(np.diff(values[:, 0]) != 1)
    if len(jumps):
        row = jumps[0] + 1
        raise FormatError(
            f"{where}:{numbered[row]}: frame {values[row, 0]:g} after {values[row - 1, 0]:g}, "
            "expected frame numbers to follow one another"
        )
    positions = values[:, 2:].reshape(len(values), -1, 3)
    positions[np.isnan(positions).any(axis=2)] = np.nan
    unit = UNITS.get(header.get("units", b"").decode("ascii", "replace").lower())
    return PointRecording(
        named_apart(names),
        positions,
        _rate(where, header),
        unit,
        remarks=() if frames == len(values) else (remark,),
    )


def _header(where: str, keys: bytes, values: bytes) -> dict[str, bytes]:
    names = [cell.decode("ascii", "replace").lower() for cell in cells_of(keys)]
    if "datarate" not in names:
        raise FormatError(f"{where}:2: expected DataRate and other keys")
    return dict(zip(names, cells_of(values), strict=False))


def _rate(where: str, header: dict[str, bytes]) -> float:
    rate = parse_number(header.get("datarate", b""))
    if not is_rate(rate):
        found = shown(decoded(header.get("datarate", b"")), 40)
        raise FormatError(f"{where}:3: DataRate is '{found}', expected frames a second {EXPECTED}")
    return rate


def _whole(cell: bytes | None, default: int) -> int:
    number = parse_number(cell or b"")
    return int(number) if 0 <= number < 1e15 and number == int(number) else default
