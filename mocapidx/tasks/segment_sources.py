"""Segment files of a store as queries see them: runs, lists and groups of documents."""

from functools import partial
from typing import Final

import numpy as np

from mocapidx.features.featureset import PARTS, FeatureSet, parse_feature_set
from mocapidx.index.build import first_positions
from mocapidx.index.postings import InvertedLists, open_index
from mocapidx.queries.evaluate import DocumentGroup
from mocapidx.queries.source import PartSource, Source
from mocapidx.store.manifest import Document, SegmentFile
from mocapidx.store.read import Snapshot

__all__ = ["document_groups", "segment_source", "store_feature_set", "untrusted_mask"]

UNTRUSTED: Final = "untrusted"
"""Key of a document's rig: the mask of features not trusted in it, in hexadecimal."""


def store_feature_set(snapshot: Snapshot) -> FeatureSet:
    """Give the feature set that a store was made with.

    Raises
    ------
    FeatureSetError
        If its text can't be understood.
    """
    return parse_feature_set(snapshot.manifest.settings.feature_set_text, str(snapshot.path))


def segment_source(snapshot: Snapshot, file: SegmentFile, feature_set: FeatureSet) -> Source:
    """Give the runs and inverted lists of a segment file; nothing is read before it is needed.

    Parameters
    ----------
    snapshot : Snapshot
    file : SegmentFile
        One of the snapshot's.
    feature_set : FeatureSet
        The store's.

    Returns
    -------
    Source
    """
    lengths = np.array([document.frames for document in file.documents], np.int64)
    opened: dict[str, InvertedLists] = {}

    def lists(part: str) -> InvertedLists:
        if not opened:
            head = snapshot.index_bytes(file, 0, file.head.size)
            opened.update(open_index(head, partial(snapshot.index_bytes, file), file.idx.size))
        return opened[part]

    parts = tuple(
        PartSource(
            feature_set.part_mask(part),
            partial(snapshot.array, file, f"runs/{part}/starts"),
            partial(snapshot.array, file, f"runs/{part}/words"),
            partial(lists, part),
        )
        for part in PARTS
    )
    return Source(first_positions(lengths), lengths, parts)


def document_groups(file: SegmentFile) -> list[DocumentGroup]:
    """Group the live documents of a segment file by the features that they can't be trusted in.

    Parameters
    ----------
    file : SegmentFile

    Returns
    -------
    list of DocumentGroup
        In the order of their first documents.
    """
    numbers: dict[int, list[int]] = {}
    for number, document in enumerate(file.documents):
        if document.live:
            numbers.setdefault(untrusted_mask(document), []).append(number)
    return [
        DocumentGroup(mask, np.array(documents, np.int64)) for mask, documents in numbers.items()
    ]


def untrusted_mask(document: Document) -> int:
    """Give the mask of the features that are not trusted in a document."""
    return int(document.rig.get(UNTRUSTED, "0"), 16)
