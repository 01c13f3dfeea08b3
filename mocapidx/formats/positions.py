"""Joint positions or markers as arrays and as tables: npz, npy with a list of joints, and CSV."""

import csv
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, cast, get_args

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import FormatError
from mocapidx.formats.arrays import as_numbers, as_texts, read_array
from mocapidx.formats.c3d import named_apart
from mocapidx.formats.cells import cells_of, number_table
from mocapidx.formats.numbers import parse_number
from mocapidx.formats.rates import EXPECTED, is_rate
from mocapidx.formats.text import Limits, decoded, place, read_text
from mocapidx.model import FloatArray, PointRecording, Up
from mocapidx.printable import shown

__all__ = [
    "POSITION_KEYS",
    "RATE_KEYS",
    "find_joint_list",
    "is_position_table",
    "joints_from_arrays",
    "read_csv",
    "read_npy",
    "stated_rate",
]

RATE_KEYS: Final = (
    "rate", "sampling_rate", "mocap_framerate", "mocap_frame_rate", "frame_rate", "fps",
)  # fmt: skip
POSITION_KEYS: Final = ("positions", "joints", "made", "unit", "up")
AXIS: Final = re.compile(r"(.+?)[._ :]([xyz])\Z", re.IGNORECASE)
LONG: Final = ("frame", "joint", "x", "y", "z")
TIMES: Final = ("time", "time_s", "t", "seconds")
COUNTERS: Final = ("frame", "index", "")
EVEN: Final = 0.01  # how far times may be from even ones, in frames
PEEKED: Final = 1 << 16  # bytes


def joints_from_arrays(
    path: Path, arrays: dict[str, NDArray[Any]], limits: Limits
) -> PointRecording:
    """Understand the arrays of an npz file as joint positions.

    Parameters
    ----------
    path : Path
        The file, for messages.
    arrays : dict of str to ndarray
        `positions` (T, J, 3), `joints` (J names), maybe a rate, `unit` (metres in one unit), `up`
        (the axis) and `made`: joints that were made up from others, which are left out, to be
        made again.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    PointRecording

    Raises
    ------
    FormatError
        If an array is missing or of another shape.
    """
    where = place(path)
    if "joints" not in arrays:
        raise FormatError(f"{where}: has positions, but no 'joints' that names them")
    names = as_texts(arrays["joints"], f"{where}: 'joints'")
    positions = as_numbers(arrays["positions"], f"{where}: 'positions'", (None, len(names), 3))
    made = as_texts(arrays["made"], f"{where}: 'made'") if "made" in arrays else ()
    rate = stated_rate(where, arrays)
    kept = [i for i, name in enumerate(names) if name not in made]
    points = _points(path, [names[i] for i in kept], positions[:, kept], rate, limits)
    return replace(points, unit=_stated_unit(where, arrays), up=_stated_up(where, arrays))


def _stated_unit(where: str, arrays: dict[str, NDArray[Any]]) -> float | None:
    if "unit" not in arrays:
        return None
    value = arrays["unit"]
    number = float(value.ravel()[0]) if value.size == 1 and value.dtype.kind in "fiu" else 0.0
    if not 1e-6 <= number <= 1e6:
        raise FormatError(f"{where}: 'unit' is {shown(value, 40)}, expected metres in one unit")
    return number


def _stated_up(where: str, arrays: dict[str, NDArray[Any]]) -> Up | None:
    value = arrays.get("up")
    if value is None:
        return None
    for axis in get_args(Up):
        if value.size == 1 and value.dtype.kind == "U" and value.ravel()[0] == axis:
            return cast(Up, axis)
    raise FormatError(f"{where}: 'up' is {shown(value, 40)}, expected an axis such as y or z")


def stated_rate(where: str, arrays: dict[str, NDArray[Any]]) -> float | None:
    """Return the frames a second that arrays state, None where they don't.

    Parameters
    ----------
    where : str
        The file, for messages.
    arrays : dict of str to ndarray

    Returns
    -------
    float or None

    Raises
    ------
    FormatError
        If what is there is no rate.
    """
    for key in RATE_KEYS:
        if key in arrays:
            value = arrays[key]
            number = float(value.ravel()[0]) if value.size == 1 and value.dtype.kind in "fiu" else 0
            if not is_rate(number):
                raise FormatError(
                    f"{where}: '{key}' is {shown(value, 40)}, expected frames a second {EXPECTED}"
                )
            return float(number)
    return None


