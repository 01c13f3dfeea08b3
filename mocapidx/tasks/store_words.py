"""The feature words of a store, piece by piece, for templates of the same feature set."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mocapidx.errors import StoreError
from mocapidx.model import BoolArray, IndexArray, WordArray
from mocapidx.printable import shown
from mocapidx.queries.source import expand_ranges
from mocapidx.store.manifest import Document, Placed, SegmentFile
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.segment_sources import untrusted_mask
from mocapidx.tasks.unspecified import UNSPECIFIED, specified_pieces
from mocapidx.templates.keyframes import Pieces
from mocapidx.templates.template import TemplateSet

__all__ = [
    "WordBatch",
    "check_store",
    "cut_at_gaps",
    "document_words",
    "neighbour_batches",
    "neighbouring",
    "piece_batches",
    "store_batches",
]

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
    def weight(self) -> int:
        """Bytes of its words."""
        return int(self.words.nbytes)

    @property
    def at_ends(self) -> tuple[BoolArray, BoolArray]:
        """Which pieces begin and which end where their document does, each of shape (D,)."""
        ends = self.starts + np.diff(self.bounds)
        return self.starts == 0, ends == [document.frames for document in self.documents]

    def select(self, numbers: IndexArray) -> "WordBatch":
        """Leave some of the pieces, given by their numbers."""
        lengths = np.diff(self.bounds)[numbers]
        return self.cut(numbers, np.zeros_like(lengths), lengths)

    def cut(self, numbers: IndexArray, starts: IndexArray, ends: IndexArray) -> "WordBatch":
        """Leave stretches of some pieces, by the pieces' numbers and in frames of the pieces."""
        first = self.bounds[numbers]
        owners, frames = expand_ranges(first + starts, first + ends)
        bounds = np.searchsorted(owners, np.arange(len(numbers) + 1))
        documents = tuple(self.documents[number] for number in numbers.tolist())
        return WordBatch(
            documents, self.starts[numbers] + starts, self.words[frames], bounds, self.untrusted
        )


def cut_at_gaps(batch: WordBatch) -> Iterator[WordBatch]:
    """Cut documents where what can be told of them changes, so that no match goes across.

    Parameters
    ----------
    batch : WordBatch

    Yields
    ------
    WordBatch
        The same one where no document has gaps; else one for each mask.
    """
    if not any(UNSPECIFIED in document.rig for document in batch.documents):
        yield batch
        return
    lengths = np.diff(batch.bounds)
    rows: dict[int, list[tuple[int, int, int]]] = {}
    for number, document in enumerate(batch.documents):
        first, length = int(batch.starts[number]), int(lengths[number])
        for start, end, mask in specified_pieces(document):
            low, high = max(start - first, 0), min(end - first, length)
            if low < high:
                rows.setdefault(mask, []).append((number, low, high))
    for mask, pieces in rows.items():
        numbers, starts, ends = np.array(pieces, dtype=np.int64).T
        yield replace(batch.cut(numbers, starts, ends), untrusted=batch.untrusted | mask)


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
    for neighbours in neighbouring(store):
        yield from neighbour_batches(store, neighbours)


def neighbouring(store: Snapshot) -> Iterator[Sequence[Placed]]:
    """Group the live documents of each segment file by where they lie.

    Parameters
    ----------
    store : Snapshot

    Yields
    ------
    sequence of Placed
        As many as are read at once.
    """
    for file in store.files:
        live = (placed for placed in file.placed() if placed.document.live)
        for _, near in itertools.groupby(live, lambda p: p.frame_offset // BATCH_FRAMES):
            yield list(near)


def neighbour_batches(store: Snapshot, neighbours: Iterable[Placed]) -> Iterator[WordBatch]:
    """Read neighbours of one segment file.

    Parameters
    ----------
    store : Snapshot
    neighbours : iterable of Placed
        A group of `neighbouring`.

    Yields
    ------
    WordBatch
    """
    alike = itertools.groupby(neighbours, lambda p: untrusted_mask(p.document))
    for untrusted, piece in alike:
        yield from cut_at_gaps(_batch(store, list(piece), untrusted))


def _batch(store: Snapshot, piece: Sequence[Placed], untrusted: int) -> WordBatch:
    start, words = _read(store, piece)
    documents = tuple(placed.document for placed in piece)
    lengths = np.array([document.frames for document in documents])
    bounds = np.concatenate(([0], np.cumsum(lengths)))
    if len(words) > bounds[-1]:  # documents that were removed lie between
        first = np.array([placed.frame_offset for placed in piece]) - start
        words = words[expand_ranges(first, first + lengths)[1]]
    return WordBatch(documents, np.zeros_like(lengths), words, bounds, untrusted)


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
    lengths = [document.frames for document in file.documents]
    offsets = np.concatenate(([0], np.cumsum(lengths)))[pieces.documents]
    lows, highs = offsets + pieces.starts, offsets + pieces.ends
    borders = np.flatnonzero(np.diff(lows // BATCH_FRAMES, prepend=-1)).tolist()
    for first, last in itertools.pairwise([*borders, len(lows)]):
        some = slice(first, last)
        start, stop = int(lows[first]), int(highs[last - 1])
        words = _words(store, file, start, stop)
        owners, frames = expand_ranges(lows[some] - start, highs[some] - start)
        batch = WordBatch(
            tuple(file.documents[number] for number in pieces.documents[some].tolist()),
            pieces.starts[some],
            words[frames],
            np.searchsorted(owners, np.arange(last - first + 1)),
            untrusted,
        )
        yield from cut_at_gaps(batch)


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
    near = itertools.groupby(documents, lambda p: (p.file.number, p.frame_offset // BATCH_FRAMES))
    return [words for _, piece in near for words in _each(store, list(piece))]


def _each(store: Snapshot, piece: Sequence[Placed]) -> Iterator[WordArray]:
    start, words = _read(store, piece)
    for placed in piece:
        yield words[placed.frame_offset - start :][: placed.document.frames]


def _read(store: Snapshot, piece: Sequence[Placed]) -> tuple[int, WordArray]:
    """Read neighbours at one go: whatever is read costs the digest of whole blocks."""
    start = piece[0].frame_offset
    stop = piece[-1].frame_offset + piece[-1].document.frames
    return start, _words(store, piece[0].file, start, stop)


def _words(store: Snapshot, file: SegmentFile, start: int, stop: int) -> WordArray:
    return store.array(file, FRAME_WORDS.path, start, stop).astype(np.uint64, copy=False)
