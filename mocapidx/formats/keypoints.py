"""Key points of people in three dimensions as JSON: a list of frames, each a list of points."""

import json
import re
from pathlib import Path
from typing import Any, Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.c3d import named_apart
from mocapidx.formats.positions import RATE_KEYS
from mocapidx.formats.rates import EXPECTED, is_rate
from mocapidx.formats.text import Limits, place, read_text
from mocapidx.model import FloatArray, PointRecording
from mocapidx.printable import shown

__all__ = ["BODY_25", "COCO_17", "is_keypoint_file", "read_keypoints"]

COCO_17: Final = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder",
    "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee",
    "right_knee", "left_ankle", "right_ankle",
)  # fmt: skip
BODY_25: Final = (
    "Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist", "MidHip",
    "RHip", "RKnee", "RAnkle", "LHip", "LKnee", "LAnkle", "REye", "LEye", "REar", "LEar",
    "LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel",
)  # fmt: skip
SETS: Final = {len(names): names for names in (COCO_17, BODY_25)}
POINT_KEYS: Final = ("pose_keypoints_3d", "keypoints_3d", "keypoints", "positions")
NAME_KEYS: Final = ("joints", "keypoint_names", "names")
LARGEST: Final = 256 << 20  # bytes: what is read becomes ten times as large
PEEKED: Final = 1 << 16  # bytes
SEQUENCE: Final = re.compile(rb"\s*\[\s*(\{|\[\s*\[)")
FRAMES: Final = re.compile(rb'"frames"\s*:\s*\[\s*(\{|\[)')


def is_keypoint_file(path: Path) -> bool:
    """Tell by its beginning whether a JSON file may hold key points.

    Parameters
    ----------
    path : Path

    Returns
    -------
    bool
    """
    try:
        with path.open("rb") as file:
            beginning = file.read(PEEKED)
    except (OSError, ValueError):
        return False
    begins = SEQUENCE.match(beginning) or FRAMES.search(beginning)
    if begins is None:
        return False  # one frame, as OpenPose writes them, is no motion either
    return begins[1] != b"{" or any(f'"{key}"'.encode() in beginning for key in POINT_KEYS)


def read_keypoints(path: Path, limits: Limits) -> PointRecording:
    """Read a sequence of key points.

    Parameters
    ----------
    path : Path
        JSON: a list of frames, or an object with `frames`, maybe `rate` (or `fps`) and `joints`.
        A frame is a list of points (x, y, z, maybe a confidence), a flat list of their numbers,
        or an object that has one under `keypoints`, `keypoints_3d`, `pose_keypoints_3d` or, of
        the first person, under `people`.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    PointRecording
        Without `joints`, 17 points are those of COCO and 25 those of BODY_25. A point is not
        seen where it is null, its confidence is 0 or its numbers are not finite.

    Raises
    ------
    FormatError
        If it is no such file.
    """
    where = place(path)
    table = _parsed(where, read_text(path, limits))
    head = table if isinstance(table, dict) else {}
    frames = head.get("frames") if "frames" in head else table
    if not isinstance(frames, list) or not frames:
        single = " (a file for each frame? join them into one list)" if _points_of(head) else ""
        raise FormatError(f"{where}: has no list of frames{single}")
    limits.check_frames(len(frames), path)
    names = _names(where, head)
    rows = [_numbers(where, frame, row) for frame, row in enumerate(map(_points_of, frames))]
    sizes = {len(row) for row in rows if row}
    count, width = _shape(where, sizes, names)
    limits.check_joints(count, path, None)
    values = np.full((len(rows), count * width), np.nan)
    for frame, row in enumerate(rows):
        if row:
            values[frame] = row
    points = values.reshape(len(rows), count, width)
    positions: FloatArray = points[:, :, :3].copy()
    unseen = ~np.isfinite(positions).all(axis=2)
    if width == 4:
        unseen |= ~(points[:, :, 3] > 0)
    positions[unseen] = np.nan
    return PointRecording(
        named_apart(list(names or SETS[count])), positions, _rate(where, head), None
    )


def _parsed(where: str, data: bytes) -> Any:
    if len(data) > LARGEST:
        raise FormatError(f"{where}: larger than {LARGEST >> 20} MiB; write npz instead of JSON")
    try:
        return json.loads(data)
    except RecursionError as exc:
        raise FormatError(f"{where}: nested too deeply") from exc
    except ValueError as exc:
        what = str(exc).partition(";")[0]  # behind it stands advice for programmers
        raise FormatError(f"{where}: not JSON: {shown(what, 100)}") from exc


def _points_of(frame: Any) -> Any:
    """Return what a frame says of its points; None where nobody is in it."""
    if isinstance(frame, dict) and isinstance(frame.get("people"), list):
        frame = frame["people"][0] if frame["people"] else None
    if isinstance(frame, dict):
        return next((frame[key] for key in POINT_KEYS if key in frame), None)
    return frame


def _numbers(where: str, frame: int, points: Any) -> list[float]:
    """Return the numbers of a frame, one after the other; none where nobody is in it."""
    if points is None:
        return []
    if not isinstance(points, list):
        raise FormatError(f"{where}: frame {frame} is no list of points")
    if all(point is None for point in points):
        return []
    width = max((len(point) for point in points if isinstance(point, list)), default=0)
    flat: list[Any] = []
    for point in points:
        if point is None and width:
            flat += [None] * width
        elif isinstance(point, list) and len(point) == width:
            flat += point
        elif width:
            raise FormatError(f"{where}: frame {frame}: points of different numbers of values")
        else:
            flat.append(point)
    numbers = []
    for value in flat:
        if value is None:
            numbers.append(np.nan)
        elif isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300:
            numbers.append(float(value))
        elif isinstance(value, float):
            numbers.append(np.nan)
        else:
            raise FormatError(f"{where}: frame {frame}: {shown(value, 40)}, expected a number")
    return numbers


def _names(where: str, head: dict[str, Any]) -> tuple[str, ...] | None:
    for key in NAME_KEYS:
        if key in head:
            names = head[key]
            if not isinstance(names, list) or not all(isinstance(n, str) and n for n in names):
                raise FormatError(f"{where}: '{key}' is no list of names")
            return tuple(names)
    return None


def _shape(where: str, sizes: set[int], names: tuple[str, ...] | None) -> tuple[int, int]:
    """Return how many points there are and how many numbers each has."""
    if len(sizes) == 1:
        size = next(iter(sizes))
        for width in (3, 4):
            count = size // width
            if size and size % width == 0 and (len(names) == count if names else count in SETS):
                return count, width
    if not sizes:
        raise FormatError(f"{where}: nobody is in any frame")
    found = " and ".join(str(size) for size in sorted(sizes)[:3])
    expected = f"the {len(names)} joints" if names else "17 (COCO) or 25 (BODY_25) points"
    raise FormatError(
        f"{where}: frames of {found} numbers, expected 3 or 4 for each of {expected}; "
        "two-dimensional key points are not read"
    )


def _rate(where: str, head: dict[str, Any]) -> float | None:
    for key in RATE_KEYS:
        if key in head:
            rate = head[key]
            if isinstance(rate, bool) or not isinstance(rate, int | float):
                rate = 0
            if not is_rate(rate):
                raise FormatError(
                    f"{where}: '{key}' is {shown(head[key], 40)}, "
                    f"expected frames a second {EXPECTED}"
                )
            return float(rate)
    return None
