"""Segment files as other processes ask them: a query is a map over them, and a merge."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, TypeVar

import numpy as np

from mocapidx.features.featureset import FeatureSet
from mocapidx.model import IndexArray
from mocapidx.queries.evaluate import DocumentGroup
from mocapidx.queries.source import Source
from mocapidx.store.manifest import SegmentFile
from mocapidx.store.read import Snapshot
from mocapidx.tasks.segment_sources import segment_source
from mocapidx.tasks.store_pieces import FilePlace, file_place

__all__ = ["FilePiece", "Question", "answer_of_file", "file_piece"]

Result = TypeVar("Result")
Question: TypeAlias = Callable[[Source, Sequence[DocumentGroup]], Result]


@dataclass(frozen=True, slots=True, eq=False)
class FilePiece:
    """A segment file whose runs and inverted lists are to be asked.

    Parameters
    ----------
    place : FilePlace
    lengths : ndarray of int64, shape (D,)
        Frames of its documents.
    feature_set : FeatureSet
        The store's.
    groups : sequence of DocumentGroup
        The documents that count.
    """

    place: FilePlace
    lengths: IndexArray
    feature_set: FeatureSet
    groups: Sequence[DocumentGroup]

    @property
    def weight(self) -> int:
        """Bytes of its inverted lists."""
        return self.place.file.idx.size

    @property
    def path(self) -> Path:
        """The file of these lists."""
        return self.place.paths[1]


def file_piece(
    snapshot: Snapshot, file: SegmentFile, feature_set: FeatureSet, groups: Sequence[DocumentGroup]
) -> FilePiece:
    """Give a segment file as other processes ask it.

    Parameters
    ----------
    snapshot : Snapshot
    file : SegmentFile
        One of the snapshot's.
    feature_set : FeatureSet
        The store's.
    groups : sequence of DocumentGroup
        The documents that count.

    Returns
    -------
    FilePiece
    """
    lengths = np.array([document.frames for document in file.documents], np.int64)
    return FilePiece(file_place(snapshot, file), lengths, feature_set, groups)


def answer_of_file(question: Question[Result], piece: FilePiece) -> Result:
    """Ask one segment file; runs in any process.

    Parameters
    ----------
    question : callable
        From a file's runs and lists, and the documents that count, to any answer.
    piece : FilePiece

    Returns
    -------
    object
        The answer.
    """
    with piece.place.snapshot() as snapshot:
        source = segment_source(snapshot, piece.place.file, piece.feature_set, piece.lengths)
        return question(source, piece.groups)
