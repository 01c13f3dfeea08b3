"""Query by example: what goes through the same steps as a motion file, or an indexed stretch."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.extract import extract_features, untrusted_features
from mocapidx.features.words import pack_words
from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray
from mocapidx.printable import shown
from mocapidx.queries.pattern import Pattern, pattern_from_query
from mocapidx.queries.steps import mirror_bits, steps_from_example
from mocapidx.skeleton.joints import CANONICAL_JOINTS, MIRROR
from mocapidx.skeleton.resample import resample_motion
from mocapidx.store.manifest import Placed
from mocapidx.store.schema import FRAME_WORDS, POSES
from mocapidx.tasks.answers import Answer, Archive, ask, feature_names
from mocapidx.tasks.read import ReadOptions, read_take
from mocapidx.tasks.segment_sources import untrusted_mask

__all__ = [
    "Example",
    "LoadedExample",
    "agreeing",
    "ask_example",
    "example_remarks",
    "load_example",
    "mirror_example",
    "parse_example",
]

PART_OF_FILE: Final = re.compile(r"(?P<file>.*)@(?P<start>[0-9.]*):(?P<end>[0-9.]*)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Example:
    """A motion file or a document of the store, or a part of it.

    Parameters
    ----------
    path : Path
    start, end : float or None
        In seconds; None: from the beginning, to the end.
    """

    path: Path
    start: float | None = None
    end: float | None = None

    @property
    def label(self) -> str:
        """The name that its hits get."""
        return self.path.stem


@dataclass(frozen=True, slots=True, eq=False)
class LoadedExample:
    """An example as feature words and poses.

    Parameters
    ----------
    label : str
        Of its hits.
    words : ndarray of uint64, shape (T,)
        At the store's rate; what can't be trusted is 0.
    poses : ndarray of float, shape (T, 24, 3), or None
        In metres, NaN for joints that are not there; None: a document of a store without.
    untrusted : int
        Mask of the features that it can't tell.
    mirrored : bool
        Whether left and right were exchanged.
    """

    label: str
    words: WordArray
    poses: FloatArray | None
    untrusted: int
    mirrored: bool = False


def parse_example(text: str) -> Example:
    """Understand ``FILE`` or ``FILE@START:END``, times in seconds, either may be left out.

    Raises
    ------
    ParameterError
        If a time is no number, or the end is not after the start.
    """
    match = PART_OF_FILE.fullmatch(text)
    if match is None or Path(text).exists():
        return Example(Path(text))
    try:
        start, end = (float(match[key]) if match[key] else None for key in ("start", "end"))
    except ValueError:
        raise ParameterError(f"{shown(text)}: START and END are seconds, such as @1.5:3") from None
    if end is not None and end <= (start or 0.0):
        raise ParameterError(f"{shown(text)}: END must be later than START")
    return Example(Path(match["file"]), start, end)


def load_example(
    archive: Archive, example: str | Path | Example, options: ReadOptions
) -> LoadedExample:
    """Read an example: a file, or where there is no such file, a document of the store.

    Parameters
    ----------
    archive : Archive
    example : str, Path or Example
        As text: ``FILE`` or ``FILE@START:END``; a document is named in place of FILE.
    options : ReadOptions
        How a file is understood.

    Returns
    -------
    LoadedExample

    Raises
    ------
    FormatError
        If the file can't be used.
    ParameterError
        If the part does not lie in it.
    """
    text = str(example)
    if not isinstance(example, Example):
        whole = None if Path(text).exists() else _document(archive, text)
        example = parse_example(text) if whole is None else Example(Path(text))
    name = str(example.path)
    placed = None if example.path.exists() else _document(archive, name)
    if placed is None and not example.path.exists():
        store = shown(archive.snapshot.path)
        raise FormatError(f"{shown(name)}: no such file, and no document of {store}")
    loaded = _from_file(archive, example, options) if placed is None else _stored(archive, placed)
    # Cut after extraction: velocities and hysteresis then know what came before.
    rate, frames = archive.rate, len(loaded.words)
    start = round((example.start or 0.0) * rate)
    end = frames if example.end is None else min(frames, round(example.end * rate))
    if start >= end:
        raise ParameterError(
            f"{shown(name)}: lasts {frames / rate:.2f} s, "
            f"the example starts at {start / rate:.2f} s"
        )
    poses = None if loaded.poses is None else loaded.poses[start:end]
    return replace(loaded, words=loaded.words[start:end], poses=poses)


def _document(archive: Archive, name: str) -> Placed | None:
    for place in archive.files:
        for placed in place.placed:
            if placed.document.live and placed.document.name == name:
                return placed
    return None


def _from_file(archive: Archive, example: Example, options: ReadOptions) -> LoadedExample:
    motion = resample_motion(read_take(example.path, options).motion, archive.rate)
    words = pack_words(extract_features(motion, archive.feature_set, archive.rate))
    untrusted = untrusted_features(motion, archive.feature_set)
    poses = motion.positions.astype(np.float64)
    poses[:, [joint in motion.made for joint in CANONICAL_JOINTS]] = np.nan
    return LoadedExample(example.label, words, poses, untrusted)


def _stored(archive: Archive, placed: Placed) -> LoadedExample:
    document = placed.document
    rows = (placed.frame_offset, placed.frame_offset + document.frames)
    snapshot = archive.snapshot
    words = snapshot.array(placed.file, FRAME_WORDS.path, *rows).astype(np.uint64)
    poses = None
    if snapshot.manifest.settings.poses:
        poses = snapshot.array(placed.file, POSES.path, *rows).astype(np.float64)
    return LoadedExample(Path(document.name).stem, words, poses, untrusted_mask(document))


def mirror_example(example: LoadedExample, permutation: IndexArray) -> LoadedExample:
    """Exchange left and right in an example.

    Parameters
    ----------
    example : LoadedExample
    permutation : ndarray of int64, shape (F,)
        The mirror partner of each feature.

    Returns
    -------
    LoadedExample
    """
    words = np.zeros_like(example.words)
    for bit, partner in enumerate(permutation.tolist()):
        words |= (example.words >> np.uint64(bit) & np.uint64(1)) << np.uint64(partner)
    poses = None if example.poses is None else example.poses[:, MIRROR] * [-1.0, 1.0, 1.0]
    untrusted = mirror_bits(example.untrusted, permutation)
    return LoadedExample(example.label, words, poses, untrusted, not example.mirrored)


def ask_example(
    archive: Archive,
    example: LoadedExample,
    mask: int,
    mode: str,
    mismatches: int,
    may_fail: Sequence[int] | None,
    costs: Callable[[LoadedExample, Answer], FloatArray],
) -> tuple[Pattern, list[Answer]]:
    """Find what goes through the same steps as an example.

    Parameters
    ----------
    archive : Archive
    example : LoadedExample
    mask : int
        The selected features, as they are called in the example.
    mode : str
    mismatches : int
        For the mode ``mismatch``.
    may_fail : sequence of int or None
        Steps that may disagree, from 1; None: all.
    costs : callable
        Gives the cost of each hit of an answer.

    Returns
    -------
    pattern : Pattern
        What was asked for.
    answers : list of Answer

    Raises
    ------
    ParameterError
        If nothing is left that could be asked for, or a step that may disagree is not there.
    """
    query = steps_from_example(example.words, mask & ~example.untrusted)
    count, free = len(query.steps), None
    if may_fail is not None:
        if wrong := [step for step in may_fail if not 1 <= step <= count]:
            raise ParameterError(f"no step {wrong[0]} to disagree; the example has {count}")
        free = np.isin(np.arange(1, count + 1), list(may_fail))
    pattern = pattern_from_query(query, free)
    answers = ask(archive, pattern, mode, mismatches, example.label, example.mirrored)
    return pattern, [replace(answer, costs=costs(example, answer)) for answer in answers]


def example_remarks(archive: Archive, example: LoadedExample, mask: int) -> Sequence[str]:
    """Say what the example's own skeleton leaves open."""
    if unknown := mask & example.untrusted:
        names = feature_names(archive.feature_set, unknown)
        return [f"the example's skeleton can't tell {names}; the query leaves it open"]
    return []


