"""Write a store: one commit at a time, each there as a whole or not at all.

The order is what makes it so. A segment file and its index are written and synced under names
that no manifest knows; then one rename puts the new manifest in place. Files that the new
manifest no longer names stay until the next commit, for readers that have just read the old
one. Whatever a killed writer leaves behind, the next one removes.
"""

import contextlib
import os
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocapidx.durable import make_folder, replace_file, sync_folder, write_error
from mocapidx.errors import MocapidxError, ParameterError, StoreError, WriteError
from mocapidx.printable import count
from mocapidx.store import schema
from mocapidx.store.aside import put_aside
from mocapidx.store.batch import Batch, batch_shapes, batch_size, check_batch
from mocapidx.store.encoding import decode_manifest, encode_manifest, meta_json
from mocapidx.store.files import check_segments_folder
from mocapidx.store.image import lay_out
from mocapidx.store.link import link_or_copy
from mocapidx.store.lock import locked
from mocapidx.store.manifest import (
    Document,
    FileRecord,
    Manifest,
    SegmentFile,
    StoreSettings,
    file_digest,
    segment_names,
)
from mocapidx.store.place import check_writable, gone_if_empty, sweep, unmake_folder
from mocapidx.store.read import Snapshot, read_manifest

__all__ = ["Batch", "StoreSettings", "Writer", "check_writable", "writing"]