def find_joint_list(path: Path) -> Path | None:
    """Find the list of joints that belongs to an npy file.

    Parameters
    ----------
    path : Path
        The npy file.

    Returns
    -------
    Path or None
        ``NAME.joints.txt``, or else ``joints.txt``, in its folder.
    """
    for name in (f"{path.stem}.joints.txt", "joints.txt"):
        if path.with_name(name).is_file():
            return path.with_name(name)
    return None


def read_npy(path: Path, joint_list: Path | None, limits: Limits) -> PointRecording:
    """Read joint positions from an npy file and a list of joints.

    Parameters
    ----------
    path : Path
        The npy file, (T, J, 3).
    joint_list : Path or None
        Names, one a line.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    PointRecording
        `rate` is None.

    Raises
    ------
    FormatError
        If the two do not fit together.
    """
    where = place(path)
    if joint_list is None:
        raise FormatError(
            f"{where}: expects the names of its joints, one a line, in "
            f"'{shown(path.stem)}.joints.txt' or 'joints.txt' beside it"
        )
    words = read_text(joint_list, limits).replace(b",", b"\n").split(b"\n")
    names = [decoded(word.strip()) for word in words if word.strip()]
    positions = as_numbers(read_array(path, limits), where, (None, len(names), 3))
    return _points(path, names, positions, None, limits)


def is_position_table(path: Path) -> bool:
    """Tell by its header whether a CSV file holds positions.

    Parameters
    ----------
    path : Path

    Returns
    -------
    bool
    """
    try:
        with path.open("rb") as file:
            header = file.read(PEEKED).split(b"\n", 1)[0]
    except (OSError, ValueError):
        return False
    return _layout(_header(header)) is not None


def read_csv(path: Path, limits: Limits) -> PointRecording:
    """Read a table of positions.

    Parameters
    ----------
    path : Path
        One row a frame, with columns such as ``lknee.x`` or ``lknee_x``, and maybe ``time`` in
        seconds; or one row a joint and frame: ``frame,joint,x,y,z``.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    PointRecording
        `rate` is None unless there are times.

    Raises
    ------
    FormatError
        If it is no such table.
    """
    where = place(path)
    data = read_text(path, limits)
    first, _, rest = data.partition(b"\n")
    header = _header(first)
    layout = _layout(header)
    if layout is None:
        raise FormatError(
            f"{where}:1: no table of positions: expected columns such as lknee.x,lknee.y,lknee.z, "
            "or frame,joint,x,y,z"
        )
    if layout == "long":
        names, positions, times = _long(where, header, rest, limits)
    else:
        names, positions, times = _wide(path, header, rest, limits)
    return _points(path, names, positions, _rate_of(where, times), limits)


def _header(line: bytes) -> list[str]:
    return [decoded(cell) for cell in cells_of(line.removeprefix(b"\xef\xbb\xbf"))]


def _layout(header: Sequence[str]) -> str | None:
    if {name.lower() for name in header} >= set(LONG):
        return "long"
    axes = [match for match in map(AXIS.match, header) if match]
    known = [n for n in header if AXIS.match(n) or n.lower() in (*TIMES, *COUNTERS)]
    return "wide" if len(axes) >= 3 and len(known) == len(header) else None


def _wide(
    path: Path, header: Sequence[str], rest: bytes, limits: Limits
) -> tuple[list[str], FloatArray, FloatArray | None]:
    where = place(path)
    columns: dict[str, dict[str, int]] = {}
    for column, title in enumerate(header):
        match = AXIS.match(title)
        if match is not None:
            axes = columns.setdefault(match[1], {})
            if match[2].lower() in axes:
                raise FormatError(f"{where}:1: column '{shown(title)}' stands twice")
            axes[match[2].lower()] = column
    for name, axes in columns.items():
        if len(axes) != 3:
            missing = min(set("xyz") - axes.keys())
            raise FormatError(f"{where}:1: '{shown(name)}' has no column for {missing}")
    limits.check_joints(len(columns), path, 1)
    values, _ = number_table(rest, len(header), where, 2)
    order = [[axes[axis] for axis in "xyz"] for axes in columns.values()]
    timed = [i for i, title in enumerate(header) if title.lower() in TIMES]
    return list(columns), values[:, order], values[:, timed[0]] if timed else None


