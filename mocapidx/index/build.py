"""Runs of each sub-index over the documents of a segment file, in one numbering.

Documents are laid end to end and one number is left free after each of them, among the
positions (frames) as among the runs, so that nothing that looks at neighbours ever joins the
end of one document with the beginning of the next.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.features.words import part_words
from mocapidx.model import IndexArray, WordArray
from mocapidx.segments.runs import find_runs

__all__ = ["FREE_WORD", "MAX_PART_FEATURES", "PartRuns", "build_runs", "first_positions"]

FREE_WORD: Final = 0xFFFFFFFF
"""Stands at a free run number, where no part's word can be."""

MAX_PART_FEATURES: Final = 31
"""One less than a word has bits, or a word of ones would look like a free number."""

MAX_POSITIONS: Final = 2**32 - 1


@dataclass(frozen=True, slots=True)
class PartRuns:
    """The runs of one sub-index over all documents of a segment file.

    Parameters
    ----------
    starts : ndarray of uint32, shape (R,)
        Start position of each run; a free number carries the position just after the last
        frame of its document, so that run ``r`` spans ``starts[r]`` up to ``starts[r + 1]``.
    words : ndarray of uint32, shape (R,)
        The part's word of each run, `FREE_WORD` at the free numbers.
    """

    starts: NDArray[np.uint32]
    words: NDArray[np.uint32]


def first_positions(lengths: Sequence[int] | IndexArray) -> IndexArray:
    """Give the position of the first frame of each document.

    Parameters
    ----------
    lengths : sequence of int, shape (D,)
        Frames of each document.

    Returns
    -------
    ndarray of int64, shape (D,)
        Document ``d`` spans the positions ``first[d]`` up to, not including,
        ``first[d] + lengths[d]``; that one is free.
    """
    spans = np.asarray(lengths, dtype=np.int64) + 1
    return np.cumsum(spans) - spans


def build_runs(words: Sequence[WordArray], part_mask: int) -> PartRuns:
    """Cut documents into the runs of one sub-index.

    Parameters
    ----------
    words : sequence of ndarray of uint64, each of shape (T,)
        The feature words of each document, one a frame.
    part_mask : int
        The features of the sub-index.

    Returns
    -------
    PartRuns
        In the numbering of this module.

    Raises
    ------
    ParameterError
        If the sub-index has more than 31 features, a document has no frames, or all documents
        together have too many frames for one segment file.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, sections 4 and 5.3.

    Examples
    --------
    >>> runs = build_runs([np.array([2, 2, 3], np.uint64), np.array([3], np.uint64)], 3)
    >>> runs.starts.tolist(), (runs.words & 3).tolist()
    ([0, 2, 3, 4, 5], [2, 3, 3, 3, 3])
    """
    if part_mask.bit_count() > MAX_PART_FEATURES:
        raise ParameterError(
            f"a sub-index has {part_mask.bit_count()} features, at most {MAX_PART_FEATURES} "
            "fit: put some of them into another one"
        )
    lengths = [len(document) for document in words]
    if sum(lengths) + len(lengths) > MAX_POSITIONS:
        raise ParameterError(
            f"{sum(lengths)} frames are too many for one segment file: index in smaller batches"
        )
    starts, values = [np.zeros(0, np.uint32)], [np.zeros(0, np.uint32)]
    for first, document in zip(first_positions(lengths), words, strict=True):
        run_words, bounds = find_runs(part_words(document, part_mask))
        starts.append((first + bounds).astype(np.uint32))
        values.append(np.append(run_words, np.uint32(FREE_WORD)))
    return PartRuns(np.concatenate(starts), np.concatenate(values))
