"""Query by example: what goes through the same steps as a motion file, or an indexed stretch."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray
from mocapidx.printable import shown
from mocapidx.queries.pattern import Pattern, pattern_from_query
from mocapidx.queries.steps import mirror_bits, steps_from_example
from mocapidx.skeleton.joints import MIRROR
from mocapidx.tasks.answers import Answer, Archive, ask, feature_ranges
from mocapidx.tasks.example import (
    Example,
    find_example,
    frames_of_document,
    frames_of_file,
    part_of,
)
from mocapidx.tasks.read import ReadOptions

__all__ = [
    "LoadedExample",
    "agreeing",
    "ask_example",
    "example_remarks",
    "load_example",
    "mirror_example",
]


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
    example, placed = find_example(example, archive.snapshot)
    if placed is None:
        read = frames_of_file(example.path, archive.feature_set, archive.rate, options)
    else:
        read = frames_of_document(archive.snapshot, placed)
    # Cut after extraction: velocities and hysteresis then know what came before.
    start, end = part_of(example, len(read.words), archive.rate)
    poses = None if read.poses is None else read.poses[start:end]
    return LoadedExample(example.label, read.words[start:end], poses, read.untrusted_in(start, end))


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
    if mask and not mask & ~example.untrusted:
        names = feature_ranges(archive.feature_set, mask)
        raise ParameterError(
            f"{shown(example.label)}: the example's skeleton can't tell {names}; select other "
            "features, or give another example"
        )
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
        names = feature_ranges(archive.feature_set, unknown)
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
