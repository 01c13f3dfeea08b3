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

__all__ = ["FilePlace", "WordPiece", "file_place", "word_pieces"]


@dataclass(frozen=True, slots=True, eq=False)
class FilePlace:
    """Where a segment file is, and what its bytes are.

    Parameters
    ----------
    store : Path
        Absolute.
    settings : StoreSettings
    file : SegmentFile
        Without its documents.
    """

    store: Path
    settings: StoreSettings
    file: SegmentFile

    @property
    def paths(self) -> tuple[Path, Path]:
        """The HDF5 file and the index."""
        words, lists = self.file.names
        return self.store / SEGMENTS / words, self.store / SEGMENTS / lists

    def snapshot(self) -> Snapshot:
        """Give the store with this file alone; nothing is opened yet."""
        return Snapshot(self.store, Manifest(self.settings, (self.file,)))


def file_place(snapshot: Snapshot, file: SegmentFile) -> FilePlace:
    """Say what another process needs to read a segment file.

    Parameters
    ----------
    snapshot : Snapshot
    file : SegmentFile
        One of the snapshot's.

    Returns
    -------
    FilePlace
    """
    bare = replace(file, documents=())
    return FilePlace(snapshot.path.absolute(), snapshot.manifest.settings, bare)


@dataclass(frozen=True, slots=True, eq=False)
class WordPiece:
    """Neighbouring documents of a segment file, whose feature words are to be read.

    Parameters
    ----------
    place : FilePlace
    documents : tuple of Placed
        All of the file in `place`.
    """

    place: FilePlace
    documents: tuple[Placed, ...]

    @property
    def weight(self) -> int:
        """Bytes of its words."""
        return 8 * sum(placed.document.frames for placed in self.documents)

    @property
    def path(self) -> Path:
        """The file that its words lie in."""
        return self.place.paths[0]

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
        with self.place.snapshot() as snapshot:
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
    for neighbours in neighbouring(snapshot):
        place = file_place(snapshot, neighbours[0].file)
        yield WordPiece(place, tuple(replace(placed, file=place.file) for placed in neighbours))