class Writer:
    """The one that may change a store; made by `writing`.

    Parameters
    ----------
    path : Path
        Folder of the store.
    manifest : Manifest
        Of the last commit.
    """

    def __init__(self, path: Path, manifest: Manifest, handles: contextlib.ExitStack) -> None:
        self.path = path
        self.manifest = self._begun = manifest
        self._usable = True
        self._snapshot = Snapshot(path, manifest)
        handles.callback(lambda: self._snapshot.close())

    @property
    def settings(self) -> StoreSettings:
        """What holds for every document of the store."""
        return self.manifest.settings

    def documents(self) -> list[Document]:
        """Every live document.

        Returns
        -------
        list of Document
            File by file, in the order in which their frames lie.
        """
        return [entry.document for entry in self.manifest.documents()]

    @property
    def snapshot(self) -> Snapshot:
        """The store as of the last commit; closed by the next one, and with the writer."""
        return self._snapshot

    def commit(self, batch: Batch | None, remove: Collection[str] = ()) -> Snapshot:
        """Add documents, which replace those of the same name, and remove others.

        Parameters
        ----------
        batch : Batch or None
            What to add.
        remove : collection of str
            Names of documents to remove.

        Returns
        -------
        Snapshot
            After the commit. Nothing to do writes nothing.

        Raises
        ------
        WriteError
            If it could not be written; the store is as before unless the message says.
        ParameterError
            If the batch does not agree with itself or the settings, or no such document is
            there to remove.
        """
        names = {entry.document.name for entry in self.manifest.documents()}
        if unknown := set(remove) - names:
            raise ParameterError(f"{self.path}: no document {sorted(unknown)[0]!r} to remove")
        new = {document.name for document in batch.documents} if batch else set()
        return self._publish(batch, dead=new.union(remove), dropped=frozenset())

    def replace(self, batch: Batch, files: Collection[SegmentFile]) -> Snapshot:
        """Put one segment file in the place of several, in one commit.

        Parameters
        ----------
        batch : Batch
            The live documents of `files`.
        files : collection of SegmentFile
            The files that it replaces.

        Returns
        -------
        Snapshot
            After the commit.

        Raises
        ------
        WriteError, ParameterError
            As `commit` does.
        """
        before = sorted(e.document.name for f in files for e in f.placed() if e.document.live)
        if before != sorted(document.name for document in batch.documents):
            raise ParameterError(f"{self.path}: a merge must keep the documents as they are")
        return self._publish(batch, dead=set(), dropped={file.number for file in files})

    def adopt(self, files: Sequence[tuple[Path, SegmentFile]]) -> Snapshot:
        """Take over segment files of other stores, in one commit; nothing is read or rebuilt.

        Parameters
        ----------
        files : sequence of (Path, SegmentFile)
            Each with the folder of its store; the settings of all stores must be the same, and
            their live documents have different names.

        Returns
        -------
        Snapshot
            After the commit.

        Raises
        ------
        StoreError
            If a file isn't there.
        WriteError, ParameterError
            As `commit` does.
        """
        return self._publish(None, dead=(), dropped=(), adopted=files)

    def set_aside(self, files: Collection[SegmentFile]) -> list[Path]:
        """Take damaged segment files, with their documents, out of the store.

        Parameters
        ----------
        files : collection of SegmentFile
            Which.

        Returns
        -------
        list of Path
            What they are called now; no command touches them again.

        Raises
        ------
        WriteError
            As `commit` does.
        """
        with self._explained(()), put_aside(self.path, files) as aside:
            self._publish(None, dead=(), dropped={file.number for file in files})
        return aside

    def _publish(
        self,
        batch: Batch | None,
        dead: Collection[str],
        dropped: Collection[int],
        adopted: Sequence[tuple[Path, SegmentFile]] = (),
    ) -> Snapshot:
        if not self._usable:
            raise WriteError(f"{self.path}: an earlier commit failed; run again")
        files = [f.without(dead) for f in self.manifest.files if f.number not in dropped]
        kept = tuple(file for file in files if any(entry.live for entry in file.documents))
        if batch is None and not adopted and kept == self.manifest.files:
            return self._snapshot
        number = self.manifest.next_number
        manifest = replace(self.manifest, files=kept, generation=self.manifest.generation + 1)
        needed: list[int] = []
        with self._explained(needed):
            if batch is not None:
                check_batch(batch, self.settings)
                needed.append(batch_size(batch))
                sweep(self.path, self.manifest)
                file = self._write_segment(batch, number)
                manifest = replace(manifest, files=(*kept, file), next_number=number + 1)
            else:
                sweep(self.path, self.manifest)
                taken = self._link_segments(adopted, number, needed)
                following = number + len(taken)
                manifest = replace(manifest, files=(*kept, *taken), next_number=following)
            data = encode_manifest(manifest)
            needed.append(len(data))
            manifest = _readable(data, self.path)
            self._usable = False  # from here on only success tells which manifest is there
            replace_file(self.path / schema.MANIFEST, data)
        try:
            sync_folder(self.path)
        except OSError as exc:
            raise WriteError(
                f"{self.path}: its folder could not be synced ({(exc.strerror or '').lower()}), "
                "so the last documents may or may not be saved; running again is safe"
            ) from exc
        self.manifest, self._usable = manifest, True
        # Kept, the manifests of all commits would fill the memory of a long run.
        self._snapshot.close()
        self._snapshot = Snapshot(self.path, manifest)
        return self._snapshot

    def _write_segment(self, batch: Batch, number: int) -> SegmentFile:
        folder = self._segments_folder()
        contents = {
            path: (values,) if isinstance(values, np.ndarray) else values
            for path, values in batch.arrays.items()
        }
        meta = np.frombuffer(meta_json(batch.documents, self.settings), dtype=schema.META.dtype)
        image = lay_out(
            {schema.META.path: meta.shape, **batch_shapes(batch)},
            {schema.META.path: (meta,), **contents},
        )
        idx = FileRecord(len(batch.index), file_digest(batch.index).hexdigest())
        head = batch.index[: batch.index_head_size]
        h5_name, idx_name = segment_names(number)
        replace_file(folder / h5_name, image.chunks())
        replace_file(folder / idx_name, batch.index)
        sync_folder(folder)
        return SegmentFile(
            number,
            FileRecord(image.size, image.digest),
            idx,
            FileRecord(len(head), file_digest(head).hexdigest()),
            image.datasets,
            tuple(batch.documents),
        )

    def _link_segments(
        self, adopted: Sequence[tuple[Path, SegmentFile]], number: int, needed: list[int]
    ) -> list[SegmentFile]:
        if not adopted:
            return []
        folder, taken = self._segments_folder(), []
        for place, (store, file) in enumerate(adopted, start=number):
            for old, new, record in zip(
                file.names, segment_names(place), (file.h5, file.idx), strict=True
            ):
                needed.append(record.size)
                if link_or_copy(store / schema.SEGMENTS / old, folder / new, record):
                    needed.pop()
            taken.append(replace(file, number=place))
        sync_folder(folder)
        return taken

    def _segments_folder(self) -> Path:
        folder = self.path / schema.SEGMENTS
        if not folder.is_dir() or not self.manifest.generation:
            folder.mkdir(exist_ok=True)
            # Else a disk might keep the manifest and lose the folder of what it names.
            sync_folder(self.path)
        return folder

    @contextlib.contextmanager
    def _explained(self, needed: Sequence[int]) -> Iterator[None]:
        """On a failure leave no debris, and say what was needed and what the store still holds."""
        try:
            yield
        except BaseException as exc:
            with contextlib.suppress(OSError, MocapidxError):
                # A stop can come just after the rename, and then the new files are the store's.
                if _present(self.path, self.settings) == self.manifest:
                    sweep(self.path, self.manifest)
            if not isinstance(exc, OSError):
                raise
            documents = count(sum(1 for _ in self.manifest.documents()), "document")
            left = f"store unchanged ({documents})"
            if self.manifest is not self._begun:
                left = f"what was saved before stays ({documents}); run again to continue"
            raise write_error(
                exc, self.path, subject=str(self.path), needed=sum(needed), unchanged=left
            ) from exc


