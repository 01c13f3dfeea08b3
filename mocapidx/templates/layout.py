"""Documents laid end to end for matching, with their first and last frames repeated."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.alignment.subsequence import shortest_match
from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, IndexArray, WordArray

__all__ = ["Layout", "end_padding", "lay_out", "narrowed"]

PADDING: Final = 0.05  # of the template's rows, at each end of a document


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Documents laid end to end for matching, the first and last frame of each repeated.

    Parameters
    ----------
    words : ndarray of uint64, shape (L,)
        With the padding, and two frames between documents.
    breaks : ndarray of int64
        The frames between documents.
    first : ndarray of int64, shape (D,)
        Where each document's first frame stands.
    padding : ndarray of int64, shape (D,)
        How often each document's last frame is repeated.
    real : ndarray of int64, shape (T,)
        Where the frames of the documents stand.
    """

    words: WordArray
    breaks: IndexArray
    first: IndexArray
    padding: IndexArray
    real: IndexArray


def lay_out(
    words: WordArray,
    bounds: IndexArray,
    rows: int,
    padded: bool | tuple[BoolArray, BoolArray] = True,
) -> Layout:
    """Lay documents out for matching with a template of so many rows.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        The feature words of the documents, end to end.
    bounds : ndarray of int64, shape (D + 1,)
        Where documents begin and end; none is empty.
    rows : int
    padded : bool or pair of ndarray of bool, each of shape (D,)
        Repeat the first and the last frame of each document, as `end_padding` says. As a pair:
        those whose first frames, and those whose last frames are repeated.

    Returns
    -------
    Layout

    Raises
    ------
    ParameterError
        If a document is empty or the bounds do not fit the words.
    """
    lengths = np.diff(bounds)
    if bounds[0] != 0 or bounds[-1] != len(words) or (lengths <= 0).any():
        raise ParameterError("bounds must rise from 0 to the number of words")
    repeated = end_padding(lengths, rows)
    at_first, at_last = padded if isinstance(padded, tuple) else (padded, padded)
    front, padding = repeated * at_first, repeated * at_last
    spans = front + lengths + padding + 2
    ends = np.cumsum(spans)
    first = ends - spans + front
    breaks = np.column_stack((ends - 2, ends - 1)).ravel()
    real = np.arange(len(words)) + np.repeat(first - bounds[:-1], lengths)
    laid = np.zeros(int(spans.sum()), dtype=np.uint64)
    laid[real] = words
    _repeat(laid, first - front, front, words[bounds[:-1]])
    _repeat(laid, first + lengths, padding, words[bounds[1:] - 1])
    return Layout(laid, breaks, first, padding, real)


def narrowed(
    laid: Layout,
    bounds: IndexArray,
    rows: int,
    padded: bool | tuple[BoolArray, BoolArray] = True,
) -> Layout:
    """Use a layout for a template of fewer rows, whose documents are padded less.

    Parameters
    ----------
    laid : Layout
        For a template of as many rows or more.
    bounds : ndarray of int64, shape (D + 1,)
    rows : int
        Of the other template.
    padded : bool or pair of ndarray of bool
        As for the layout.

    Returns
    -------
    Layout
        The same words; what is too much of the padding counts as breaks.
    """
    lengths = np.diff(bounds)
    repeated = end_padding(lengths, rows)
    at_first, at_last = padded if isinstance(padded, tuple) else (padded, padded)
    front, padding = repeated * at_first, repeated * at_last
    ends = laid.breaks[1::2] + 1
    begins = np.concatenate(([0], ends[:-1]))
    starts = np.column_stack((begins, laid.first + lengths + padding)).ravel()
    lengths_of_breaks = np.column_stack((laid.first - front, ends)).ravel() - starts
    places = np.repeat(starts - np.cumsum(lengths_of_breaks) + lengths_of_breaks, lengths_of_breaks)
    breaks = np.arange(len(places)) + places
    return Layout(laid.words, breaks, laid.first, padding, laid.real)


def _repeat(laid: WordArray, starts: IndexArray, times: IndexArray, words: WordArray) -> None:
    """Write each of some words so many times in a row."""
    places = np.arange(times.sum()) + np.repeat(starts - np.cumsum(times) + times, times)
    laid[places] = np.repeat(words, times)


def end_padding(lengths: IndexArray, rows: int) -> IndexArray:
    """Say how often the first and the last frame of a document are repeated for matching.

    Parameters
    ----------
    lengths : ndarray of int64, shape (D,)
        Frames of each document.
    rows : int
        Rows of the template.

    Returns
    -------
    ndarray of int64, shape (D,)
        A twentieth of the template, and for a document that is too short to be found until it
        is not.
    """
    missing = shortest_match(rows) - lengths
    return np.maximum(np.ceil(PADDING * rows), -(-missing // 2)).astype(np.int64)
