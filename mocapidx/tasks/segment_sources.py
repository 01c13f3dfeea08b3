"""Segment files of a store as queries see them: runs, lists and groups of documents."""

from collections.abc import Container, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FeatureSetError, MocapidxError, StoreError
from mocapidx.features.featureset import PARTS, FeatureSet, parse_feature_set
from mocapidx.index.build import first_positions
from mocapidx.index.postings import InvertedLists, open_index
from mocapidx.model import IndexArray
from mocapidx.printable import shown
from mocapidx.queries.column import Column
from mocapidx.queries.evaluate import DocumentGroup
from mocapidx.queries.source import PartSource, Source
from mocapidx.store.files import DamagedError
from mocapidx.store.manifest import Document, SegmentFile
from mocapidx.store.read import Snapshot

__all__ = ["document_groups", "one_voice", "segment_source", "store_feature_set", "untrusted_mask"]

UNTRUSTED: Final = "untrusted"
"""Key of a document's rig: the mask of features not trusted in it, in hexadecimal."""

WORD: Final = (1 << 64) - 1


def store_feature_set(snapshot: Snapshot, *, checked: bool = False) -> FeatureSet:
    """Give the feature set that a store was made with.

    Parameters
    ----------
    snapshot : Snapshot
    checked : bool
        Compare its digest too, which takes as long as reading it; whoever writes or verifies
        wants to know.

    Returns
    -------
    FeatureSet

    Raises
    ------
    StoreError
        If its text can't be understood, or means something else to this version.
    """
    settings, place = snapshot.manifest.settings, shown(snapshot.path)
    try:
        feature_set = parse_feature_set(settings.feature_set_text, settings.feature_set_name)
    except FeatureSetError as exc:
        raise StoreError(f"{place}: {exc}; index the sources into a new store") from exc
    if checked and feature_set.digest != settings.feature_set_digest:
        raise StoreError(
            f"{place}: the feature set {shown(settings.feature_set_name)} means something else to "
            "this version of mocapidx; index the sources into a new store"
        )
    return feature_set


def segment_source(
    snapshot: Snapshot,
    file: SegmentFile,
    feature_set: FeatureSet,
    lengths: IndexArray | None = None,
) -> Source:
    """Give the runs and inverted lists of a segment file; nothing is read before it is needed.

    Parameters
    ----------
    snapshot : Snapshot
    file : SegmentFile
        One of the snapshot's.
    feature_set : FeatureSet
        The store's.
    lengths : ndarray of int64, shape (D,), optional
        Frames of its documents, where `file` comes without them.

    Returns
    -------
    Source
    """
    if lengths is None:
        lengths = np.array([document.frames for document in file.documents], np.int64)
    opened: dict[str, InvertedLists] = {}

    def lists(part: str) -> InvertedLists:
        if not opened:
            head = snapshot.index_bytes(file, 0, file.head.size)
            found = open_index(head, partial(snapshot.index_bytes, file), file.idx.size)
            if any(name not in found or found[name].runs != _runs(file, name) for name in PARTS):
                raise DamagedError(
                    snapshot.path, file.names[1], "its lists are of other runs than the file has"
                )
            opened.update(found)
        return opened[part]

    parts = tuple(
        PartSource(
            feature_set.part_mask(part),
            _column(snapshot, file, f"runs/{part}/starts"),
            _column(snapshot, file, f"runs/{part}/words"),
            partial(lists, part),
        )
        for part in PARTS
    )
    return Source(first_positions(lengths), lengths, parts)


def _runs(file: SegmentFile, part: str) -> int:
    return file.datasets[f"runs/{part}/words"].shape[0]


def _column(snapshot: Snapshot, file: SegmentFile, path: str) -> Column:
    return Column(file.datasets[path].shape[0], partial(snapshot.array, file, path))


@contextmanager
def one_voice(store: Path, file: SegmentFile) -> Iterator[None]:
    """Say that a segment file is damaged where its runs, lists and documents contradict each other.

    Digests vouch for what a writer of ours wrote; what somebody else gave right digests may say
    anything.

    Parameters
    ----------
    store : Path
        Folder of the store.
    file : SegmentFile
        The file that is asked.

    Raises
    ------
    StoreError
    """
    try:
        yield
    except MocapidxError:
        raise
    except (IndexError, ValueError, OverflowError) as exc:
        raise DamagedError(store, file.names[0], "its parts contradict each other") from exc


def document_groups(file: SegmentFile, wanted: Container[int] | None = None) -> list[DocumentGroup]:
    """Group the live documents of a segment file by the features that they can't be trusted in.

    Parameters
    ----------
    file : SegmentFile
    wanted : container of int, optional
        Numbers of the documents that count; default all.

    Returns
    -------
    list of DocumentGroup
        In the order of their first documents.
    """
    numbers: dict[int, list[int]] = {}
    for number, document in enumerate(file.documents):
        if document.live and (wanted is None or number in wanted):
            numbers.setdefault(untrusted_mask(document), []).append(number)
    return [
        DocumentGroup(mask, np.array(documents, np.int64)) for mask, documents in numbers.items()
    ]


def untrusted_mask(document: Document) -> int:
    """Give the mask of the features that are not trusted in a document."""
    try:
        return int(document.rig.get(UNTRUSTED, "0"), 16) & WORD
    except (TypeError, ValueError) as exc:
        raise StoreError(
            f"{shown(document.name)}: its features to be trusted are not told; index it again"
        ) from exc
