"""Inverted lists of the sub-indexes in one file: a directory, then the lists.

The list L(v) of a word v holds the numbers of the runs that have this word. The file is::

    magic line | sizes | directory of each part | lists of the first part, of the second, ...

A list is a serialised roaring bitmap, or plain uint32 numbers where it has fewer than eight.
The magic line and the directories are its *head*; who opens the file vouches for the head,
and the head has a digest of each list, so that no list is decoded that isn't the one written.
All numbers are little-endian; equal runs give equal bytes.
"""

import array
import hashlib
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pyroaring import BitMap

from mocapidx.errors import StoreError
from mocapidx.index.build import FREE_WORD
from mocapidx.model import IndexArray
from mocapidx.printable import shown

__all__ = ["InvertedLists", "encode_index", "open_index"]

MAGIC: Final = b"mocapidx-lists 1\n"
HEADER: Final = struct.Struct("<QI")  # bytes of the head, number of parts
PART: Final = struct.Struct("<16sII")  # name, run numbers, words in the directory
DIGEST_SIZE: Final = 16
ENTRY: Final = np.dtype(  # of the directory, in ascending order of the words
    [("word", "<u4"), ("count", "<u4"), ("size", "<u4"), ("digest", "u1", (DIGEST_SIZE,))]
)
PLAIN: Final = 8
"""Fewer numbers than this take less room as they are than as a bitmap."""
GAP: Final = 4096
"""Lists this many bytes apart are still read at one go."""


def encode_index(parts: Mapping[str, NDArray[np.uint32]]) -> tuple[bytes, int]:
    """Build the inverted lists of the sub-indexes of one segment file.

    Parameters
    ----------
    parts : mapping of str to ndarray of uint32, each of shape (R,)
        The run words of each sub-index, as `mocapidx.index.build.build_runs` gives them.

    Returns
    -------
    data : bytes
        The whole file.
    head_size : int
        Its first bytes that `open_index` needs.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 5.1, equation 6, and section 5.3.
    """
    directories, blobs = [], []
    for name, words in parts.items():
        entries, lists = _encode_part(words)
        directories.append(PART.pack(name.encode("ascii"), len(words), len(entries)))
        directories.append(entries.tobytes())
        blobs += lists
    directory = b"".join(directories)
    head_size = len(MAGIC) + HEADER.size + len(directory)
    head = MAGIC + HEADER.pack(head_size, len(parts)) + directory
    return head + b"".join(blobs), head_size


def _encode_part(words: NDArray[np.uint32]) -> tuple[NDArray[np.void], list[bytes]]:
    """Give the directory and the serialised lists of one sub-index."""
    order = np.argsort(words, kind="stable").astype(np.uint32)
    distinct, firsts = np.unique(words[order], return_index=True)
    groups = np.split(order, firsts[1:])[: np.count_nonzero(distinct != FREE_WORD)]
    lists = [_encode_list(group) for group in groups]
    entries = np.zeros(len(lists), ENTRY)
    for entry, word, group, data in zip(entries, distinct, groups, lists, strict=False):
        entry["word"], entry["count"], entry["size"] = word, len(group), len(data)
        entry["digest"] = np.frombuffer(_digest(data), np.uint8)
    return entries, lists


def _encode_list(numbers: NDArray[np.uint32]) -> bytes:
    if len(numbers) < PLAIN:
        return numbers.astype("<u4").tobytes()
    return BitMap(array.array("I", numbers.tobytes())).serialize()


def _decode_list(data: bytes, count: int) -> BitMap:
    if count < PLAIN:
        return BitMap(np.frombuffer(data, "<u4").tolist())
    return BitMap.deserialize(data)


def _digest(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=DIGEST_SIZE).digest()


def open_index(
    head: bytes, read: Callable[[int, int], bytes], size: int, name: str = "index"
) -> "dict[str, InvertedLists]":
    """Open the inverted lists of a segment file; no list is read yet.

    Parameters
    ----------
    head : bytes
        The first bytes of the file, of known origin (the store checks them by digest).
    read : callable
        ``read(offset, size)`` gives that many bytes of the file from `offset` on.
    size : int
        Bytes of the whole file.
    name : str
        What messages call the file.

    Returns
    -------
    dict of str to InvertedLists
        One for each sub-index, by its name.

    Raises
    ------
    StoreError
        If the head is not one, or is not of this file.
    """
    start = len(MAGIC) + HEADER.size
    if head[: len(MAGIC)] != MAGIC or len(head) < start:
        raise StoreError(f"{name}: not an index file of this version; run 'mocapidx verify'")
    head_size, parts = HEADER.unpack_from(head, len(MAGIC))
    if head_size != len(head):
        raise StoreError(f"{name}: its head should have {head_size} bytes, has {len(head)}")
    lists: dict[str, InvertedLists] = {}
    place, offset = start, head_size
    for _ in range(parts):
        if place + PART.size > len(head):
            raise StoreError(f"{name}: the directory is cut off after {len(lists)} sub-indexes")
        raw, runs, count = PART.unpack_from(head, place)
        place += PART.size
        if place + count * ENTRY.itemsize > len(head):
            raise StoreError(f"{name}: the directory is cut off: {count} lists do not fit")
        entries = np.frombuffer(head, ENTRY, count, place)
        part = shown(raw.rstrip(b"\0").decode("ascii", "backslashreplace"))
        lists[part] = InvertedLists(entries, runs, offset, read, f"{name}: {part}")
        place += count * ENTRY.itemsize
        offset += int(entries["size"].sum(dtype=np.int64))
    if len(lists) != parts or place != len(head) or offset != size:
        raise StoreError(
            f"{name}: the directory describes {offset} bytes, the file has {size}; "
            "run 'mocapidx verify --repair'"
        )
    return lists


