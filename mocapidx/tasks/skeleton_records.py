"""How a skeleton is understood, as lines and records."""

import math
from collections.abc import Iterator

from mocapidx.printable import count, shown
from mocapidx.skeleton.gaps import GapCounts
from mocapidx.tasks.records import Record
from mocapidx.tasks.skeleton_report import SkeletonReport

__all__ = ["gap_sentence", "guesses", "joint_records", "node_records"]


def guesses(report: SkeletonReport) -> Iterator[str]:
    """Say in lines for people what was guessed of a file and on what evidence.

    Parameters
    ----------
    report : SkeletonReport

    Yields
    ------
    str
        One fact a line.
    """
    reading, conventions = report.reading, report.reading.conventions
    motion = reading.motion
    seconds = len(motion.positions) / motion.rate
    yield f"files: {', '.join(shown(path) for path in reading.sources)}"
    yield f"joint map: {conventions.joint_map}"
    yield (
        f"length: {reading.source_frames} frames at {motion.rate:g} Hz "
        f"({reading.rate_origin}), {seconds:.2f} s"
    )
    yield from conventions.evidence
    if report.points:
        yield gap_sentence(reading.gaps)
    yield f"made joints: {', '.join(conventions.made) or 'none'}"
    yield f"missing joints: {', '.join(conventions.missing) or 'none'}"
    pairs = ", ".join(f"{one} = {other}" for one, other in conventions.coincident)
    yield f"coincident joints: {pairs or 'none'}"
    yield from (f"warning: {warning}" for warning in conventions.warnings)


def gap_sentence(gaps: GapCounts) -> str:
    """Say how much of a file's points was not seen, and what became of that.

    Parameters
    ----------
    gaps : GapCounts

    Returns
    -------
    str
    """
    if not gaps.filled + gaps.left:
        return "gaps: none"
    return (
        f"gaps: {gaps.filled} filled ({count(gaps.filled_frames, 'frame')}), {gaps.left} left open "
        f"({count(gaps.left_frames, 'frame')}), the longest of {gaps.longest:.2f} s"
    )


def joint_records(report: SkeletonReport) -> list[Record]:
    """Lay out the 24 canonical joints, with the node that each comes from.

    Returns
    -------
    list of mapping
        Joint, parent, node, state, and the distance from the parent in metres.
    """
    return [
        {
            "joint": row.joint,
            "parent": row.parent,
            "node": row.node,
            "state": row.state,
            "length_m": "" if math.isnan(row.length) else round(row.length, 4),
        }
        for row in report.segments
    ]


def node_records(report: SkeletonReport) -> list[Record]:
    """Lay out the file's own nodes.

    Returns
    -------
    list of mapping
        Node, parent, offset in file units, channels, and the canonical joints it stands for; of
        points their name, gaps, the part of frames that show them and the joints they tell.
    """
    if report.points:
        return [
            {
                "point": row.name,
                "gaps": row.gaps,
                "seen": round(row.seen, 4),
                "joints": " ".join(row.joints),
            }
            for row in report.points
        ]
    return [
        {
            "node": row.name,
            "parent": row.parent,
            "offset": " ".join(f"{value:g}" for value in row.offset),
            "channels": " ".join(row.channels),
            "joints": " ".join(row.joints),
        }
        for row in report.nodes
    ]
