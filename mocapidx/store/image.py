"""Lay out the HDF5 file of a segment file, without a disk and without its data.

HDF5 crashes when a disk is full, so it never sees one: it creates the file's groups and
datasets in memory, where datasets are contiguous and never written. What it did write, a few
kB, and the arrays at the offsets that it gave them, together are the file; both are streamed to
disk by `durable`. Equal arrays give equal bytes: no times, no filters, no attributes.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.store import schema
from mocapidx.store.hdf5 import h5d, h5f, h5fd, h5g, h5p, h5s, h5t
from mocapidx.store.manifest import Dataset, block_digest, file_digest

__all__ = ["Image", "lay_out"]

ZEROS: Final = bytes(4096)


@dataclass(slots=True)
class Sheet:
    """A file in memory that keeps only what is written to it; what HDF5 writes to."""

    pieces: dict[int, bytes] = field(default_factory=dict)
    place: int = 0
    end: int = 0

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place, as a file does."""
        self.place = offset if whence == 0 else self.end + offset
        return self.place

    def tell(self) -> int:
        """Say the place."""
        return self.place

    def write(self, data: Any) -> int:
        """Keep a piece."""
        piece = bytes(data)
        self.pieces[self.place] = piece
        self.place += len(piece)
        self.end = max(self.end, self.place)
        return len(piece)

    def truncate(self, size: int) -> int:
        """Set the length."""
        self.end = size
        return size

    def flush(self) -> None:
        """There is nothing behind it."""


@dataclass(slots=True)
class Image:
    """The bytes of an HDF5 file, to be streamed once.

    Parameters
    ----------
    size : int
        Of the whole file, in bytes.
    pieces : mapping of int to bytes
        What is not data, by offset.
    shapes : mapping of str to tuple of int
        Of the datasets.
    offsets : mapping of str to int
        Of the datasets' first bytes.
    contents : mapping of str to iterable of ndarray
        The rows of each dataset.
    """

    size: int
    pieces: Mapping[int, bytes]
    shapes: Mapping[str, tuple[int, ...]]
    offsets: Mapping[str, int]
    contents: Mapping[str, Iterable[NDArray[Any]]]
    datasets: dict[str, Dataset] = field(default_factory=dict)
    digest: str = ""

    def chunks(self) -> Iterator[bytes | memoryview]:
        """Stream the file; `datasets` and `digest` are filled at the end.

        Yields
        ------
        bytes
            In order.

        Raises
        ------
        ParameterError
            If an array has not the dtype or the rows that were announced.
        """
        whole = file_digest()
        for chunk in self._in_order():
            whole.update(chunk)
            yield chunk
        self.digest = whole.hexdigest()

    def _in_order(self) -> Iterator[bytes | memoryview]:
        parts: list[tuple[int, str, bytes]] = [(at, "", piece) for at, piece in self.pieces.items()]
        parts += [(at, path, b"") for path, at in self.offsets.items()]
        place = 0
        for at, path, piece in sorted(parts):
            yield from _zeros(at - place)
            if path:
                yield from self._rows(path)
                place = at + schema.column(path).row_bytes * self.shapes[path][0]
            else:
                yield piece
                place = at + len(piece)
        yield from _zeros(self.size - place)

    def _rows(self, path: str) -> Iterator[memoryview]:
        blocks = Blocks()
        for view in _row_bytes(path, self.contents[path], self.shapes[path][0]):
            blocks.update(view)
            yield view
        self.datasets[path] = Dataset(self.shapes[path], self.offsets[path], blocks.finish())


def lay_out(
    shapes: Mapping[str, tuple[int, ...]], contents: Mapping[str, Iterable[NDArray[Any]]]
) -> Image:
    """Make the HDF5 file for datasets of known shapes.

    Parameters
    ----------
    shapes : mapping of str to tuple of int
        Of each dataset, none empty.
    contents : mapping of str to iterable of ndarray
        Arrays whose rows end to end are the dataset; read when the image is streamed.

    Returns
    -------
    Image
        Not streamed yet.
    """
    sheet = Sheet()
    offsets: dict[str, int] = {}
    creation = h5p.create(h5p.FILE_CREATE)
    creation.set_obj_track_times(False)
    access = h5p.create(h5p.FILE_ACCESS)
    # 1.8: checksums on every header, and no flags that a crash could leave set.
    access.set_libver_bounds(h5f.LIBVER_V18, h5f.LIBVER_V18)
    access.set_fileobj_driver(h5fd.fileobj_driver, sheet)
    file = h5f.create(b"image", h5f.ACC_TRUNC, creation, access)
    group = h5p.create(h5p.GROUP_CREATE)
    group.set_obj_track_times(False)
    for name in sorted({parent for path in shapes for parent in _parents(path)}):
        h5g.create(file, name.encode(), gcpl=group)
    plain = h5p.create(h5p.DATASET_CREATE)
    plain.set_layout(h5d.CONTIGUOUS)
    plain.set_obj_track_times(False)
    plain.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    plain.set_fill_time(h5d.FILL_TIME_NEVER)
    for path in sorted(shapes):
        kind = h5t.py_create(schema.column(path).dtype)
        space = h5s.create_simple(shapes[path])
        offsets[path] = h5d.create(file, path.encode(), kind, space, dcpl=plain).get_offset()
    file.close()
    return Image(sheet.end, sheet.pieces, shapes, offsets, contents)


def _parents(path: str) -> Iterator[str]:
    parts = path.split("/")
    yield from ("/".join(parts[:depth]) for depth in range(1, len(parts)))


def _row_bytes(path: str, arrays: Iterable[NDArray[Any]], rows: int) -> Iterator[memoryview]:
    column = schema.column(path)
    for array in arrays:
        if array.dtype != column.dtype or array.shape[1:] != column.trailing or array.ndim == 0:
            raise ParameterError(
                f"{path} takes {column.dtype} of shape (rows, *{column.trailing}), "
                f"got {array.dtype} {array.shape}"
            )
        rows -= len(array)
        if array.size:
            yield np.ascontiguousarray(array).data.cast("B")
    if rows:
        raise ParameterError(f"{path} has {-rows:+d} rows against what its documents say")


def _zeros(size: int) -> Iterator[bytes]:
    if size < 0:
        raise ParameterError("parts of the HDF5 image overlap")
    for start in range(0, size, len(ZEROS)):
        yield ZEROS[: size - start]


class Blocks:
    """Digests of the blocks of a dataset that arrives in pieces of any size."""

    def __init__(self) -> None:
        self._digests: list[str] = []
        self._open = bytearray()

    def update(self, view: memoryview) -> None:
        """Take the next bytes."""
        start = 0
        if self._open:
            start = min(schema.BLOCK - len(self._open), len(view))
            self._open += view[:start]
            if len(self._open) < schema.BLOCK:
                return
            self._digests.append(block_digest(self._open))
            self._open = bytearray()
        for place in range(start, len(view), schema.BLOCK):
            block = view[place : place + schema.BLOCK]
            if len(block) == schema.BLOCK:
                self._digests.append(block_digest(block))
            else:
                self._open += block

    def finish(self) -> str:
        """Digests end to end, in hexadecimal."""
        if self._open:
            self._digests.append(block_digest(self._open))
        return "".join(self._digests)
