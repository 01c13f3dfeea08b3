"""From one motion file to what a store keeps of it; runs in any process."""

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import FormatError
from mocapidx.features.featureset import FeatureSet
from mocapidx.features.unspecified import FeatureWords, feature_words
from mocapidx.formats.registry import sources_of
from mocapidx.model import WordArray
from mocapidx.printable import shown
from mocapidx.skeleton.gaps import FILLED, GapCounts
from mocapidx.skeleton.resample import resample_motion, resampled_frames
from mocapidx.store.manifest import Document, Rig
from mocapidx.tasks.hits import SOURCE_START
from mocapidx.tasks.read import Limits, Reading, ReadOptions, read_take
from mocapidx.tasks.segment_sources import UNTRUSTED
from mocapidx.tasks.sources import Source
from mocapidx.tasks.stored import REST, kept_rest, source_skeleton
from mocapidx.tasks.unspecified import keep_unspecified

__all__ = [
    "Item",
    "Job",
    "Prepared",
    "Refused",
    "Unchanged",
    "is_unchanged",
    "prepare",
    "prepare_item",
    "source_digest",
]

PIECE: Final = 1 << 20


class Item(NamedTuple):
    """What differs from one `Job` to the next."""

    source: Source
    known: Document | None
    facts: Mapping[str, str]

    @property
    def weight(self) -> int:
        """Bytes of the motion file."""
        return self.source.weight

    @property
    def path(self) -> Path:
        """Where the motion file is."""
        return self.source.path


@dataclass(frozen=True, slots=True)
class Job:
    """A motion file to be prepared, and what the store knows of it."""

    source: Source
    known: Document | None
    options: ReadOptions
    feature_set: FeatureSet
    rate: float
    poses: bool
    facts: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Prepared:
    """What a store keeps of one motion file.

    Parameters
    ----------
    document : Document
    words : ndarray of uint64, shape (T,)
        Feature words at the store's rate; untrusted features are 0.
    poses : ndarray of float32, shape (T, 24, 3), or None
        Joint positions in metres.
    assumed_rate : bool
        Whether nothing says the source's rate.
    oddities : tuple of str
        What looks wrong about the skeleton, for people.
    gaps : GapCounts
        What was not seen of the points that it is read from.
    """

    document: Document
    words: WordArray
    poses: NDArray[np.float32] | None
    assumed_rate: bool
    oddities: tuple[str, ...]
    gaps: GapCounts


@dataclass(frozen=True, slots=True)
class Unchanged:
    """A motion file whose bytes are those of the last run."""

    name: str


@dataclass(frozen=True, slots=True)
class Refused:
    """A motion file that can't be used, and why."""

    name: str
    message: str


Outcome: TypeAlias = Prepared | Unchanged | Refused


def is_unchanged(
    source: Source, known: Document, options: ReadOptions, facts: Mapping[str, str]
) -> bool:
    """Tell by size and time of change whether a source, and its skeleton, are as they were.

    Parameters
    ----------
    source : Source
    known : Document
        Of the same name.
    options : ReadOptions
        How it would be read now.
    facts : mapping of str to str
        What its name would tell now.

    Returns
    -------
    bool
    """
    if (
        known.facts != facts
        or known.root != source.root
        or known.rig.get("options") != _told(options)
    ):
        return False
    if _stamp(source.path) != [known.size, known.mtime_ns]:
        return False
    skeleton = source_skeleton(known)
    return skeleton is None or _stamp(Path(skeleton[0])) == skeleton[1]


