"""Match quantised templates with documents: distance functions and the hits in them."""

from bisect import bisect_left, insort
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mocapidx.alignment.subsequence import (
    CostArray,
    Steps,
    many_subsequence_costs,
    subsequence_costs,
    subsequence_starts,
)
from mocapidx.model import BoolArray, IndexArray, WordArray
from mocapidx.templates.layout import Layout, end_padding, lay_out, narrowed
from mocapidx.templates.quantise import Quantised, quantise
from mocapidx.templates.template import MotionTemplate

__all__ = [
    "SHARED",
    "Hits",
    "Matching",
    "distance_function",
    "end_padding",
    "find_hits",
    "local_minima",
    "lowest_costs",
    "match_documents",
    "match_several",
    "merge_hits",
]

SHARED = 0.5
CELLS_AT_ONCE = 1 << 23  # costs of several templates that are held together
CANDIDATES = 1024  # best minima whose starts are found first; then ever more at a time


@dataclass(frozen=True, slots=True, eq=False)
class Matching:
    """A template matched with documents that are laid end to end.

    Parameters
    ----------
    costs : ndarray of float32, shape (T,)
        The distance function of each document, one after the other: the cost of the best match
        that ends at a frame, infinite where none can.
    bounds : ndarray of int64, shape (D + 1,)
        Document ``d`` has the frames ``bounds[d]`` up to, not including, ``bounds[d + 1]``.
    quantised : Quantised
    steps : {"weighted", "printed"}
    laid_words : ndarray of uint64
        The words with the padding, and two frames between documents.
    laid_costs : ndarray of float32
        The costs over those.
    laid_breaks : ndarray of int64
        The frames between documents.
    laid_first : ndarray of int64, shape (D,)
        Where each document's first frame stands among them.
    padding : ndarray of int64, shape (D,)
        How often each document's last frame is repeated.
    """

    costs: CostArray
    bounds: IndexArray
    quantised: Quantised
    steps: Steps
    laid_words: WordArray
    laid_costs: CostArray
    laid_breaks: IndexArray
    laid_first: IndexArray
    padding: IndexArray


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """Places where a template matches, best first.

    Parameters
    ----------
    documents : ndarray of int64, shape (H,)
        Number of the document.
    starts, ends : ndarray of int64, shape (H,)
        In frames of the document, half open.
    costs : ndarray of float32, shape (H,)
    """

    documents: IndexArray
    starts: IndexArray
    ends: IndexArray
    costs: CostArray


def distance_function(
    template: MotionTemplate,
    words: WordArray,
    steps: Steps = "weighted",
    padded: bool = True,
    untrusted: int = 0,
) -> CostArray:
    """Cost of the best match of a template that ends at each frame of one document.

    Parameters
    ----------
    template : MotionTemplate
        Quantised by its own delta.
    words : ndarray of uint64, shape (T,)
        The feature words of the document.
    steps : {"weighted", "printed"}
        See `mocapidx.alignment.subsequence.subsequence_costs`.
    padded : bool
        Repeat the first and the last frame, so that a document that is cut short can be found.
    untrusted : int
        Mask of features that the document can't tell; they count as undecided.

    Returns
    -------
    ndarray of float32, shape (T,)
        Infinite where no match can end.
    """
    quantised = quantise(template.matrix, template.delta).without(untrusted)
    return match_documents(quantised, words, np.array([0, len(words)]), steps, padded).costs


def match_documents(
    quantised: Quantised,
    words: WordArray,
    bounds: IndexArray,
    steps: Steps = "weighted",
    padded: bool | tuple[BoolArray, BoolArray] = True,
) -> Matching:
    """Match one template with many documents in one pass; no match crosses documents.

    Parameters
    ----------
    quantised : Quantised
    words : ndarray of uint64, shape (T,)
        The feature words of the documents, end to end.
    bounds : ndarray of int64, shape (D + 1,)
        Where documents begin and end; none is empty.
    steps : {"weighted", "printed"}
    padded : bool or pair of ndarray of bool, each of shape (D,)
        Repeat the first and the last frame of each document, as `end_padding` says. A match that
        ends in the repeated frames counts as one that ends at the last frame. As a pair: those
        whose first frames, and those whose last frames are repeated.

    Returns
    -------
    Matching

    Raises
    ------
    ParameterError
        If a document is empty or the bounds do not fit the words.
    """
    laid = lay_out(words, bounds, len(quantised.ones), padded)
    laid_costs = subsequence_costs(quantised.ones, quantised.care, laid.words, laid.breaks, steps)
    return _matching(quantised, bounds, steps, laid, laid_costs)


