"""Clips out of motion files: as the file has them, as another format, or as positions."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

from mocapidx.errors import FormatError
from mocapidx.formats.slice_c3d import C3dFrames, c3d_frames
from mocapidx.formats.slice_text import TextFrames, amc_frames, bvh_frames, with_rate
from mocapidx.formats.text import Limits, read_text
from mocapidx.formats.write_bvh import bvh_text
from mocapidx.formats.write_positions import positions_csv, positions_npz
from mocapidx.model import Motion, Recording, Up
from mocapidx.printable import shown
from mocapidx.skeleton.kinematics import RootPositions
from mocapidx.skeleton.rigs import as_joints
from mocapidx.skeleton.solve import CENTIMETRE, solved_rig
from mocapidx.tasks.origins import Origin
from mocapidx.tasks.read import Reading, read_any

__all__ = ["Clip", "ClipFormat", "ClipSource", "open_source"]

ClipFormat: TypeAlias = Literal["source", "bvh", "npz", "csv"]
Cut: TypeAlias = Callable[[int, int], "Clip"]

KEPT: Final = "the source's own values"
TURNED: Final = "the source's rotations, in frames of joints"
SOLVED: Final = "rotations solved from positions"
POSITIONS: Final = "positions of the 24 joints"


@dataclass(frozen=True, slots=True)
class Clip:
    """A stretch of a motion file as files of its own.

    Parameters
    ----------
    files : tuple of (str, bytes)
        Suffix and content, the motion first; with an AMC goes its ASF.
    holds : str
        For people: what is in it.
    unit : float
        Metres in one unit of it.
    up : {"x", "y", "z", "-x", "-y", "-z"}
        Its axis that points up.
    root_positions : {"add", "replace"} or None
        Whether position channels add to a joint's OFFSET or replace it.
    """

    files: tuple[tuple[str, bytes], ...]
    holds: str
    unit: float
    up: Up
    root_positions: RootPositions | None = None


@dataclass(frozen=True, slots=True)
class ClipSource:
    """A motion file to cut clips from.

    Parameters
    ----------
    origin : Origin
    reading : Reading
        The take as it was read.
    cut : callable
        Takes start and end in frames of the file, from 0, end exclusive; gives a `Clip`.
    """

    origin: Origin
    reading: Reading
    cut: Cut


def open_source(origin: Origin, to: ClipFormat) -> ClipSource:
    """Read a motion file to cut clips from.

    Parameters
    ----------
    origin : Origin
    to : {"source", "bvh", "npz", "csv"}
        Format of the clips. ``source``: AMC, BVH and C3D as they are, others as npz.

    Returns
    -------
    ClipSource

    Raises
    ------
    FormatError
        If the file can't be used.
    """
    reading, recording, _ = read_any(origin.path, origin.options)
    suffix, limits = origin.path.suffix.lower(), origin.options.limits
    cut: Cut
    if suffix == ".bvh" and to in ("source", "bvh"):
        cut = _as_it_is(suffix, reading, bvh_frames(origin.path, limits))
    elif suffix == ".amc" and to == "source":
        cut = _with_skeleton(origin, reading, limits)
    elif suffix == ".c3d" and to == "source":
        cut = _as_it_is(suffix, reading, c3d_frames(origin.path, limits))
    elif to == "bvh" and isinstance(recording, Recording):
        cut = _as_joints(reading, as_joints(recording))
    elif to == "bvh":
        cut = _solved(reading)
    else:
        cut = _positions(reading, to)
    return ClipSource(origin, reading, cut)


def _as_it_is(suffix: str, reading: Reading, frames: TextFrames | C3dFrames) -> Cut:
    _check_frames(reading, frames)
    return lambda start, end: _as_read(reading, ((suffix, frames.cut(start, end)),), KEPT)


def _as_read(reading: Reading, files: tuple[tuple[str, bytes], ...], holds: str) -> Clip:
    found = reading.conventions
    return Clip(files, holds, found.unit, found.up, found.root_positions)


def _check_frames(reading: Reading, frames: TextFrames | C3dFrames) -> None:
    """See to it that a frame is the same one to the reader and to the scissors."""
    if len(frames) != reading.source_frames:
        raise FormatError(
            f"{shown(reading.sources[0], None)}: has {reading.source_frames} frames, of which "
            f"{len(frames)} can be told apart; export it as bvh, npz or csv"
        )


def _with_skeleton(origin: Origin, reading: Reading, limits: Limits) -> Cut:
    skeleton = read_text(reading.sources[1], limits)
    frames = amc_frames(origin.path, limits)
    _check_frames(reading, frames)

    def cut(start: int, end: int) -> Clip:
        text = frames.cut(start, end)
        if reading.rate_origin != "file":  # the clip's name doesn't tell it any more
            text = with_rate(text, reading.motion.rate)
        return _as_read(reading, ((".amc", text), (".asf", skeleton)), KEPT)

    return cut


def _as_joints(reading: Reading, recording: Recording) -> Cut:
    def cut(start: int, end: int) -> Clip:
        part = replace(recording, values=recording.values[start:end])
        return _as_read(reading, ((".bvh", bvh_text(part, reading.motion.rate)),), TURNED)

    return cut


def _solved(reading: Reading) -> Cut:
    def cut(start: int, end: int) -> Clip:
        rig = solved_rig(_part(reading, start, end))
        return Clip(((".bvh", bvh_text(rig)),), SOLVED, CENTIMETRE, "y")

    return cut


def _positions(reading: Reading, to: ClipFormat) -> Cut:
    suffix, write = (".csv", positions_csv) if to == "csv" else (".npz", positions_npz)

    def cut(start: int, end: int) -> Clip:
        return Clip(((suffix, write(_part(reading, start, end))),), POSITIONS, 1.0, "y")

    return cut


def _part(reading: Reading, start: int, end: int) -> Motion:
    first = reading.source_start
    if not first <= start < end <= first + len(reading.motion.positions):
        raise FormatError(f"no frames from {start} to {end}")
    return replace(reading.motion, positions=reading.motion.positions[start - first : end - first])