@contextlib.contextmanager
def writing(
    path: Path,
    *,
    command: str,
    lock_timeout: float = 0.0,
    use_lock: bool = True,
    create: StoreSettings | None = None,
) -> Iterator[Writer]:
    """Take the lock of a store and give the one that may change it.

    Parameters
    ----------
    path : Path
        Folder of the store.
    command : str
        Who writes, for the message that other writers get.
    lock_timeout : float
        How long to wait for another writer, in seconds.
    use_lock : bool
        False goes without a lock, at the caller's risk.
    create : StoreSettings, optional
        Make the store with these where there is none; where there is one, its rate and feature
        set must be these. Nobody sees a store before its first commit.

    Yields
    ------
    Writer
        Until the end of the `with`.

    Raises
    ------
    LockedError
        If another writer is at work.
    StoreError
        If there is no store and `create` is not given, or it is damaged, newer or of another
        feature set.
    ParameterError
        If `path` is no place for a store, or the store has another rate.
    WriteError
        If it may not be written.
    """
    check_writable(path)
    if create is None:
        read_manifest(path)
    made = create is not None and make_folder(path)
    with (
        gone_if_empty(path) if made else contextlib.nullcontext(),
        locked(path, command=command, timeout=lock_timeout, use_lock=use_lock),
        contextlib.ExitStack() as handles,
    ):
        manifest = _agreed(path, create)
        check_segments_folder(path)
        try:
            sweep(path, manifest)
        except OSError as exc:
            raise write_error(exc, path, subject=str(path), unchanged="store unchanged") from exc
        try:
            yield Writer(path, manifest, handles)
        finally:
            if made and not (path / schema.MANIFEST).exists():
                unmake_folder(path)


def _present(path: Path, settings: StoreSettings) -> Manifest:
    """Read the manifest, or give an empty one where a store has not had its first commit."""
    if not os.path.lexists(path / schema.MANIFEST):
        return Manifest(settings)
    return read_manifest(path)


def _agreed(path: Path, create: StoreSettings | None) -> Manifest:
    manifest = read_manifest(path) if create is None else _present(path, create)
    settings = manifest.settings
    if create is None:
        return manifest
    if create.feature_set_digest != settings.feature_set_digest:
        raise StoreError(
            f"{path}: holds another feature set ({settings.feature_set_name!r}, digest "
            f"{settings.feature_set_digest[:12]}) than {create.feature_set_name!r} (digest "
            f"{create.feature_set_digest[:12]}); leave --feature-set out or give another --store"
        )
    if create.rate != settings.rate:
        raise ParameterError(
            f"{path}: holds frames at {settings.rate:g} Hz, not {create.rate:g}; "
            "leave --rate out or give another --store"
        )
    if settings.poses and not create.poses:
        raise ParameterError(
            f"{path}: keeps joint positions; leave --no-poses out or give another --store"
        )
    return manifest


def _readable(data: bytes, path: Path) -> Manifest:
    """Take a manifest as a reader would, before it is in place."""
    try:
        return decode_manifest(data, path / schema.MANIFEST)
    except StoreError as exc:
        raise ParameterError(f"the batch can't be kept: {exc.__cause__ or exc}") from exc