def prepare(job: Job) -> Outcome:
    """Read a motion file and extract its feature words.

    Parameters
    ----------
    job : Job

    Returns
    -------
    Prepared, Unchanged or Refused
    """
    path = job.source.path
    try:
        sources = sources_of(path, job.options.skeleton)
        stamps = [_stamp(source) for source in sources]
        digest = source_digest(sources)
        if _is_same(job, digest):
            return Unchanged(job.source.name)
        reading = read_take(path, job.options, job.rate)
        length = reading.source_frames - reading.source_start
        frames = resampled_frames(length, reading.source_rate, job.rate)
        job.options.limits.check_frames(frames, path)
    except FormatError as exc:
        return Refused(job.source.name, str(exc))
    if [_stamp(source) for source in sources] != stamps:
        message = f"{shown(path)}: changed while it was read; try again when it is whole"
        return Refused(job.source.name, message)
    motion = resample_motion(reading.motion, job.rate)
    told = feature_words(motion, job.feature_set)
    document = Document(
        name=job.source.name,
        root=job.source.root,
        path=None,
        digest=digest,
        size=stamps[0][0],
        mtime_ns=stamps[0][1],
        frames=len(told.words),
        source_frames=reading.source_frames,
        source_rate=reading.source_rate,
        rig=_rig(reading, sources[1:], stamps[1:], job.options, told),
        facts=job.facts,
    )
    return Prepared(
        document,
        told.words,
        motion.positions.astype(np.float32) if job.poses else None,
        reading.rate_origin == "assumed",
        reading.conventions.warnings,
        reading.gaps,
    )


def prepare_item(
    options: ReadOptions, feature_set: FeatureSet, rate: float, poses: bool, item: Item
) -> Outcome:
    """Prepare one of many motion files; all but the item is sent to a worker once.

    Parameters
    ----------
    options, feature_set, rate, poses
        As in `Job`.
    item : Item
        The rest of a `Job`.

    Returns
    -------
    Prepared, Unchanged or Refused
    """
    source, known, facts = item
    return prepare(Job(source, known, options, feature_set, rate, poses, facts))


def _is_same(job: Job, digest: str) -> bool:
    known = job.known
    return (
        known is not None
        and known.digest == digest
        and known.root == job.source.root
        and known.facts == job.facts
        and known.rig.get("options") == _told(job.options)
    )


def _rig(
    reading: Reading,
    skeletons: tuple[Path, ...],
    stamps: list[list[int]],
    options: ReadOptions,
    told: FeatureWords,
) -> Rig:
    rig: dict[str, Any] = dict(reading.conventions.to_dict())
    rig["rate_origin"] = reading.rate_origin
    rig[SOURCE_START] = reading.source_start
    rig["options"] = _told(options)
    rig[UNTRUSTED] = f"{told.untrusted:x}"
    if reading.motion.rest is not None:
        rig[REST] = kept_rest(reading.motion.rest)
    if skeletons:
        rig["skeleton"] = [os.path.abspath(skeletons[0]), *stamps[0]]
    return keep_unspecified(rig, told.unspecified)


def _told(options: ReadOptions) -> str:
    """Put into words what the user says about files, to see later whether it has changed."""
    joint_map = options.joint_map
    return _in_words(options, () if joint_map is None else tuple(_stamp(joint_map)))


@lru_cache(maxsize=8)
def _in_words(options: ReadOptions, stamp: tuple[int, ...]) -> str:
    """Where its files are counts, not how that was said; limits change nothing that is read.

    What is new since stores are written counts only where it is said.
    """
    skeleton = options.skeleton and Path(os.path.abspath(options.skeleton))
    words = repr(replace(options, skeleton=skeleton, joint_map=None, limits=Limits()))
    words = words.replace(f", subject=None, fill_gaps={FILLED}", "")
    if options.joint_map is None:
        return words
    return f"{words}, joint map {source_digest((options.joint_map,))}"


def _stamp(path: Path) -> list[int]:
    """Give size in bytes and time of change in nanoseconds; nothing of a file that is gone."""
    try:
        status = os.stat(path)
    except OSError:
        return []
    return [status.st_size, status.st_mtime_ns]


def source_digest(sources: tuple[Path, ...]) -> str:
    """Digest the bytes of a take's files, to tell whether it has changed.

    Parameters
    ----------
    sources : tuple of Path
        The motion file and its skeleton; what is no regular file counts as nothing, since the
        reader has the last word on odd files.

    Returns
    -------
    str
        BLAKE2b, 32 hexadecimal digits.

    Raises
    ------
    FormatError
        If a file can't be read.
    """
    digest = hashlib.blake2b(digest_size=16)
    for path in sources:
        if not path.is_file():  # a pipe would block for ever
            continue
        try:
            with path.open("rb") as file:
                while piece := file.read(PIECE):
                    digest.update(piece)
        except OSError as exc:
            reason = (exc.strerror or "").lower()
            raise FormatError(f"{shown(path)}: can't be read: {reason}") from exc
        digest.update(b"\0end of file\0")
    return digest.hexdigest()
