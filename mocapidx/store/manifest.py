"""The records of a manifest, and what they imply.

Everything that a reader takes from a segment file stands here with its place and its digest,
so that bytes are checked before anything looks at them.
"""

import hashlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

from mocapidx.durable import Chunk
from mocapidx.store import schema

__all__ = [
    "Dataset",
    "Document",
    "FileRecord",
    "Manifest",
    "Placed",
    "Rig",
    "SegmentFile",
    "StoreSettings",
    "block_count",
    "block_digest",
    "file_digest",
    "segment_names",
]

Rig: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class StoreSettings:
    """What holds for every document of a store and never changes.

    Parameters
    ----------
    rate : float
        Frames a second, in Hz.
    feature_set_name : str
        Name of the feature set.
    feature_set_digest : str
        Its digest, in hexadecimal.
    feature_set_text : str
        Its whole text.
    poses : bool
        Whether joint positions are kept.
    """

    rate: float
    feature_set_name: str
    feature_set_digest: str
    feature_set_text: str
    poses: bool = True


@dataclass(frozen=True, slots=True)
class Document:
    """One motion file as the store knows it.

    Parameters
    ----------
    name : str
        Unique among the live documents; undecodable bytes as lone surrogates.
    root : str
        Absolute folder under which the file was found.
    path : str or None
        Its path below `root`; None where that is the name.
    digest : str
        Of the source, in hexadecimal; the caller chooses what it covers.
    size : int
        Of the source, in bytes.
    mtime_ns : int
        Modification time of the source, in nanoseconds.
    frames : int
        Frames at the store's rate.
    source_frames : int
        Frames of the source.
    source_rate : float
        In Hz.
    rig : mapping
        Any JSON object; what many documents share (conventions, untrusted features) and the
        store keeps once.
    live : bool
        False where the document was removed or replaced and only its numbers remain.
    facts : mapping of str to str
        What its name tells: actor, class and the like, as whoever indexed it has said.
    """

    name: str
    root: str
    path: str | None
    digest: str
    size: int
    mtime_ns: int
    frames: int
    source_frames: int
    source_rate: float
    rig: Rig
    live: bool = True
    facts: Mapping[str, str] = field(default_factory=dict)

    @property
    def source(self) -> Path:
        """Where the motion file was when it was indexed."""
        return Path(self.root, self.name if self.path is None else self.path)


@dataclass(frozen=True, slots=True)
class Dataset:
    """Where one dataset lies in its file, and the digests of its blocks.

    Parameters
    ----------
    shape : tuple of int
        Rows first.
    offset : int
        Of the first byte in the file.
    blocks : str
        The digest of each MiB, end to end, in hexadecimal.
    """

    shape: tuple[int, ...]
    offset: int
    blocks: str


@dataclass(frozen=True, slots=True)
class FileRecord:
    """Size in bytes and digest of a file, or of its beginning."""

    size: int
    digest: str


@dataclass(frozen=True, slots=True)
class SegmentFile:
    """One immutable part of a store: an HDF5 file and its index; holds no open handle.

    Parameters
    ----------
    number : int
        Gives both files their names.
    h5, idx, head : FileRecord
        The HDF5 file, the index, and the beginning of the index that says where its lists lie.
    datasets : mapping of str to Dataset
        By name.
    documents : tuple of Document
        In the order in which their frames lie.
    """

    number: int
    h5: FileRecord
    idx: FileRecord
    head: FileRecord
    datasets: Mapping[str, Dataset]
    documents: tuple[Document, ...]

    @property
    def names(self) -> tuple[str, str]:
        """Names of the HDF5 file and the index in the folder of segments."""
        return segment_names(self.number)

    @property
    def frames(self) -> int:
        """Frames of all documents, dead ones too."""
        return sum(document.frames for document in self.documents)

    def placed(self) -> Iterator["Placed"]:
        """Every document, dead ones too, with its place.

        Yields
        ------
        Placed
            In the order in which their frames lie.
        """
        offset = 0
        for ordinal, document in enumerate(self.documents):
            yield Placed(document, self, ordinal, offset)
            offset += document.frames

    def without(self, names: Collection[str]) -> "SegmentFile":
        """Bury documents; their frames and numbers stay until the file is merged.

        Parameters
        ----------
        names : collection of str
            Of documents, which may lie in other files.

        Returns
        -------
        SegmentFile
            This one where none of them lives in it.
        """
        if not any(entry.live and entry.name in names for entry in self.documents):
            return self
        documents = tuple(
            replace(entry, live=False) if entry.name in names else entry for entry in self.documents
        )
        return replace(self, documents=documents)


@dataclass(frozen=True, slots=True)
class Placed:
    """A document and its place in its segment file.

    Parameters
    ----------
    document : Document
        The record.
    file : SegmentFile
        The file that holds it.
    ordinal : int
        Its number in the file, from 0.
    frame_offset : int
        Frames of the documents before it.
    """

    document: Document
    file: SegmentFile
    ordinal: int
    frame_offset: int

    @property
    def first(self) -> int:
        """Position of its first frame; one position is left free between documents."""
        return self.frame_offset + self.ordinal


@dataclass(frozen=True, slots=True)
class Manifest:
    """All that a store holds, as of one commit.

    Parameters
    ----------
    settings : StoreSettings
        What never changes.
    files : tuple of SegmentFile
        In the order of their numbers.
    generation : int
        Commits so far.
    next_number : int
        The next segment file's; a number is never used twice.
    """

    settings: StoreSettings
    files: tuple[SegmentFile, ...] = field(default=())
    generation: int = 0
    next_number: int = 1

    def documents(self) -> Iterator[Placed]:
        """Every live document with its place.

        Yields
        ------
        Placed
            File by file, in the order in which their frames lie.
        """
        for file in self.files:
            yield from (entry for entry in file.placed() if entry.document.live)


def file_digest(data: Chunk = b"") -> "hashlib.blake2b":
    """Begin the digest of a whole file: BLAKE2b, 256 bits.

    Parameters
    ----------
    data : bytes
        Its beginning.

    Returns
    -------
    hash object
        To be fed with the rest.
    """
    return hashlib.blake2b(data, digest_size=32)


def block_digest(block: Chunk) -> str:
    """Digest of one block of a dataset: BLAKE2b, 128 bits.

    Parameters
    ----------
    block : bytes
        `schema.BLOCK` bytes, or fewer at the end.

    Returns
    -------
    str
        32 hexadecimal digits.
    """
    return hashlib.blake2b(block, digest_size=16).hexdigest()


def block_count(size: int) -> int:
    """Count the blocks that bytes take.

    Parameters
    ----------
    size : int
        Of a dataset, in bytes.

    Returns
    -------
    int
        The last one may be short.
    """
    return -(-size // schema.BLOCK)


def segment_names(number: int) -> tuple[str, str]:
    """Name the two files of a segment file.

    Parameters
    ----------
    number : int
        Of the segment file.

    Returns
    -------
    tuple of str
        The HDF5 file and the index.
    """
    return f"{number:06d}.h5", f"{number:06d}.idx"
