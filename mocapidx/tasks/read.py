"""Read a take: from a motion file to the 24 canonical joints, in metres, Y up."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.registry import is_motion_file, read_recording, sources_of
from mocapidx.formats.text import Limits, place
from mocapidx.model import FloatArray, Motion, PointRecording, Recording
from mocapidx.skeleton.canonical import canonical_positions, canonical_rest, made_joints
from mocapidx.skeleton.conventions import Conventions, detect_conventions
from mocapidx.skeleton.jointmap import Mapping24, choose_map, load_joint_map
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.skeleton.resample import kept_frames
from mocapidx.skeleton.rotations import upright
from mocapidx.tasks.reading import RateOrigin, Reading, ReadOptions

if TYPE_CHECKING:
    from mocapidx.skeleton.markers import PointMapping

__all__ = [
    "Limits",
    "ReadOptions",
    "Reading",
    "is_motion_file",
    "read_any",
    "read_motion",
    "read_recorded",
    "read_take",
]

ASSUMED_RATE: Final = 120.0  # Hz: CMU's and HDM05's
# Takes are numbered in the same place (13_29), so only rates that cameras have count.
SLOW_RATE, SLOW_HOURS = 7.5, 0.5  # a quarter of a store's usual rate
RATE_IN_NAME: Final = re.compile(r"_(100|120|150|180|200|240|250|300|360|400|480|500)\Z")


def read_take(path: Path, options: ReadOptions | None = None, rate: float | None = None) -> Reading:
    """Read a motion file.

    Parameters
    ----------
    path : Path
        A motion file of any kind.
    options : ReadOptions, optional
        What the user says about it.
    rate : float, optional
        Frames a second that will be looked at, in Hz: where they are all frames of the file,
        only these are computed and the motion has this rate. Else it has the source rate.

    Returns
    -------
    Reading
        The motion, and how it was come by.

    Raises
    ------
    FormatError
        If the file can't be used; the message says where in it and why.
    FeatureSetError
        If the user's joint map is none.
    """
    return read_any(path, options or ReadOptions(), rate)[0]


def read_motion(path: str | Path, **options: Any) -> Motion:
    """Read a motion file as joint positions.

    Parameters
    ----------
    path : str or Path
        A motion file of any kind.
    **options
        The fields of `ReadOptions`, for instance ``source_rate=60``.

    Returns
    -------
    Motion
        The 24 canonical joints at the source rate, in metres, Y up.

    Raises
    ------
    FormatError
        If the file can't be used.
    ParameterError
        If an option is out of its range.
    """
    return read_take(Path(path), ReadOptions(**options)).motion


def read_any(
    path: Path, options: ReadOptions, rate: float | None = None
) -> "tuple[Reading, Recording | PointRecording, Mapping24 | PointMapping]":
    """Read a motion file and keep what it holds.

    Parameters
    ----------
    path : Path
        A motion file of any kind.
    options : ReadOptions
        What the user says about it.
    rate : float, optional
        As for `read_take`.

    Returns
    -------
    reading : Reading
    recording : Recording or PointRecording
        The file as it stands; `Reading.source_start` says where the motion begins in it.
    mapping : Mapping24 or PointMapping
        Which of its nodes is which canonical joint, or how joints follow from its points.

    Raises
    ------
    FormatError
        If the file can't be used.
    FeatureSetError
        If the user's joint map is none.
    """
    sources = sources_of(path, options.skeleton)
    recording = read_recording(
        path, skeleton_path=sources[1] if len(sources) > 1 else None, limits=options.limits
    )
    if isinstance(recording, PointRecording):
        return _from_points(path, recording, options)
    return _from_channels(path, sources, recording, options, rate)


def read_recorded(path: Path, options: ReadOptions) -> tuple[Reading, Recording, Mapping24]:
    """Read a motion file that has a skeleton, and keep its channels too.

    Parameters
    ----------
    path : Path
        A motion file such as AMC or BVH.
    options : ReadOptions
        What the user says about it.

    Returns
    -------
    reading : Reading
    recording : Recording
        The file as it stands; `Reading.source_start` says where the motion begins in it.
    mapping : Mapping24
        Which of its nodes is which canonical joint.

    Raises
    ------
    FormatError
        If the file can't be used, or holds points without a skeleton.
    FeatureSetError
        If the user's joint map is none.
    """
    reading, recording, mapping = read_any(path, options)
    if isinstance(recording, PointRecording) or not isinstance(mapping, Mapping24):
        raise FormatError(f"{place(path)}: holds points, expected a skeleton that channels move")
    return reading, recording, mapping


def _from_channels(
    path: Path,
    sources: tuple[Path, ...],
    recording: Recording,
    options: ReadOptions,
    wanted_rate: float | None,
) -> tuple[Reading, Recording, Mapping24]:
    joint_map = None if options.joint_map is None else load_joint_map(options.joint_map)
    mapping = choose_map(recording.skeleton, joint_map, place(sources[-1]))
    conventions = detect_conventions(recording, mapping, options.overrides())
    start = int(conventions.first_frame != "motion")
    rate, origin = _rate(path, recording.rate, options)
    frames = len(recording.values)
    _check_time(path, frames - start, rate)
    kept = None
    # a head's top that is made up depends on all frames
    if wanted_rate is not None and None not in made_joints(mapping).values():
        kept = kept_frames(frames - start, rate, wanted_rate)
    positions = canonical_positions(
        recording,
        mapping,
        conventions.root_positions or "add",
        slice(start, None) if kept is None else start + kept,
    )
    motion = Motion(
        joints=CANONICAL_JOINTS,
        positions=_in_metres(positions, conventions),
        rate=rate if kept is None or wanted_rate is None else wanted_rate,
        rest=_rest(recording, mapping, conventions),
        made=conventions.made,
    )
    reading = Reading(motion, conventions, sources, frames, start, rate, origin)
    return reading, recording, mapping


def _from_points(
    path: Path, recording: PointRecording, options: ReadOptions
) -> "tuple[Reading, PointRecording, PointMapping]":
    from mocapidx.skeleton.gaps import fill_gaps
    from mocapidx.skeleton.markermap import load_marker_map
    from mocapidx.skeleton.markers import choose_marker_map, marker_joints
    from mocapidx.skeleton.pointconventions import detect_point_conventions

    marker_map = None if options.joint_map is None else load_marker_map(options.joint_map)
    mapping = choose_marker_map(recording.names, marker_map, options.subject, place(path))
    rate, origin = _rate(path, recording.rate, options)
    used = recording.positions[:, mapping.used]
    if np.isnan(used).any(axis=2).all():
        raise FormatError(f"{place(path)}: none of the points that count is ever seen")
    conventions = detect_point_conventions(recording, mapping, options.overrides())
    start = int(conventions.first_frame != "motion")
    filled, gaps = fill_gaps(used, rate, options.fill_gaps)
    positions = recording.positions
    if filled is not used:
        positions = positions.copy()
        positions[:, mapping.used] = filled
    joints = marker_joints(mapping, positions[start:], conventions.unit)
    motion = Motion(CANONICAL_JOINTS, _in_metres(joints, conventions), rate, made=conventions.made)
    frames = len(positions)
    _check_time(path, frames - start, rate)
    return (
        Reading(motion, conventions, (path,), frames, start, rate, origin, gaps),
        recording,
        mapping,
    )


def _check_time(path: Path, frames: int, rate: float) -> None:
    """Refuse hours of hardly any frames, which a small file can claim and no camera makes."""
    hours = frames / rate / 3600
    if rate < SLOW_RATE and hours > SLOW_HOURS:
        raise FormatError(
            f"{place(path)}: {hours:.1f} hours of {rate:g} frames a second; expected at "
            f"least {SLOW_RATE:g} frames a second in takes of more than half an hour"
        )


def _in_metres(positions: FloatArray, conventions: Conventions) -> FloatArray:
    positions *= conventions.unit
    return positions if conventions.up == "y" else positions @ upright(conventions.up).T


def _rest(recording: Recording, mapping: Mapping24, conventions: Conventions) -> FloatArray | None:
    """Return the zero pose; BVH has none that can be trusted (bones may all lie along x)."""
    if recording.skeleton.turned_by != "own":
        return None
    return _in_metres(canonical_rest(recording, mapping), conventions)


def _rate(path: Path, stated: float | None, options: ReadOptions) -> tuple[float, RateOrigin]:
    is_amc = path.suffix.lower() == ".amc"
    if options.source_rate is not None and (is_amc or stated is None):
        return options.source_rate, "option"
    if stated is not None:
        return stated, "file"
    named = RATE_IN_NAME.search(path.stem)
    if named:
        return float(named[1]), "name"
    if is_amc:
        return ASSUMED_RATE, "assumed"
    raise FormatError(f"{place(path)}: does not say its frames a second; tell with --source-rate")
