"""Merge segment files: those that `compact` finds, and small ones that `index` has left."""

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import Interrupted
from mocapidx.features.featureset import FeatureSet
from mocapidx.printable import count
from mocapidx.store.manifest import Placed, SegmentFile
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import column
from mocapidx.store.write import Batch, Writer, writing
from mocapidx.tasks.batch import make_batch
from mocapidx.tasks.segment_sources import store_feature_set

__all__ = ["compact_store", "merge_files", "merged_batch", "small_files"]

MOST_FRAMES: Final = 1 << 24
"""Of a merged file: 155 hours at 30 Hz. Their words and runs are in memory together."""

READ_BYTES: Final = 8 << 20
"""What is read together, in whole blocks that are checked."""


def compact_store(
    store: str | Path, *, lock_timeout: float = 0.0, use_lock: bool = True
) -> tuple[int, int]:
    """Merge the segment files of a store and drop what was removed.

    Afterwards there is one, or one for each 155 hours at 30 Hz; each is a commit of its own.

    Parameters
    ----------
    store : str or Path
    lock_timeout : float
        Seconds to wait for another writer.
    use_lock : bool
        False: write without a lock.

    Returns
    -------
    before, after : int
        Segment files.

    Raises
    ------
    StoreError, LockedError, WriteError
    Interrupted
        If a signal came; what was merged before stays.
    """
    with writing(
        Path(store), command="compact", lock_timeout=lock_timeout, use_lock=use_lock
    ) as writer:
        files = writer.snapshot.files
        groups = _groups(files)
        if not groups:
            writer.commit(None)  # leaves out what holds nothing
            return len(files), len(writer.snapshot.files)
        feature_set = store_feature_set(writer.snapshot, checked=True)
        for done, group in enumerate(groups):
            try:
                merge_files(writer, group, feature_set)
            except Interrupted as exc:
                if not done:
                    raise
                merged = f"{done} of {count(len(groups), 'merge')}"
                raise Interrupted(
                    exc.signal_number, f"stopped after {merged}; run again to continue"
                ) from exc
        return len(files), len(writer.snapshot.files)


def _groups(files: Sequence[SegmentFile]) -> list[list[SegmentFile]]:
    """Divide files into what becomes one file each; one that would stay as it is is left out."""
    groups: list[list[SegmentFile]] = []
    frames = 0
    for file in files:
        live = sum(document.frames for document in file.documents if document.live)
        if groups and frames + live <= MOST_FRAMES:
            groups[-1].append(file)
            frames += live
        elif live:
            groups.append([file])
            frames = live
    return [
        group
        for group in groups
        if len(group) > 1 or not all(document.live for document in group[0].documents)
    ]


def merge_files(writer: Writer, files: Sequence[SegmentFile], feature_set: FeatureSet) -> None:
    """Put one segment file in the place of several, without what was removed.

    Parameters
    ----------
    writer : Writer
        Of their store.
    files : sequence of SegmentFile
        At least one live document is in them.
    feature_set : FeatureSet
        The store's.

    Raises
    ------
    StoreError
        If a file is damaged.
    WriteError
    """
    writer.replace(merged_batch(writer.snapshot, files, feature_set), files)


def merged_batch(
    snapshot: Snapshot, files: Sequence[SegmentFile], feature_set: FeatureSet
) -> Batch:
    """Lay the live documents of several segment files end to end; poses are streamed.

    Parameters
    ----------
    snapshot : Snapshot
        Holds the files.
    files : sequence of SegmentFile
    feature_set : FeatureSet
        The store's.

    Returns
    -------
    Batch

    Raises
    ------
    StoreError
        If a file is damaged.
    """
    live = [entry for file in files for entry in file.placed() if entry.document.live]
    # Copies: a view would keep all that was read with it.
    words = [rows.copy() for rows in _rows(snapshot, live, "frames/words")]

    def poses() -> Iterator[NDArray[np.float32]]:
        return _rows(snapshot, live, "frames/poses")

    return make_batch(
        [entry.document for entry in live],
        words,
        poses if snapshot.manifest.settings.poses else None,
        feature_set,
    )


def _rows(snapshot: Snapshot, entries: Sequence[Placed], path: str) -> Iterator[NDArray[Any]]:
    """Read rows of documents, neighbours at one go: what is read is checked by whole blocks."""
    most = READ_BYTES // column(path).row_bytes
    near = itertools.groupby(entries, lambda e: (e.file.number, e.frame_offset // most))
    for _, group in near:
        some = list(group)
        first, last = some[0].frame_offset, some[-1].frame_offset + some[-1].document.frames
        rows = snapshot.array(some[0].file, path, first, last)
        for entry in some:
            yield rows[entry.frame_offset - first :][: entry.document.frames]


def small_files(files: Sequence[SegmentFile], most_bytes: int) -> list[SegmentFile]:
    """Choose the segment files to be merged: the smallest that fit into one together.

    Parameters
    ----------
    files : sequence of SegmentFile
    most_bytes : int
        Size that the merged file may have.

    Returns
    -------
    list of SegmentFile
        In the order of their numbers; fewer than two are not worth a merge.
    """
    chosen: list[SegmentFile] = []
    size = 0
    living = [file for file in files if any(document.live for document in file.documents)]
    for file in sorted(living, key=lambda file: (file.h5.size, file.number)):
        size += file.h5.size
        if size > most_bytes:
            break
        chosen.append(file)
    return sorted(chosen, key=lambda file: file.number)