def _long(
    where: str, header: Sequence[str], rest: bytes, limits: Limits
) -> tuple[list[str], FloatArray, FloatArray | None]:
    place_of = {name.lower(): column for column, name in enumerate(header)}
    lines = rest.decode("utf-8", "surrogateescape").split("\n")
    delimiter = "\t" if any("\t" in line for line in lines[:1]) else ","
    delimiter = ";" if any(";" in line for line in lines[:1]) else delimiter
    joints: dict[str, int] = {}
    rows: list[tuple[int, int, float, float, float]] = []
    try:
        for number, cells in enumerate(csv.reader(lines, delimiter=delimiter), start=2):
            if not any(cells):
                continue
            frame, joint, *point = (cells[place_of[key]].strip() for key in LONG)
            if not re.fullmatch(r"[0-9]{1,9}", frame) or not joint:
                raise FormatError(
                    f"{where}:{number}: frame '{shown(frame, 40)}' of joint '{shown(joint, 40)}', "
                    "expected a number from 0 and a name"
                )
            x, y, z = (_coordinate(where, number, cell) for cell in point)
            rows.append((int(frame), joints.setdefault(joint, len(joints)), x, y, z))
    except IndexError as exc:
        raise FormatError(f"{where}:{number}: has fewer cells than line 1") from exc
    except csv.Error as exc:
        raise FormatError(f"{where}: no CSV: {exc}") from exc
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    frames, owners = table[:, 0].astype(np.int64), table[:, 1].astype(np.int64)
    if len(frames):
        frames -= frames.min()  # a part of a take may count on
    count = int(frames.max(initial=-1)) + 1
    if count * len(joints) > 4 * len(rows) + 100:
        raise FormatError(f"{where}: most joints are missing in most of its {count} frames")
    positions = np.full((count, len(joints), 3), np.nan)
    if len(np.unique(frames * len(joints) + owners)) < len(rows):
        raise FormatError(f"{where}: a joint stands twice in a frame")
    positions[frames, owners] = table[:, 2:]
    return list(joints), positions, None


def _coordinate(where: str, line: int, cell: str) -> float:
    if not cell or cell.lower() == "nan":
        return np.nan
    number = parse_number(cell.encode("utf-8", "surrogateescape"))
    if np.isnan(number):
        raise FormatError(f"{where}:{line}: '{shown(cell, 40)}', expected a number")
    return number


def _rate_of(where: str, times: FloatArray | None) -> float | None:
    """Return the frames a second that even times tell; a whole number where it is nearly one."""
    if times is None or len(times) < 2:
        return None
    step = float(times[-1] - times[0]) / (len(times) - 1)
    even = times[0] + step * np.arange(len(times))
    if not (step > 0 and (np.abs(times - even) <= max(EVEN * step, 0.0006)).all()):
        raise FormatError(f"{where}: its times are not even, expected one frame after another")
    rate = 1 / step
    if not is_rate(rate):
        raise FormatError(f"{where}: its times tell {rate:.4g} frames a second, expected seconds")
    return float(round(rate)) if abs(rate - round(rate)) < 0.001 * rate else rate


def _points(
    path: Path, names: Sequence[str], positions: FloatArray, rate: float | None, limits: Limits
) -> PointRecording:
    limits.check_joints(len(names), path, None)
    limits.check_frames(len(positions), path)
    if not positions.size:
        raise FormatError(f"{place(path)}: has no positions; there is no motion in the file")
    positions = np.array(positions, dtype=np.float64)
    positions[~np.isfinite(positions).all(axis=2)] = np.nan
    return PointRecording(named_apart(list(names)), positions, rate, None)
