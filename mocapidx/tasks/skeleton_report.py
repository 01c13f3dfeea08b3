"""How a file's skeleton, or its set of markers, is understood."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np

from mocapidx.model import PointRecording, Recording
from mocapidx.skeleton.gaps import find_gaps
from mocapidx.skeleton.jointmap import Mapping24
from mocapidx.skeleton.joints import CANONICAL_JOINTS, PARENTS
from mocapidx.skeleton.markers import PointMapping
from mocapidx.tasks.read import read_any
from mocapidx.tasks.reading import Reading, ReadOptions

__all__ = ["NodeRow", "PointRow", "SegmentRow", "SkeletonReport", "skeleton_report"]


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
class PointRow:
    """One point of a file of points, for a report.

    Parameters
    ----------
    name : str
        As the file has it.
    gaps : int
        Stretches in which it was not seen.
    seen : float
        Part of the frames in which it was seen, 0 to 1.
    joints : tuple of str
        The canonical joints that it helps to find.
    """

    name: str
    gaps: int
    seen: float
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
        The file's own tree, parents first; none where it holds points.
    points : tuple of PointRow
        The file's points; none where it holds a skeleton.
    """

    reading: Reading
    segments: tuple[SegmentRow, ...]
    nodes: tuple[NodeRow, ...]
    points: tuple[PointRow, ...] = ()


CHANNEL_NAMES: Final = (
    "Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation",
)  # fmt: skip


def skeleton_report(path: Path, options: ReadOptions | None = None) -> SkeletonReport:
    """Tell how a file's skeleton is understood.

    Parameters
    ----------
    path : Path
        A motion file.
    options : ReadOptions, optional
        What the user says about it.

    Returns
    -------
    SkeletonReport
        Guesses, evidence, the canonical tree and the file's own nodes or points.

    Raises
    ------
    FormatError
        If the file can't be used.
    """
    reading, recording, mapping = read_any(path, options or ReadOptions())
    segments = _segments(reading, _names_of(recording, mapping))
    if isinstance(recording, PointRecording) and isinstance(mapping, PointMapping):
        return SkeletonReport(reading, segments, (), _points(recording, mapping))
    if isinstance(recording, Recording) and isinstance(mapping, Mapping24):
        return SkeletonReport(reading, segments, _nodes(recording, mapping))
    return SkeletonReport(reading, segments, ())


def _names_of(
    recording: Recording | PointRecording, mapping: Mapping24 | PointMapping
) -> dict[str, str]:
    """Return what each canonical joint is in the file: a node or a formula."""
    if isinstance(mapping, PointMapping):
        return {joint: str(mapping.joints[joint]) for joint in mapping.real}
    if isinstance(recording, PointRecording):
        return {}
    named = zip(CANONICAL_JOINTS, mapping.nodes, strict=True)
    return {joint: recording.skeleton.names[node] for joint, node in named if node >= 0}


def _segments(reading: Reading, names: dict[str, str]) -> tuple[SegmentRow, ...]:
    positions = reading.motion.positions
    segments = []
    for i, (joint, parent) in enumerate(zip(CANONICAL_JOINTS, PARENTS.tolist(), strict=True)):
        lengths = np.linalg.norm(positions[:, i] - positions[:, parent], axis=1)
        known = lengths[np.isfinite(lengths)]
        made = joint in reading.motion.made
        segments.append(
            SegmentRow(
                joint=joint,
                parent=CANONICAL_JOINTS[parent] if parent >= 0 else "",
                node=names.get(joint, ""),
                state="real" if joint in names else "made" if made else "missing",
                length=float(np.median(known)) if parent >= 0 and len(known) else np.nan,
            )
        )
    return tuple(segments)


def _nodes(recording: Recording, mapping: Mapping24) -> tuple[NodeRow, ...]:
    skeleton = recording.skeleton
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
    return tuple(nodes)


def _points(recording: PointRecording, mapping: PointMapping) -> tuple[PointRow, ...]:
    frames, users = len(recording.positions), mapping.users()
    return tuple(
        PointRow(
            name=name,
            gaps=len(gaps),
            seen=1 - int((gaps[:, 1] - gaps[:, 0]).sum()) / frames,
            joints=users.get(column, ()),
        )
        for column, (name, gaps) in enumerate(
            zip(recording.names, find_gaps(recording.positions), strict=True)
        )
    )
