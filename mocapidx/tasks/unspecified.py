"""Where documents of a store can't be told everything: what their rigs keep of it, and its use."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from mocapidx.errors import StoreError
from mocapidx.features.gaps import Unspecified, unspecified_within
from mocapidx.model import BoolArray, IndexArray
from mocapidx.printable import shown
from mocapidx.store.manifest import Document, Rig
from mocapidx.tasks.segment_sources import untrusted_mask

__all__ = [
    "UNSPECIFIED",
    "keep_unspecified",
    "specified_pieces",
    "told",
    "unspecified_in",
    "untrusted_between",
]

UNSPECIFIED: Final = "unspecified"
"""Key of a document's rig: stretches of frames in which features can't be told; may be absent."""

WORD: Final = (1 << 64) - 1


def keep_unspecified(rig: Rig, unspecified: Unspecified) -> Rig:
    """Put into a rig where features can't be told; where there is nothing, the rig says nothing.

    Parameters
    ----------
    rig : mapping
    unspecified : tuple of (int, int, int)

    Returns
    -------
    mapping
        Another one.
    """
    kept: dict[str, Any] = {key: value for key, value in rig.items() if key != UNSPECIFIED}
    if unspecified:
        kept[UNSPECIFIED] = [[start, end, f"{mask:x}"] for start, end, mask in unspecified]
    return kept


def unspecified_in(document: Document) -> Unspecified:
    """Give the stretches in which features of a document can't be told.

    Parameters
    ----------
    document : Document

    Returns
    -------
    tuple of (int, int, int)
        Start, end and mask, in the order of time.

    Raises
    ------
    StoreError
        If the store has something else there.
    """
    rows = document.rig.get(UNSPECIFIED)
    if rows is None:
        return ()
    try:
        found = tuple((int(start), int(end), int(mask, 16) & WORD) for start, end, mask in rows)
    except (TypeError, ValueError, OverflowError) as exc:
        raise StoreError(f"{shown(document.name)}: its gaps are none; index it again") from exc
    before = 0
    for start, end, _ in found:
        if not before <= start < end <= document.frames:
            raise StoreError(f"{shown(document.name)}: its gaps are none; index it again")
        before = end
    return found


def specified_pieces(document: Document) -> Unspecified:
    """Cut a document where what can be told of it changes.

    Parameters
    ----------
    document : Document

    Returns
    -------
    tuple of (int, int, int)
        Start, end and the mask of the features that can't be told between; end to end.
    """
    pieces = []
    at = 0
    for start, end, mask in unspecified_in(document):
        if at < start:
            pieces.append((at, start, 0))
        pieces.append((start, end, mask))
        at = end
    if at < document.frames:
        pieces.append((at, document.frames, 0))
    return tuple(pieces)


def untrusted_between(document: Document, start: int, end: int) -> int:
    """Give the mask of the features that can't be told throughout a stretch of a document.

    Parameters
    ----------
    document : Document
    start, end : int
        Half-open, in frames.

    Returns
    -------
    int
    """
    return untrusted_mask(document) | unspecified_within(unspecified_in(document), start, end)


def told(
    documents: Sequence[Document], numbers: IndexArray, spans: IndexArray, mask: int
) -> BoolArray:
    """Tell which stretches of documents lie clear of gaps in the features that count.

    Parameters
    ----------
    documents : sequence of Document
    numbers : ndarray of int64, shape (H,)
        The document of each stretch.
    spans : ndarray of int64, shape (H, 2)
        Start and end in frames.
    mask : int
        The features that count.

    Returns
    -------
    ndarray of bool, shape (H,)
    """
    clear = np.ones(len(numbers), dtype=np.bool_)
    for number in np.flatnonzero(np.bincount(numbers)).tolist():
        gaps = [row[:2] for row in unspecified_in(documents[number]) if row[2] & mask]
        if gaps:
            starts, ends = np.array(gaps).T
            rows = np.flatnonzero(numbers == number)
            following = np.searchsorted(ends, spans[rows, 0], side="right")
            next_start = np.append(starts, np.iinfo(np.int64).max)[following]
            clear[rows] = next_start >= spans[rows, 1]
    return clear
