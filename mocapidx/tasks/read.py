"""Read a take: from a motion file to the 24 canonical joints, in metres, Y up."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from mocapidx.errors import FormatError, ParameterError
from mocapidx.formats.registry import is_motion_file, read_recording, sources_of
from mocapidx.formats.text import Limits, place
from mocapidx.model import FloatArray, Motion, Recording
from mocapidx.skeleton.canonical import canonical_positions, canonical_rest
from mocapidx.skeleton.conventions import Conventions, Overrides, detect_conventions
from mocapidx.skeleton.jointmap import JointMap, Mapping24, choose_map, load_joint_map
from mocapidx.skeleton.joints import CANONICAL_JOINTS, PARENTS
from mocapidx.skeleton.kinematics import RootPositions
from mocapidx.skeleton.rotations import Up, upright

__all__ = [
    "Limits",
    "NodeRow",
    "ReadOptions",
    "Reading",
    "SegmentRow",
    "SkeletonReport",
    "is_motion_file",
    "read_motion",
    "read_take",
    "skeleton_report",
]

RateOrigin = Literal["option", "file", "name", "assumed"]

ASSUMED_RATE: Final = 120.0  # Hz: CMU's and HDM05's
# Takes are numbered in the same place (13_29), so only rates that cameras have count.
SLOW_RATE, SLOW_HOURS = 7.5, 0.5  # a quarter of a store's usual rate
RATE_IN_NAME: Final = re.compile(r"_(100|120|150|180|200|240|250|300|360|400|480|500)\Z")


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What the user says about files; None: find out.

    Parameters
    ----------
    skeleton : Path or None
        The ASF of AMC files.
    source_rate : float or None
        Frames a second of AMC files, in Hz; a BVH file states its own.
    joint_map : Path or None
        A joint map in TOML.
    unit : float or None
        Metres in one file unit.
    up : {"x", "y", "z", "-x", "-y", "-z"} or None
        The axis that points up.
    root_positions : {"add", "replace"} or None
        Whether BVH position channels add to a joint's OFFSET or replace it.
    keep_first_frame : bool or None
        True: frame 0 is motion; False: it is a pose to drop.
    limits : Limits
        What is refused as too large.

    Raises
    ------
    ParameterError
        If a value is out of its range.
    """

    skeleton: Path | None = None
    source_rate: float | None = None
    joint_map: Path | None = None
    unit: float | None = None
    up: Up | None = None
    root_positions: RootPositions | None = None
    keep_first_frame: bool | None = None
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if self.source_rate is not None and not 0.1 <= self.source_rate <= 10_000:
            raise ParameterError(
                f"source rate must be between 0.1 and 10000 Hz, got {self.source_rate}"
            )
        self.overrides()

    def overrides(self) -> Overrides:
        """Return the part that detection heeds."""
        return Overrides(self.unit, self.up, self.root_positions, self.keep_first_frame)


@dataclass(frozen=True, slots=True)
class Reading:
    """A take as it was read.

    Parameters
    ----------
    motion : Motion
        The 24 canonical joints in their order, at the source rate.
    conventions : Conventions
        How the file was read, and why so.
    sources : tuple of Path
        The files read, the motion file first.
    source_frames : int
        Frames in the file.
    source_start : int
        The frame of the file that frame 0 of `motion` is: 1 after a dropped T-pose.
    rate_origin : {"option", "file", "name", "assumed"}
        Where the source rate comes from.
    """

    motion: Motion
    conventions: Conventions
    sources: tuple[Path, ...]
    source_frames: int
    source_start: int
    rate_origin: RateOrigin


