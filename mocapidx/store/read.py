"""Read a store: a snapshot of one commit, every byte checked before it is used.

Datasets are read straight from their place in the file, block by block, each block against its
digest in the manifest. HDF5 takes no part, so a damaged or hostile file never reaches it, and
a reader does not even import it.
"""

import contextlib
import errno
import os
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError, StoreError
from mocapidx.markup import facts_html, table_html
from mocapidx.store import schema
from mocapidx.store.encoding import decode_manifest
from mocapidx.store.files import (
    DamagedError,
    check_segments_folder,
    open_regular,
    open_segment,
    read_exactly,
    reason,
    unreadable,
)
from mocapidx.store.manifest import (
    Manifest,
    Placed,
    SegmentFile,
    block_digest,
    file_digest,
)

__all__ = ["Snapshot", "open_store", "read_manifest"]

ATTEMPTS: Final = 5
LISTED: Final = 10
"""Documents that a notebook shows."""
MOVED: Final = frozenset({errno.ENOENT, errno.ESTALE})


class Snapshot:
    """A store as of one commit; a context manager that holds its files open.

    A writer beside it changes nothing that it sees: files are never written twice, and one
    that is removed stays readable while it is held.

    Parameters
    ----------
    path : Path
        Folder of the store.
    manifest : Manifest
        What the commit says.
    """

    def __init__(self, path: Path, manifest: Manifest) -> None:
        self.path = path
        self.manifest = manifest
        self._descriptors: dict[str, int] = {}
        self._heads: dict[int, bytes] = {}

    def _repr_html_(self) -> str:
        """Show the store in a notebook: what it holds, and its first documents."""
        settings, placed = self.manifest.settings, self.documents()
        frames = sum(each.document.frames for each in placed)
        facts = {
            "store": self.path,
            "documents": len(placed),
            "minutes": frames / settings.rate / 60,
            "rate": f"{settings.rate:g} Hz",
            "feature set": settings.feature_set_name,
        }
        rows = [(one.document.name, one.document.frames / settings.rate) for one in placed[:LISTED]]
        more = f"and {len(placed) - LISTED} more" if len(placed) > LISTED else ""
        return facts_html("Store", facts) + table_html(("document", "seconds"), rows, more)

    @property
    def files(self) -> tuple[SegmentFile, ...]:
        """The segment files, in the order of their numbers."""
        return self.manifest.files

    def documents(self) -> list[Placed]:
        """Every live document with its place.

        Returns
        -------
        list of Placed
            File by file, in the order in which their frames lie.
        """
        return list(self.manifest.documents())

    def array(
        self, file: SegmentFile, path: str, start: int = 0, stop: int | None = None
    ) -> NDArray[Any]:
        """Read rows of a dataset.

        Parameters
        ----------
        file : SegmentFile
            One of `files`.
        path : str
            Name of the dataset, as in `schema`.
        start, stop : int
            Half-open range of rows, from 0; default all.

        Returns
        -------
        ndarray
            Read-only, of the dataset's dtype and shape but for the number of rows.

        Raises
        ------
        StoreError
            If the store has no such dataset, or the file is damaged.
        ParameterError
            If the range does not lie in the dataset.
        """
        column = schema.column(path)
        if path not in file.datasets:
            raise StoreError(f"{self.path}: made without {path}; index again without --no-poses")
        dataset = file.datasets[path]
        stop = dataset.shape[0] if stop is None else stop
        if not 0 <= start <= stop <= dataset.shape[0]:
            raise ParameterError(f"{path}: no rows {start} to {stop} of {dataset.shape[0]}")
        begin, end = start * column.row_bytes, stop * column.row_bytes
        total = dataset.shape[0] * column.row_bytes
        first = begin // schema.BLOCK * schema.BLOCK
        last = min(-(-end // schema.BLOCK) * schema.BLOCK, total) if end > begin else first
        data = self._read(file, 0, dataset.offset + first, last - first)
        view = memoryview(data)
        for place in range(0, last - first, schema.BLOCK):
            number = (first + place) // schema.BLOCK
            expected = dataset.blocks[32 * number : 32 * number + 32]
            if block_digest(view[place : place + schema.BLOCK]) != expected:
                raise DamagedError(
                    self.path, file.names[0], f"{path} does not match its digest at MiB {number}"
                )
        values = np.frombuffer(view[begin - first : end - first], dtype=column.dtype)
        return values.reshape(-1, *column.trailing)

    def index_bytes(self, file: SegmentFile, offset: int, size: int) -> bytes:
        """Read a range of an index.

        The head is checked here; the lists behind it carry their own digests.

        Parameters
        ----------
        file : SegmentFile
            One of `files`.
        offset, size : int
            In bytes, from 0.

        Returns
        -------
        bytes
            Exactly `size` of them.

        Raises
        ------
        StoreError
            If the range does not lie in the index, or its head is damaged.
        """
        if not (offset >= 0 and size >= 0 and offset + size <= file.idx.size):
            raise DamagedError(self.path, file.names[1], f"no bytes {offset} to {offset + size}")
        known = self.index_head(file)[offset : offset + size]
        rest = size - len(known)
        return known + self._read(file, 1, offset + len(known), rest) if rest else known

    def index_head(self, file: SegmentFile) -> bytes:
        """Read the beginning of an index, which says where its lists lie.

        Parameters
        ----------
        file : SegmentFile
            One of `files`.

        Returns
        -------
        bytes
            As many as the writer said.

        Raises
        ------
        StoreError
            If they are damaged.
        """
        head = self._heads.get(file.number)
        if head is None:
            head = self._read(file, 1, 0, file.head.size)
            if file_digest(head).hexdigest() != file.head.digest:
                raise DamagedError(self.path, file.names[1], "its head does not match its digest")
            self._heads[file.number] = head
        return head

    def hold(self) -> Self:
        """Open every segment file now, so that no later commit takes one away.

        Returns
        -------
        Snapshot
            Itself.

        Raises
        ------
        StoreError
            If a file is damaged.
        OSError
            If a file is gone; a newer manifest may know why.
        """
        for file in self.files:
            self._open(file, 0)
            self._open(file, 1)
        return self

    def close(self) -> None:
        """Let go of the files."""
        while self._descriptors:
            os.close(self._descriptors.popitem()[1])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if hasattr(self, "_descriptors"):  # else a stop came before it was made
            self.close()

    def _open(self, file: SegmentFile, which: int) -> int:
        name = file.names[which]
        descriptor = self._descriptors.get(name)
        if descriptor is None:
            record = (file.h5, file.idx)[which]
            descriptor = open_segment(self.path, name, record)
            self._descriptors[name] = descriptor
        return descriptor

    def _read(self, file: SegmentFile, which: int, offset: int, size: int) -> bytes:
        name = file.names[which]
        try:
            return read_exactly(self._open(file, which), offset, size)
        except (OSError, EOFError) as exc:
            raise unreadable(self.path, name, exc) from exc


def open_store(path: Path) -> Snapshot:
    """Open a store for reading; takes no lock and waits for nobody.

    Parameters
    ----------
    path : Path
        Folder of the store.

    Returns
    -------
    Snapshot
        Of the last commit, with all its files held open. Close it, or use it in a `with`.

    Raises
    ------
    StoreError
        If there is no store, or it is damaged, or of a newer version.
    """
    for attempt in range(1, ATTEMPTS + 1):
        snapshot = Snapshot(path, read_manifest(path))
        try:
            return snapshot.hold()
        except OSError as exc:
            snapshot.close()
            # A commit may have taken files away since the manifest was read: look again.
            if exc.errno not in MOVED or attempt == ATTEMPTS:
                name = os.path.basename(exc.filename or "") or schema.SEGMENTS
                raise unreadable(path, name, exc) from exc
    raise StoreError(f"{path}: its manifest changes too often")


def read_manifest(path: Path) -> Manifest:
    """Read and check the manifest of a store.

    Parameters
    ----------
    path : Path
        Folder of the store.

    Returns
    -------
    Manifest
        Of the last commit.

    Raises
    ------
    StoreError
        If there is none, or it is damaged, or of a newer version.
    """
    place = path / schema.MANIFEST
    try:
        with contextlib.ExitStack() as stack:
            descriptor = open_regular(place)
            stack.callback(os.close, descriptor)
            size = os.fstat(descriptor).st_size
            if size > schema.MANIFEST_LIMIT:
                raise StoreError(
                    f"{place}: has {size} bytes, a manifest at most {schema.MANIFEST_LIMIT}; "
                    "move the store away and index the sources again"
                )
            data = read_exactly(descriptor, 0, size)
    except (FileNotFoundError, NotADirectoryError) as exc:
        raise StoreError(f"{path}: no store here; make one with 'mocapidx index'") from exc
    except (OSError, EOFError) as exc:
        raise StoreError(f"{place}: can't be read ({reason(exc)})") from exc
    check_segments_folder(path)
    return decode_manifest(data, place)