def match_several(
    several: Sequence[Quantised],
    words: WordArray,
    bounds: IndexArray,
    steps: Steps = "weighted",
    padded: bool | tuple[BoolArray, BoolArray] = True,
    threads: int = 1,
) -> Iterator[Matching]:
    """Match several templates with many documents, some templates at a time.

    Parameters
    ----------
    several : sequence of Quantised
    words, bounds, steps, padded
        As for `match_documents`.
    threads : int
        Share the frames among so many threads; changes nothing in the result.

    Yields
    ------
    Matching
        The same as each by itself.

    Raises
    ------
    ParameterError
        As `match_documents`.
    """
    at_once = max(1, CELLS_AT_ONCE // max(len(words), 1))
    for start in range(0, len(several), at_once):
        some = several[start : start + at_once]
        laid = lay_out(words, bounds, max(len(one.ones) for one in some), padded)
        own = [narrowed(laid, bounds, len(one.ones), padded) for one in some]
        templates = [(one.ones, one.care) for one in some]
        breaks = [one.breaks for one in own]
        costs = many_subsequence_costs(templates, laid.words, breaks, steps, threads)
        for quantised, own_laid, own_costs in zip(some, own, costs, strict=True):
            yield _matching(quantised, bounds, steps, own_laid, own_costs)


def _matching(
    quantised: Quantised, bounds: IndexArray, steps: Steps, laid: Layout, laid_costs: CostArray
) -> Matching:
    costs = laid_costs[laid.real]
    last = laid.first + np.diff(bounds) - 1
    # reduceat takes every other stretch: from the last frame to the end of its padding
    stretches = np.column_stack((last, last + laid.padding + 1)).ravel()
    costs[bounds[1:] - 1] = np.minimum.reduceat(laid_costs, stretches)[::2]
    return Matching(
        costs,
        bounds,
        quantised,
        steps,
        laid.words,
        laid_costs,
        laid.breaks,
        laid.first,
        laid.padding,
    )


def lowest_costs(matching: Matching) -> CostArray:
    """Return the lowest cost in each document, float32 of shape (D,)."""
    return np.minimum.reduceat(matching.costs, matching.bounds[:-1])


def local_minima(costs: CostArray, bounds: IndexArray) -> IndexArray:
    """Frames at which a distance function is lower than before and after.

    A plateau counts once, at its first frame; the ends of a document count as rising.

    Parameters
    ----------
    costs : ndarray of float32, shape (T,)
        The distance functions of several documents, end to end.
    bounds : ndarray of int64, shape (D + 1,)

    Returns
    -------
    ndarray of int64
        Ascending; frames of infinite cost are not among them.
    """
    opening = np.zeros(len(costs), dtype=np.bool_)
    opening[bounds[:-1]] = True
    changes = opening.copy()
    changes[1:] |= costs[1:] != costs[:-1]
    firsts = np.flatnonzero(changes)
    values, opens = costs[firsts], opening[firsts]
    falls = opens | np.concatenate(([True], values[:-1] > values[1:]))
    rises = np.concatenate((opens[1:] | (values[1:] > values[:-1]), [True]))
    return firsts[falls & rises & np.isfinite(values)]


def _minima_below(costs: CostArray, bounds: IndexArray, tau: float) -> IndexArray:
    """Find the local minima below a threshold without a look at what is above it."""
    low = np.flatnonzero(costs < tau)
    opening = np.ones(len(low) + 1, dtype=np.bool_)  # and one for the end
    documents = np.searchsorted(bounds, low, side="right")
    opening[1:-1] = (np.diff(low) > 1) | (np.diff(documents) > 0)
    return low[local_minima(costs[low], np.flatnonzero(opening))]


def find_hits(
    matching: Matching, tau: float, *, top: int | None = None, shared: float = SHARED
) -> Hits:
    """Find the places where a template matches at a cost below a threshold, best first.

    Parameters
    ----------
    matching : Matching
    tau : float
        Local minima of the distance function below `tau` are hits.
    top : int, optional
        Stop after so many hits; others of the same cost as the last one are kept too.
    shared : float
        A hit that shares more than this part of the shorter interval with a better one of the
        same document is dropped.

    Returns
    -------
    Hits
        Ordered by cost, then document, then start.
    """
    minima = _minima_below(matching.costs, matching.bounds, tau)
    minima = minima[np.argsort(matching.costs[minima], kind="stable")]
    kept = _Kept(shared)
    while len(minima):
        some, minima = np.split(minima, [CANDIDATES + 3 * len(kept.found)])
        documents, starts, ends = _intervals(matching, some)
        for candidate in zip(
            *(column.tolist() for column in (matching.costs[some], documents, starts, ends)),
            strict=True,
        ):
            if top is not None and len(kept.found) >= top and candidate[0] > kept.found[top - 1][0]:
                return kept.hits()
            kept.offer(*candidate)
    return kept.hits()


def merge_hits(several: Sequence[Hits], shared: float = SHARED) -> Hits:
    """Put the hits of several templates of one class together, best first.

    Parameters
    ----------
    several : sequence of Hits
        In the same documents.
    shared : float
        As for `find_hits`.

    Returns
    -------
    Hits
    """
    kept = _Kept(shared)
    columns = ("costs", "documents", "starts", "ends")
    arrays = [np.concatenate([getattr(hits, name) for hits in several]) for name in columns]
    for candidate in sorted(zip(*(array.tolist() for array in arrays), strict=True)):
        kept.offer(*candidate)
    return kept.hits()


class _Kept:
    """The hits kept so far; candidates are offered best first."""

    def __init__(self, shared: float) -> None:
        self.found: list[tuple[float, int, int, int]] = []
        self._shared = shared
        self._longest = 0
        self._by_document: dict[int, list[tuple[int, int]]] = defaultdict(list)

    def offer(self, cost: float, document: int, start: int, end: int) -> None:
        """Keep a hit unless a better one covers too much of it, or it of a better one."""
        intervals = self._by_document[document]
        first = bisect_left(intervals, (start - self._longest, 0))
        near = intervals[first : bisect_left(intervals, (end, 0))]
        for other_start, other_end in near:
            common = min(end, other_end) - max(start, other_start)
            if common > self._shared * min(end - start, other_end - other_start):
                return
        insort(intervals, (start, end))
        self._longest = max(self._longest, end - start)
        self.found.append((cost, document, start, end))

    def hits(self) -> Hits:
        """Give what was kept, by cost, then document, then start."""
        rows = sorted(self.found)
        costs, documents, starts, ends = zip(*rows, strict=True) if rows else ((), (), (), ())
        return Hits(
            np.array(documents, dtype=np.int64),
            np.array(starts, dtype=np.int64),
            np.array(ends, dtype=np.int64),
            np.array(costs, dtype=np.float32),
        )


def _intervals(matching: Matching, frames: IndexArray) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Document, first frame and end of the best matches that end at some frames."""
    bounds = matching.bounds
    documents = np.searchsorted(bounds, frames, side="right") - 1
    ends = frames - bounds[documents]
    laid_ends = matching.laid_first[documents] + ends
    for hit in np.flatnonzero(frames + 1 == bounds[documents + 1]):  # may end in the padding
        tail = slice(laid_ends[hit], laid_ends[hit] + matching.padding[documents[hit]] + 1)
        laid_ends[hit] += matching.laid_costs[tail].argmin()
    laid_starts = subsequence_starts(
        matching.quantised.ones,
        matching.quantised.care,
        matching.laid_words,
        laid_ends,
        matching.laid_breaks,
        matching.steps,
    )
    starts = np.clip(laid_starts - matching.laid_first[documents], 0, ends)
    return documents, starts, ends + 1
