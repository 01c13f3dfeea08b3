"""The segmentation by selected features, and sequences of feature vectors in it.

A selection is a coarser feature function: documents are cut where one of the selected features
changes. One pass over the runs of the sub-indexes finds these segments; it is the quick way
where a selection says so little that no step of a query is rare.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mocapidx.features.words import part_words
from mocapidx.model import IndexArray, WordArray
from mocapidx.queries.source import PartSource
from mocapidx.queries.stretches import spread_bits

__all__ = ["match_selection", "selected_segments"]

FREE_BIT = 1 << 31
"""Only the word at free numbers has it, so a document's last segment ends with the document."""


def match_selection(
    parts: Sequence[PartSource], mask: int, values: WordArray, rarest: int
) -> IndexArray:
    """Find a sequence of feature vectors in the segmentation by the selected features.

    Parameters
    ----------
    parts : sequence of PartSource
        The sub-indexes of the selected features.
    mask : int
        The selected features.
    values : ndarray of uint64, shape (L,)
        The feature vectors, 0 outside of `mask`; neighbours differ.
    rarest : int
        The one to look for first, 0 to L - 1.

    Returns
    -------
    ndarray of int64, shape (H, L + 1)
        Bounds of the segments of each hit, in positions, ascending.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 4 (segmentations adapt to the
       selected features) and equation 4.
    """
    wanted = [part_words(values, part.mask) for part in parts]
    selected = np.array([mask], np.uint64)
    coarse = [_coarsen(part, int(part_words(selected, part.mask)[0])) for part in parts]
    starts, places = _combine([starts for starts, _ in coarse])
    columns = [keys[place] for (_, keys), place in zip(coarse, places, strict=True)]
    found = np.ones(len(starts), np.bool_)
    for keys, words in zip(columns, wanted, strict=True):
        found &= keys == words[rarest]
    hits = np.flatnonzero(found) - rarest
    hits = hits[hits >= 0]
    for step in sorted(range(len(values)), key=lambda step: abs(step - rarest)):
        for keys, words in zip(columns, wanted, strict=True):
            # The last segment is a free one, which nothing equals.
            hits = hits[keys.take(hits + step, mode="clip") == words[step]]
    segments = hits[:, np.newaxis] + np.arange(len(values) + 1)
    return np.asarray(starts[segments], dtype=np.int64)


def selected_segments(
    parts: Sequence[PartSource], mask: int
) -> tuple[IndexArray, WordArray, IndexArray]:
    """Cut all documents where one of the selected features changes.

    Parameters
    ----------
    parts : sequence of PartSource
        The sub-indexes of the selected features.
    mask : int
        The selected features.

    Returns
    -------
    starts : ndarray of int64, shape (N,)
        Where each segment starts, in positions; the free place after each document has one too.
    words : ndarray of uint64, shape (N,)
        Its feature vector, 0 outside of `mask`.
    free : ndarray of int64, shape (D,)
        The segments, by their number, that are free places.
    """
    selected = np.array([mask], np.uint64)
    coarse = [_coarsen(part, int(part_words(selected, part.mask)[0])) for part in parts]
    starts, places = _combine([starts for starts, _ in coarse])
    columns = [keys[place] for (_, keys), place in zip(coarse, places, strict=True)]
    words = np.zeros(len(starts), np.uint64)
    for keys, part in zip(columns, parts, strict=True):
        words |= spread_bits(keys & np.uint32(FREE_BIT - 1), part.mask)
    free = np.flatnonzero(columns[0] & np.uint32(FREE_BIT))
    return starts.astype(np.int64), words & np.uint64(mask), free


def _coarsen(part: PartSource, mask: int) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Give start positions and words of the segments by the selected features of a sub-index."""
    keys = part.words.whole() & np.uint32(mask | FREE_BIT)
    changes = np.flatnonzero(keys[1:] != keys[:-1]) + 1
    changes = np.append(0, changes) if len(keys) else changes
    return part.starts.whole()[changes], keys[changes]


def _combine(
    starts: Sequence[NDArray[np.uint32]],
) -> tuple[NDArray[np.uint32], list[IndexArray]]:
    """Lay segmentations over each other.

    Parameters
    ----------
    starts : sequence of ndarray of uint32
        Start positions of the segments of each, beginning with the same one.

    Returns
    -------
    combined : ndarray of uint32, shape (N,)
        Start positions of the segments of all together.
    places : list of ndarray of int64, each of shape (N,)
        The segment of each of them that a combined one lies in.
    """
    if len(starts) == 1:
        return starts[0], [np.arange(len(starts[0]))]
    laid = np.concatenate(starts)
    order = np.argsort(laid, kind="stable")
    laid = laid[order]
    last = np.flatnonzero(np.append(laid[1:] != laid[:-1], len(laid) > 0))
    owners = np.repeat(np.arange(len(starts)), [len(own) for own in starts])[order]
    return laid[last], [np.cumsum(owners == i)[last] - 1 for i in range(len(starts))]