class InvertedLists:
    """The inverted lists of one sub-index, read when asked for and kept.

    Parameters
    ----------
    entries : structured ndarray, shape (W,)
        The directory.
    runs : int
        Run numbers of the sub-index, free ones included.
    offset : int
        Where the first list begins in the file.
    read : callable
        ``read(offset, size)`` gives bytes of the file.
    name : str
        What messages call the lists.

    Attributes
    ----------
    words : ndarray of uint32, shape (W,)
        The distinct words, ascending.
    counts : ndarray of int64, shape (W,)
        Runs of each word.
    runs : int
        As above.
    size : int
        Bytes of all the lists together.

    Raises
    ------
    StoreError
        If the directory contradicts itself.
    """

    def __init__(
        self,
        entries: NDArray[np.void],
        runs: int,
        offset: int,
        read: Callable[[int, int], bytes],
        name: str,
    ) -> None:
        self.words: NDArray[np.uint32] = np.ascontiguousarray(entries["word"])
        self.counts: IndexArray = entries["count"].astype(np.int64)
        self.runs = runs
        self.size = int(entries["size"].sum(dtype=np.int64))
        self._ends = offset + np.cumsum(entries["size"], dtype=np.int64)
        self._starts = self._ends - entries["size"]
        self._digests = entries["digest"]
        self._read = read
        self._name = name
        self._kept: dict[int, BitMap] = {}
        words, counts = self.words, self.counts
        if (words[1:] <= words[:-1]).any() or (words == FREE_WORD).any():
            raise StoreError(f"{name}: the words of the directory are not ascending")
        if (counts < 1).any() or counts.sum() > runs:
            raise StoreError(f"{name}: the lists have {counts.sum()} entries for {runs} runs")

    def lists(self, indices: Sequence[int] | IndexArray) -> list[BitMap]:
        """Give the lists of words, by their places in `words`; they must not be changed.

        Parameters
        ----------
        indices : sequence of int, shape (N,)
            Places in `words`.

        Returns
        -------
        list of BitMap
            The run numbers of each.

        Raises
        ------
        StoreError
            If a list is not the one that was written.
        """
        wanted = [int(index) for index in indices]
        missing = sorted({index for index in wanted if index not in self._kept})
        for neighbours in self._neighbours(missing):
            self._fetch(neighbours)
        return [self._kept[index] for index in wanted]

    def missing(self, indices: IndexArray) -> int:
        """Count the lists among `indices` that would have to be read."""
        return (
            sum(int(index) not in self._kept for index in indices) if self._kept else len(indices)
        )

    def _neighbours(self, indices: list[int]) -> list[list[int]]:
        """Split ascending places into groups whose lists lie close together in the file."""
        groups: list[list[int]] = []
        for index in indices:
            if groups and self._starts[index] - self._ends[groups[-1][-1]] <= GAP:
                groups[-1].append(index)
            else:
                groups.append([index])
        return groups

    def _fetch(self, indices: list[int]) -> None:
        """Read lists that lie close together and keep them."""
        first, last = int(self._starts[indices[0]]), int(self._ends[indices[-1]])
        data = self._read(first, last - first)
        if len(data) != last - first:
            raise StoreError(f"{self._name}: cut off at byte {first + len(data)}")
        for index in indices:
            piece = data[int(self._starts[index]) - first : int(self._ends[index]) - first]
            self._kept[index] = self._decode(piece, index)

    def _decode(self, data: bytes, index: int) -> BitMap:
        """Turn bytes into a list after checking that they are the ones that were written."""
        fault = f"{self._name}: list {index} is damaged; run 'mocapidx verify --repair'"
        if _digest(data) != self._digests[index].tobytes():
            raise StoreError(fault)
        try:
            numbers = _decode_list(data, int(self.counts[index]))
        except (ValueError, IndexError, TypeError, MemoryError) as exc:
            raise StoreError(fault) from exc
        if len(numbers) != self.counts[index] or numbers.max() >= self.runs:
            raise StoreError(fault)
        return numbers