def agreeing(several: Sequence[Sequence[Answer]]) -> list[Answer]:
    """Keep the hits of each example that overlap a hit of every other example.

    Parameters
    ----------
    several : sequence of sequence of Answer
        For each example its answers.

    Returns
    -------
    list of Answer
    """
    kept: list[Answer] = []
    for own, answers in enumerate(several):
        others = [_laid_out(other) for number, other in enumerate(several) if number != own]
        for answer in answers:
            places = _places(answer)
            agree = np.ones(len(places), np.bool_)
            for laid in others:
                agree &= _overlapped(places, laid.get(answer.place.file.number))
            kept.append(
                replace(
                    answer,
                    documents=answer.documents[agree],
                    spans=answer.spans[agree],
                    bounds=answer.bounds[agree],
                    costs=answer.costs[agree],
                )
            )
    return kept


def _places(answer: Answer) -> IndexArray:
    """Give the spans of hits in positions, shape (H, 2)."""
    return answer.spans + answer.place.source.first[answer.documents, np.newaxis]


def _laid_out(answers: Sequence[Answer]) -> dict[int, IndexArray]:
    """Give the spans of an example's hits in each segment file, in positions, by their starts."""
    by_file: dict[int, list[IndexArray]] = {}
    for answer in answers:
        by_file.setdefault(answer.place.file.number, []).append(_places(answer))
    laid = {number: np.concatenate(spans) for number, spans in by_file.items()}
    return {number: spans[np.argsort(spans[:, 0])] for number, spans in laid.items()}


def _overlapped(spans: IndexArray, others: IndexArray | None) -> BoolArray:
    if others is None or not len(others):
        return np.zeros(len(spans), np.bool_)
    furthest = np.append(-1, np.maximum.accumulate(others[:, 1]))
    return furthest[np.searchsorted(others[:, 0], spans[:, 1], "left")] > spans[:, 0]
