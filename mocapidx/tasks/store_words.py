"""The feature words of a store, piece by piece, for templates of the same feature set."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.errors import StoreError
from mocapidx.model import IndexArray, WordArray
from mocapidx.printable import shown
from mocapidx.store.manifest import Document, Placed, SegmentFile
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.segment_sources import untrusted_mask
from mocapidx.templates.template import TemplateSet

__all__ = ["WordBatch", "check_store", "document_words", "store_batches"]

BATCH_FRAMES: Final = 1 << 19
"""Frames that are read and matched together: 4 MiB of words."""


@dataclass(frozen=True, slots=True, eq=False)
class WordBatch:
    """Documents of one segment file end to end, all with the same untrusted features.

    Parameters
    ----------
    documents : tuple of Document
    file : SegmentFile
        The file that they stand in.
    ordinals : ndarray of int64, shape (D,)
        Their numbers in the file.
    words : ndarray of uint64, shape (T,)
    bounds : ndarray of int64, shape (D + 1,)
        In frames; document ``d`` is ``bounds[d]`` up to, not including, ``bounds[d + 1]``.
    untrusted : int
        Mask of the features that the documents can't tell.
    """

    documents: tuple[Document, ...]
    file: SegmentFile
    ordinals: IndexArray
    words: WordArray
    bounds: IndexArray
    untrusted: int

    def select(self, documents: IndexArray) -> "WordBatch":
        """Leave some of the documents, given by their numbers in this batch, ascending."""
        spans = [slice(self.bounds[d], self.bounds[d + 1]) for d in documents.tolist()]
        words = np.concatenate([self.words[span] for span in spans])
        lengths = np.diff(self.bounds)[documents]
        return WordBatch(
            tuple(self.documents[d] for d in documents.tolist()),
            self.file,
            self.ordinals[documents],
            words,
            np.concatenate(([0], np.cumsum(lengths))),
            self.untrusted,
        )


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
    words = _read(store, piece)
    bounds = np.concatenate(([0], np.cumsum([len(each) for each in words]))).astype(np.int64)
    return WordBatch(
        tuple(placed.document for placed in piece),
        piece[0].file,
        np.array([placed.ordinal for placed in piece], dtype=np.int64),
        np.concatenate(words),
        bounds,
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
