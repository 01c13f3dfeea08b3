"""Documents to one batch of a store: words, runs and inverted lists laid end to end."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.features.featureset import PARTS, FeatureSet
from mocapidx.index.build import build_runs
from mocapidx.index.postings import encode_index
from mocapidx.model import WordArray
from mocapidx.store.manifest import Document, Placed, SegmentFile
from mocapidx.store.read import Snapshot
from mocapidx.store.write import Batch

__all__ = ["make_batch", "merged_batch", "small_files"]

READ_FRAMES: Final = 1 << 15
"""Frames that are read together: 9 MiB of poses."""


def make_batch(
    documents: Sequence[Document],
    words: Sequence[WordArray],
    poses: Callable[[], Iterable[NDArray[np.float32]]] | None,
    feature_set: FeatureSet,
) -> Batch:
    """Lay documents end to end and build the runs and inverted lists over them.

    Parameters
    ----------
    documents : sequence of Document, length D
    words : sequence of ndarray of uint64, each of shape (T,)
        The feature words of each document.
    poses : callable or None
        Gives the joint positions of each document, float32 (T, 24, 3), in metres; called once,
        and none is held longer than it takes to write it. None: the store keeps no poses.
    feature_set : FeatureSet

    Returns
    -------
    Batch
    """
    runs = {part: build_runs(words, feature_set.part_mask(part)) for part in PARTS}
    index, head = encode_index({part: found.words for part, found in runs.items()})
    arrays: dict[str, NDArray[np.generic] | Iterable[NDArray[np.generic]]] = {
        "frames/words": np.concatenate(words)
    }
    if poses is not None:
        arrays["frames/poses"] = poses()
    for part, found in runs.items():
        arrays[f"runs/{part}/starts"] = found.starts
        arrays[f"runs/{part}/words"] = found.words
    return Batch(documents, arrays, index, head)


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
    words = list(_rows(snapshot, live, "frames/words"))

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
    near = itertools.groupby(entries, lambda e: (e.file.number, e.frame_offset // READ_FRAMES))
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
    for file in sorted(files, key=lambda file: (file.h5.size, file.number)):
        size += file.h5.size
        if size > most_bytes:
            break
        chosen.append(file)
    return sorted(chosen, key=lambda file: file.number)
