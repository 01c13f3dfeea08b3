"""The feature words of a store, piece by piece, for templates of the same feature set."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.errors import StoreError
from mocapidx.model import BoolArray, IndexArray, WordArray
from mocapidx.printable import shown
from mocapidx.store.manifest import Document, Placed, SegmentFile
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.segment_sources import untrusted_mask
from mocapidx.templates.keyframes import Pieces
from mocapidx.templates.template import TemplateSet

__all__ = ["WordBatch", "check_store", "document_words", "piece_batches", "store_batches"]

BATCH_FRAMES: Final = 1 << 19
"""Frames that are read and matched together: 4 MiB of words."""


@dataclass(frozen=True, slots=True, eq=False)
class WordBatch:
    """Documents, or pieces of them, end to end, all with the same untrusted features.

    Parameters
    ----------
    documents : tuple of Document
        Of one segment file; one with several pieces stands several times.
    starts : ndarray of int64, shape (D,)
        The first frame of each piece in its document.
    words : ndarray of uint64, shape (T,)
    bounds : ndarray of int64, shape (D + 1,)
        In frames; piece ``d`` is ``bounds[d]`` up to, not including, ``bounds[d + 1]``.
    untrusted : int
        Mask of the features that the documents can't tell.
    """

    documents: tuple[Document, ...]
    starts: IndexArray
    words: WordArray
    bounds: IndexArray
    untrusted: int

    @property
    def at_ends(self) -> tuple[BoolArray, BoolArray]:
        """Which pieces begin and which end where their document does, each of shape (D,)."""
        ends = self.starts + np.diff(self.bounds)
        return self.starts == 0, ends == [document.frames for document in self.documents]

    def select(self, numbers: IndexArray) -> "WordBatch":
        """Leave some of the pieces, given by their numbers, ascending."""
        words = [self.words[self.bounds[n] : self.bounds[n + 1]] for n in numbers.tolist()]
        documents = tuple(self.documents[n] for n in numbers.tolist())
        return _joined(documents, self.starts[numbers], words, self.untrusted)


def check_store(store: Snapshot, templates: TemplateSet) -> None:
    """Refuse a store of another feature set or rate than the templates.

    Raises
    ------
    StoreError
        With what the two are, and what to do.
    """
    settings = store.manifest.settings
    if settings.feature_set_digest != templates.feature_set_digest:
        raise StoreError(
            f"{shown(store.path)}: made with feature set '{shown(settings.feature_set_name)}' "
            f"({settings.feature_set_digest[:8]}), the templates with "
            f"'{shown(templates.feature_set_name)}' ({templates.feature_set_digest[:8]}); "
            "index again with theirs, or learn again"
        )
    if settings.rate != templates.rate:
        raise StoreError(
            f"{shown(store.path)}: has {settings.rate:g} frames/s, the templates "
            f"{templates.rate:g}; index again at their rate, or learn again"
        )


def store_batches(store: Snapshot) -> Iterator[WordBatch]:
    """Read all live documents of a store, a bounded number of frames at a time.

    Parameters
    ----------
    store : Snapshot

    Yields
    ------
    WordBatch
        Neighbours with the same untrusted features go together.
    """
    for file in store.files:
        live = (placed for placed in file.placed() if placed.document.live)
        pieces = itertools.groupby(
            live, lambda p: (p.frame_offset // BATCH_FRAMES, untrusted_mask(p.document))
        )
        for (_, untrusted), piece in pieces:
            yield _batch(store, list(piece), untrusted)


def _batch(store: Snapshot, piece: Sequence[Placed], untrusted: int) -> WordBatch:
    documents = tuple(placed.document for placed in piece)
    starts = np.zeros(len(piece), dtype=np.int64)
    return _joined(documents, starts, _read(store, piece), untrusted)


def _joined(
    documents: tuple[Document, ...], starts: IndexArray, words: Sequence[WordArray], untrusted: int
) -> WordBatch:
    bounds = np.concatenate(([0], np.cumsum([len(each) for each in words]))).astype(np.int64)
    return WordBatch(documents, starts, np.concatenate(words), bounds, untrusted)


def piece_batches(
    store: Snapshot, file: SegmentFile, pieces: Pieces, untrusted: int
) -> Iterator[WordBatch]:
    """Read pieces of documents of one segment file, a bounded number of frames at a time.

    Parameters
    ----------
    store : Snapshot
    file : SegmentFile
    pieces : Pieces
    untrusted : int
        Mask of the features that their documents can't tell.

    Yields
    ------
    WordBatch
    """
    placed = list(file.placed())
    rows = zip(pieces.documents.tolist(), pieces.starts.tolist(), pieces.ends.tolist(), strict=True)
    near = itertools.groupby(
        rows, lambda row: (placed[row[0]].frame_offset + row[1]) // BATCH_FRAMES
    )
    for _, some in near:
        group = list(some)
        first, last = group[0], group[-1]
        start = placed[first[0]].frame_offset + first[1]
        stop = placed[last[0]].frame_offset + last[2]
        words = store.array(file, FRAME_WORDS.path, start, stop).astype(np.uint64)
        parts = [
            words[placed[document].frame_offset + low - start :][: high - low]
            for document, low, high in group
        ]
        yield _joined(
            tuple(placed[document].document for document, _, _ in group),
            np.array([low for _, low, _ in group], dtype=np.int64),
            parts,
            untrusted,
        )


def document_words(store: Snapshot, documents: Iterable[Placed]) -> list[WordArray]:
    """Read the feature words of some documents.

    Parameters
    ----------
    store : Snapshot
    documents : iterable of Placed
        In the order of the store.

    Returns
    -------
    list of ndarray of uint64, each of shape (T,)
    """
    pieces = itertools.groupby(documents, lambda p: (p.file.number, p.frame_offset // BATCH_FRAMES))
    return [words for _, piece in pieces for words in _read(store, list(piece))]


def _read(store: Snapshot, piece: Sequence[Placed]) -> list[WordArray]:
    """Read neighbours at one go: whatever is read costs the digest of whole blocks."""
    start = piece[0].frame_offset
    stop = piece[-1].frame_offset + piece[-1].document.frames
    words = store.array(piece[0].file, FRAME_WORDS.path, start, stop).astype(np.uint64)
    return [words[placed.frame_offset - start :][: placed.document.frames] for placed in piece]