def read_take(path: Path, options: ReadOptions | None = None) -> Reading:
    """Read a motion file.

    Parameters
    ----------
    path : Path
        An AMC or a BVH file.
    options : ReadOptions, optional
        What the user says about it.

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
    return _read(path, options or ReadOptions())[0]


def _read(path: Path, options: ReadOptions) -> tuple[Reading, Recording, Mapping24]:
    joint_map: JointMap | None = None
    if options.joint_map is not None:
        joint_map = load_joint_map(options.joint_map)
    sources = sources_of(path, options.skeleton)
    recording = read_recording(
        path, skeleton_path=sources[1] if len(sources) > 1 else None, limits=options.limits
    )
    mapping = choose_map(recording.skeleton, joint_map, place(sources[-1]))
    conventions = detect_conventions(recording, mapping, options.overrides())
    start = int(conventions.first_frame != "motion")
    rate, origin = _rate(path, recording, options)
    motion = Motion(
        joints=CANONICAL_JOINTS,
        positions=_in_metres(
            canonical_positions(recording, mapping, conventions.root_positions, slice(start, None)),
            conventions,
        ),
        rate=rate,
        rest=_rest(recording, mapping, conventions),
        made=conventions.made,
    )
    frames = len(recording.values)
    _check_time(path, motion)
    return Reading(motion, conventions, sources, frames, start, origin), recording, mapping


def _check_time(path: Path, motion: Motion) -> None:
    """Refuse hours of hardly any frames, which a small file can claim and no camera makes."""
    hours = len(motion.positions) / motion.rate / 3600
    if motion.rate < SLOW_RATE and hours > SLOW_HOURS:
        raise FormatError(
            f"{place(path)}: {hours:.1f} hours of {motion.rate:g} frames a second; expected at "
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


def _rate(path: Path, recording: Recording, options: ReadOptions) -> tuple[float, RateOrigin]:
    if options.source_rate is not None and path.suffix.lower() == ".amc":
        return options.source_rate, "option"
    if recording.rate is not None:
        return recording.rate, "file"
    named = RATE_IN_NAME.search(path.stem)
    if named:
        return float(named[1]), "name"
    return ASSUMED_RATE, "assumed"


def read_motion(path: str | Path, **options: Any) -> Motion:
    """Read a motion file as joint positions.

    Parameters
    ----------
    path : str or Path
        An AMC or a BVH file.
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


@dataclass(frozen=True, slots=True)
class SegmentRow:
    """One canonical joint in its tree, for a report.

    Parameters
    ----------
    joint, parent : str
        Canonical names; the root's parent is "".
    node : str
        The file's name for the joint, "" where it has none.
    state : {"real", "made", "missing"}
        Where the joint comes from.
    length : float
        From the parent to the joint, median over the take, in metres; NaN for the root.
    """

    joint: str
    parent: str
    node: str
    state: Literal["real", "made", "missing"]
    length: float


@dataclass(frozen=True, slots=True)
class NodeRow:
    """One node of the file's skeleton, for a report.

    Parameters
    ----------
    name, parent : str
        As the file has them; the root's parent is "".
    offset : tuple of float
        In file units.
    channels : tuple of str
        Such as ``Zrotation``, in the order in which they are applied.
    joints : tuple of str
        The canonical joints that it stands for.
    """

    name: str
    parent: str
    offset: tuple[float, float, float]
    channels: tuple[str, ...]
    joints: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SkeletonReport:
    """How a file's skeleton is understood.

    Parameters
    ----------
    reading : Reading
        The take, its conventions and their evidence.
    segments : tuple of SegmentRow
        The canonical tree, 24 rows.
    nodes : tuple of NodeRow
        The file's own tree, parents first.
    """

    reading: Reading
    segments: tuple[SegmentRow, ...]
    nodes: tuple[NodeRow, ...]


CHANNEL_NAMES: Final = (
    "Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation",
)  # fmt: skip


def skeleton_report(path: Path, options: ReadOptions | None = None) -> SkeletonReport:
    """Tell how a file's skeleton is understood.

    Parameters
    ----------
    path : Path
        An AMC or a BVH file.
    options : ReadOptions, optional
        What the user says about it.

    Returns
    -------
    SkeletonReport
        Guesses, evidence, the canonical tree and the file's own.

    Raises
    ------
    FormatError
        If the file can't be used.
    """
    reading, recording, mapping = _read(path, options or ReadOptions())
    skeleton = recording.skeleton
    positions = reading.motion.positions
    segments = []
    for i, (joint, parent) in enumerate(zip(CANONICAL_JOINTS, PARENTS.tolist(), strict=True)):
        node = mapping.nodes[i]
        made = joint in reading.motion.made
        lengths = np.linalg.norm(positions[:, i] - positions[:, parent], axis=1)
        segments.append(
            SegmentRow(
                joint=joint,
                parent=CANONICAL_JOINTS[parent] if parent >= 0 else "",
                node=skeleton.names[node] if node >= 0 else "",
                state="real" if node >= 0 else "made" if made else "missing",
                length=float(np.median(lengths)) if parent >= 0 else np.nan,
            )
        )
    nodes = []
    for i, name in enumerate(skeleton.names):
        parent = int(skeleton.parents[i])
        kinds = recording.channel_kinds[recording.channel_nodes == i]
        x, y, z = skeleton.offsets[i].tolist()
        nodes.append(
            NodeRow(
                name=name,
                parent=skeleton.names[parent] if parent >= 0 else "",
                offset=(x, y, z),
                channels=tuple(CHANNEL_NAMES[k] for k in kinds),
                joints=tuple(
                    j for j, n in zip(CANONICAL_JOINTS, mapping.nodes, strict=True) if n == i
                ),
            )
        )
    return SkeletonReport(reading, tuple(segments), tuple(nodes))
