"""What every kind of query shares: where it looks, and what it finds."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import groupby, islice
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mocapidx.features.featureset import FeatureSet
from mocapidx.model import FloatArray, Hit, HitList, IndexArray
from mocapidx.printable import count
from mocapidx.queries.evaluate import DocumentGroup, GroupHits, evaluate
from mocapidx.queries.pattern import Pattern
from mocapidx.queries.source import Source
from mocapidx.store.manifest import Placed, SegmentFile
from mocapidx.store.read import Snapshot, open_store
from mocapidx.tasks.records import Record, hit_record
from mocapidx.tasks.segment_sources import (
    document_groups,
    one_voice,
    segment_source,
    store_feature_set,
)
from mocapidx.tasks.unspecified import told
from mocapidx.tasks.where import meeting

if TYPE_CHECKING:  # what only a cluster needs is imported with it
    from mocapidx.tasks.parallel import MapFunction
    from mocapidx.tasks.query_files import Question

Result = TypeVar("Result")

__all__ = [
    "Answer",
    "Archive",
    "Found",
    "ask",
    "feature_names",
    "feature_ranges",
    "open_archive",
    "untrusted_remarks",
]


@dataclass(frozen=True, slots=True)
class Found:
    """The answer to a query.

    Parameters
    ----------
    hits : tuple of Hit
        Best first.
    remarks : tuple of str
        What a person should know about the answer, a sentence each.
    extras : tuple of mapping
        Further keys of each hit's record; empty where there are none.
    explanation : tuple of str
        Lines for people on each hit, or on why there is none; empty unless asked for.
    """

    hits: tuple[Hit, ...]
    remarks: tuple[str, ...]
    extras: tuple[Mapping[str, object], ...] = ()
    explanation: tuple[str, ...] = ()

    def _repr_html_(self) -> str:
        return HitList(self.hits)._repr_html_()

    def records(self) -> list[Record]:
        """Lay the hits out as records, ranked from 1, with their further keys at the end."""
        extras = self.extras or ({},) * len(self.hits)
        return [
            {**hit_record(hit, rank), **extra}
            for rank, (hit, extra) in enumerate(zip(self.hits, extras, strict=True), start=1)
        ]


@dataclass(frozen=True)
class LookedAt:
    """A segment file, and those of its documents that count.

    Parameters
    ----------
    file : SegmentFile
    source : Source
    groups : list of DocumentGroup
    """

    file: SegmentFile
    source: Source
    groups: list[DocumentGroup]

    @cached_property
    def placed(self) -> list[Placed]:
        """Its documents with their places, dead ones too."""
        return list(self.file.placed())


@dataclass(frozen=True, slots=True)
class Archive:
    """The part of a store that a query looks at.

    Parameters
    ----------
    snapshot : Snapshot
    feature_set : FeatureSet
        The store's.
    rate : float
        The store's, in Hz.
    files : tuple of LookedAt
    map_fn : callable, optional
        Asks the files, with the shape of ``map``; by default one after the other, here.
    """

    snapshot: Snapshot
    feature_set: FeatureSet
    rate: float
    files: tuple[LookedAt, ...]
    map_fn: "MapFunction | None" = None

    def each_file(self, question: "Question[Result]") -> Iterable[Result]:
        """Ask every segment file the same.

        Parameters
        ----------
        question : callable
            From a file's runs and lists, and the documents that count, to any answer.

        Returns
        -------
        iterable
            An answer for each of `files`, in their order.
        """
        if self.map_fn is None:
            return (self._answer(question, place) for place in self.files)
        from mocapidx.tasks.query_files import answer_of_file, file_piece

        pieces = (
            file_piece(self.snapshot, place.file, self.feature_set, place.groups)
            for place in self.files
        )
        return self.map_fn(partial(answer_of_file, question), pieces)

    def _answer(self, question: "Question[Result]", place: LookedAt) -> Result:
        with one_voice(self.snapshot.path, place.file):
            return question(place.source, place.groups)


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """The hits of one question in documents of one file.

    Parameters
    ----------
    place : LookedAt
        The file.
    documents : ndarray of int64, shape (H,)
        Number of the document of each hit.
    spans : ndarray of int64, shape (H, 2)
        Start and end in frames of the document.
    label : str
    mirrored : bool
        Whether left and right were exchanged in the question.
    pattern : Pattern or None
        What was looked for in these documents; None for scenes.
    bounds : ndarray of int64, shape (H, S + B)
        Of the steps of `pattern`, as in `GroupHits`.
    costs : ndarray of float64, shape (H,)
    group : DocumentGroup
        The documents that were asked.
    """

    place: LookedAt
    documents: IndexArray
    spans: IndexArray
    label: str
    mirrored: bool
    pattern: Pattern | None
    bounds: IndexArray
    costs: FloatArray
    group: DocumentGroup


@contextmanager
def open_archive(
    store: str | Path, where: str | None = None, map_fn: "MapFunction | None" = None
) -> Iterator[Archive]:
    """Open a store for a query.

    Parameters
    ----------
    store : str or Path
    where : str, optional
        A condition on documents, as in `mocapidx.tasks.where`.
    map_fn : callable, optional
        Asks the segment files, with the shape of ``map``.

    Yields
    ------
    Archive

    Raises
    ------
    StoreError
    ParameterError
        If the condition can't be understood, or asks for what no document has.
    """
    with open_store(Path(store)) as snapshot:
        feature_set = store_feature_set(snapshot)
        rate = snapshot.manifest.settings.rate
        wanted = _wanted(snapshot, where)
        files = tuple(
            LookedAt(
                file, segment_source(snapshot, file, feature_set), document_groups(file, numbers)
            )
            for file, numbers in zip(snapshot.files, wanted, strict=True)
        )
        yield Archive(snapshot, feature_set, rate, files, map_fn)


def _wanted(snapshot: Snapshot, where: str | None) -> Sequence[set[int] | None]:
    """Find the numbers of the documents that meet a condition, for each segment file."""
    if where is None:
        return [None] * len(snapshot.files)
    documents = [document for file in snapshot.files for document in file.documents]
    met = iter(meeting(documents, where, snapshot.manifest.settings.rate))
    return [
        {number for number, holds in enumerate(islice(met, len(file.documents))) if holds}
        for file in snapshot.files
    ]


def ask(
    archive: Archive,
    pattern: Pattern,
    mode: str,
    mismatches: int,
    label: str,
    mirrored: bool = False,
) -> list[Answer]:
    """Find a pattern in all documents that count.

    Parameters
    ----------
    archive : Archive
    pattern : Pattern
    mode : str
        One of `mocapidx.queries.evaluate.MODES`.
    mismatches : int
        For the mode ``mismatch``.
    label : str
        Of the hits.
    mirrored : bool
        Whether `pattern` is a mirrored one.

    Returns
    -------
    list of Answer
        All costs 0. One for each group of documents, also for those without hits.
    """
    several = archive.each_file(partial(_evaluate, pattern, mode, mismatches))
    return [
        _answer(place, found, label, mirrored)
        for place, hits in zip(archive.files, several, strict=True)
        for found in hits
    ]


def _evaluate(
    pattern: Pattern, mode: str, mismatches: int, source: Source, groups: Sequence[DocumentGroup]
) -> list[GroupHits]:
    """Find a pattern in one segment file; runs in any process."""
    found = evaluate(pattern, mode, source, groups, mismatches)
    for hits in found:
        lengths = source.lengths[hits.documents]
        if (np.diff(hits.bounds) < 0).any() or (hits.bounds[:, -1] > lengths).any():
            raise ValueError("hits leave their documents")  # only where the runs do
    return found


def _answer(place: LookedAt, found: GroupHits, label: str, mirrored: bool) -> Answer:
    bounds, documents = found.bounds, found.documents
    if found.pattern is not None:
        clear = told(place.file.documents, documents, bounds[:, [0, -1]], found.pattern.mask)
        bounds, documents = bounds[clear], documents[clear]
    return Answer(
        place,
        documents,
        bounds[:, [0, -1]],
        label,
        mirrored,
        found.pattern,
        bounds,
        np.zeros(len(bounds)),
        found.group,
    )


def untrusted_remarks(
    feature_set: FeatureSet, answers: Iterable[Answer], mask: int
) -> Iterator[str]:
    """Say which documents were asked less than everything because of their skeletons.

    Parameters
    ----------
    feature_set : FeatureSet
    answers : iterable of Answer
        Of one question.
    mask : int
        The features of the question.

    Yields
    ------
    str
    """
    counts: dict[tuple[int, bool], int] = {}
    for answer in answers:
        if unknown := answer.group.untrusted & mask:
            key = (unknown, answer.pattern is None)
            counts[key] = counts.get(key, 0) + len(answer.group.documents)
    for (unknown, refused), number in counts.items():
        names = feature_ranges(feature_set, unknown)
        several = count(number, "document")
        whose = "its skeleton" if number == 1 else "their skeletons"
        if refused:
            yield f"{several} can't be asked: {whose} can't tell {names}"
        else:
            left, it = ("are", "them") if unknown.bit_count() > 1 else ("is", "it")
            yield f"in {several} {names} {left} left open: {whose} can't tell {it}"


def feature_names(feature_set: FeatureSet, mask: int) -> str:
    """Name the features of a mask by their ids, as a selection does."""
    return ", ".join(id for bit, id in enumerate(feature_set.ids) if mask >> bit & 1)


def feature_ranges(feature_set: FeatureSet, mask: int) -> str:
    """Name the features of a mask for people: three and more in a row by the first and last."""
    names: list[str] = []
    bits = [bit for bit in range(len(feature_set.ids)) if mask >> bit & 1]
    for _, row in groupby(enumerate(bits), lambda entry: entry[1] - entry[0]):
        ids = [feature_set.ids[bit] for _, bit in row]
        names += [f"{ids[0]} to {ids[-1]}"] if len(ids) > 2 else ids
    return ", ".join(names)
