"""Pieces of a store that other processes read for themselves.

A piece holds what the reader's own snapshot says of it, with the digests of all its bytes: who
gets one reads the same commit, or learns that it is gone.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from mocapidx.store.manifest import Manifest, Placed, SegmentFile, StoreSettings
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import SEGMENTS
from mocapidx.tasks.store_words import WordBatch, neighbour_batches, neighbouring

__all__ = ["WordPiece", "piece_snapshot", "without_documents", "word_pieces"]


@dataclass(frozen=True, slots=True, eq=False)
class WordPiece:
    """Neighbouring documents of a segment file, whose feature words are to be read.

    Parameters
    ----------
    store : Path
        Absolute.
    settings : StoreSettings
    file : SegmentFile
        Without its documents.
    documents : tuple of Placed
        All of `file`.
    """

    store: Path
    settings: StoreSettings
    file: SegmentFile
    documents: tuple[Placed, ...]

    @property
    def weight(self) -> int:
        """Bytes of its words."""
        return 8 * sum(placed.document.frames for placed in self.documents)

    @property
    def path(self) -> Path:
        """The file that its words lie in."""
        return self.store / SEGMENTS / self.file.names[0]

    def batches(self) -> Iterator[WordBatch]:
        """Read its words.

        Yields
        ------
        WordBatch
            As `store_batches` gives them.

        Raises
        ------
        StoreError
            If the file is gone or damaged.
        """
        with piece_snapshot(self.store, self.settings, self.file) as snapshot:
            yield from neighbour_batches(snapshot, self.documents)


def word_pieces(snapshot: Snapshot) -> Iterator[WordPiece]:
    """Divide the words of a store into pieces that are read at once.

    Parameters
    ----------
    snapshot : Snapshot

    Yields
    ------
    WordPiece
        In the order of the store.
    """
    store, settings = snapshot.path.absolute(), snapshot.manifest.settings
    for neighbours in neighbouring(snapshot):
        file = without_documents(neighbours[0].file)
        documents = tuple(replace(placed, file=file) for placed in neighbours)
        yield WordPiece(store, settings, file, documents)


def without_documents(file: SegmentFile) -> SegmentFile:
    """Leave of a segment file's record what its bytes are read by."""
    return replace(file, documents=())


def piece_snapshot(store: Path, settings: StoreSettings, file: SegmentFile) -> Snapshot:
    """Give one segment file of a store to read from; nothing is opened yet."""
    return Snapshot(store, Manifest(settings, (file,)))
