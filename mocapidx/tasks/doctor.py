"""Examine motion files: what was recognised, and what in them can't be relied on."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.features.featureset import AnyFeatureSet, FeatureSet, load_feature_set
from mocapidx.features.gaps import Unspecified
from mocapidx.features.unspecified import feature_words
from mocapidx.model import IndexArray
from mocapidx.printable import count, shown
from mocapidx.skeleton.joints import CANONICAL_JOINTS, MIRROR
from mocapidx.skeleton.plausibility import exchanges, jumps
from mocapidx.skeleton.resample import resample_motion
from mocapidx.tasks.reading import ReadOptions
from mocapidx.tasks.records import Record
from mocapidx.tasks.skeleton_records import guesses
from mocapidx.tasks.skeleton_report import SkeletonReport, skeleton_report
from mocapidx.tasks.sources import find_sources

__all__ = [
    "COLUMNS",
    "Examination",
    "examination_lines",
    "examination_record",
    "examine",
    "examine_file",
]

RATE: Final = 30.0  # Hz, of features unless told otherwise
SHOWN: Final = 5  # places that are told one by one

COLUMNS: Final = (
    "document", "kind", "joint_map", "seconds", "rate", "unit", "up", "gaps_filled", "gaps_left",
    "jumps", "exchanges", "made", "missing", "coincident", "untrusted", "problem",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Examination:
    """What is known of a motion file.

    Parameters
    ----------
    name : str
        Of the document that it would be.
    path : Path
    report : SkeletonReport or None
        How it is understood; None: it can't be used.
    problem : str
        Why it can't be used, one line.
    jumps, exchanges : ndarray of int64, shape (N, 2)
        Frame (from 0, at the source rate) and joint: joints that are suddenly elsewhere for no
        such reason, and left joints that change places with the right ones.
    feature_set : FeatureSet
    untrusted : int
        Mask of the features that can't be told.
    unspecified : tuple of (int, int, int)
        Start, end (frames at `rate`) and mask of what can't be told for a while.
    rate : float
        Of the features, in Hz.
    """

    name: str
    path: Path
    report: SkeletonReport | None
    problem: str
    jumps: IndexArray
    exchanges: IndexArray
    feature_set: FeatureSet
    untrusted: int = 0
    unspecified: Unspecified = ()
    rate: float = RATE


def examine(
    inputs: Sequence[str | Path],
    options: ReadOptions | None = None,
    feature_set: AnyFeatureSet = "f39",
    rate: float = RATE,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Examination]:
    """Examine motion files and all that are in folders.

    Parameters
    ----------
    inputs : sequence of str or Path
        Motion files and folders.
    options : ReadOptions, optional
        What the user says about files.
    feature_set : str, Path or FeatureSet
        Whose features are told from those not to be trusted.
    rate : float
        Of the features, in Hz.
    progress : callable, optional
        Called after each file with how many are done, and of how many.

    Yields
    ------
    Examination
        In the order of their names; of files that can't be used too.

    Raises
    ------
    FormatError
        If a file that is named is of an unknown kind.
    ParameterError
        If there is no such file.
    """
    features = load_feature_set(feature_set)
    sources = find_sources([Path(given) for given in inputs])[0]
    for done, source in enumerate(sources, start=1):
        try:
            yield examine_file(source.path, options, features, rate, source.name)
        except FormatError as exc:
            none = np.empty((0, 2), dtype=np.int64)
            reason = _without_path(str(exc), source.path)
            yield Examination(source.name, source.path, None, reason, none, none, features)
        if progress is not None:
            progress(done, len(sources))


def _without_path(message: str, path: Path) -> str:
    """Leave out the path that a message begins with; its row names the file."""
    rest = message.removeprefix(shown(path, None))
    return rest[2:] if rest.startswith(": ") else rest.removeprefix(":")


def examine_file(
    path: Path,
    options: ReadOptions | None = None,
    feature_set: AnyFeatureSet = "f39",
    rate: float = RATE,
    name: str = "",
) -> Examination:
    """Examine one motion file.

    Parameters
    ----------
    path : Path
    options, feature_set, rate
        As for `examine`.
    name : str
        Of the document that it would be.

    Returns
    -------
    Examination

    Raises
    ------
    FormatError
        If it can't be used.
    """
    features = load_feature_set(feature_set)
    report = skeleton_report(path, options)
    motion = report.reading.motion
    told = feature_words(resample_motion(motion, rate), features)
    start = np.array([report.reading.source_start, 0])
    crossed = exchanges(motion.positions)
    sudden = jumps(motion.positions, motion.rate)
    pairs = crossed.tolist()
    explained = {(frame, joint) for frame, left in pairs for joint in (left, int(MIRROR[left]))}
    others = [tuple(row) not in explained for row in sudden.tolist()]
    return Examination(
        name=name or path.name,
        path=path,
        report=report,
        problem="",
        jumps=sudden[np.array(others, dtype=np.bool_)] + start,
        exchanges=crossed + start,
        feature_set=features,
        untrusted=told.untrusted,
        unspecified=told.unspecified,
        rate=rate,
    )


def examination_record(examination: Examination) -> Record:
    """Lay out an examination as one record.

    Parameters
    ----------
    examination : Examination

    Returns
    -------
    mapping of str to number or str
        Of a file that can't be used, only its name and why.
    """
    report = examination.report
    record: dict[str, str | int | float] = {
        "document": examination.name,
        "kind": examination.path.suffix.lower().removeprefix("."),
    }
    if report is None:
        return {**record, **dict.fromkeys(COLUMNS[2:-1]), "problem": examination.problem}
    reading, conventions = report.reading, report.reading.conventions
    motion, gaps = reading.motion, report.reading.gaps
    return {
        **record,
        "joint_map": conventions.joint_map,
        "seconds": round(len(motion.positions) / motion.rate, 2),
        "rate": motion.rate,
        "unit": float(f"{conventions.unit:.6g}"),
        "up": conventions.up,
        "gaps_filled": gaps.filled,
        "gaps_left": gaps.left,
        "jumps": len(examination.jumps),
        "exchanges": len(examination.exchanges),
        "made": len(conventions.made),
        "missing": len(conventions.missing),
        "coincident": len(conventions.coincident),
        "untrusted": examination.untrusted.bit_count(),
        "problem": "; ".join(conventions.warnings),
    }


def examination_lines(examination: Examination) -> Iterator[str]:
    """Say in lines for people what was found in a file that can be used.

    Parameters
    ----------
    examination : Examination

    Yields
    ------
    str
        One fact a line.
    """
    if examination.report is None:
        yield examination.problem
        return
    yield from guesses(examination.report)
    rate = examination.report.reading.motion.rate
    yield f"jumps: {_places(examination.jumps, rate)}"
    yield f"sides exchanged: {_places(examination.exchanges, rate)}"
    yield f"features not to be trusted: {_features(examination, examination.untrusted)}"
    if examination.unspecified:
        yield f"features open in gaps: {_open(examination)}"
    unused = [shown(row.name, 30) for row in examination.report.points if not row.joints]
    if unused:
        yield f"points of no use: {', '.join(unused)}"


def _places(found: IndexArray, rate: float) -> str:
    if not len(found):
        return "none"
    places = ", ".join(
        f"{CANONICAL_JOINTS[joint]} at {frame / rate:.2f} s (frame {frame})"
        for frame, joint in found[:SHOWN].tolist()
    )
    return f"{len(found)}: {places}{', ...' if len(found) > SHOWN else ''}"


def _features(examination: Examination, mask: int) -> str:
    ids = examination.feature_set.ids
    return ", ".join(id for bit, id in enumerate(ids) if mask >> bit & 1) or "none"


def _open(examination: Examination) -> str:
    frames = mask = 0
    for start, end, features in examination.unspecified:
        mask |= features
        frames += end - start
    seconds = frames / examination.rate
    stretches = count(len(examination.unspecified), "stretch", "stretches")
    return f"{_features(examination, mask)}, for {seconds:.2f} s in {stretches}"
