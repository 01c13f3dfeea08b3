"""One example as a template: what is far from flipping in it weighs much.

A feature that is just on in the example could as well be off in another person's; one that is
far from its threshold, measured by how much people differ, is what the example means.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.alignment.dtw import align
from mocapidx.alignment.subsequence import CostArray
from mocapidx.alignment.weighted import LARGEST_WEIGHT, match_rows
from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray
from mocapidx.templates.layout import lay_out
from mocapidx.templates.learn import warp
from mocapidx.templates.match import SHARED, Hits, local_minima
from mocapidx.templates.overlaps import best_of_overlapping

__all__ = [
    "ACCEPTED",
    "LIKELY",
    "MOST_ACCEPTED",
    "POWER",
    "SURE",
    "OneShot",
    "Pattern",
    "PatternMatching",
    "accept",
    "flipping_distances",
    "join_examples",
    "lowest_places",
    "match_pattern",
    "pattern_hits",
    "signed_distances",
    "warp_to",
    "weigh",
    "weight_shares",
]

POWER: Final = 1.25
FARTHEST: Final = 40.0
"""Standard deviations beyond which nothing gets surer."""

SURE: Final = 0.2
"""Share of the median cost up to which a hit is as good as certain."""
LIKELY: Final = 0.29
"""Share of the median cost at which false and missed hits are about as many."""
ACCEPTED: Final = 0.4
"""Share of the median cost up to which hits help to sharpen the template."""
MOST_ACCEPTED: Final = 5


@dataclass(frozen=True, slots=True, eq=False)
class OneShot:
    """An example, and how firmly each of its features holds.

    Parameters
    ----------
    bits : ndarray of bool, shape (K, F)
        Its features.
    distances : ndarray of float64, shape (K, F)
        How far each value is from flipping its feature, in the unit of the feature; NaN where
        the example can't tell.
    """

    bits: BoolArray
    distances: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """Features that are expected at each time, and how much each of them matters.

    Parameters
    ----------
    ones : ndarray of bool, shape (K, F)
    weights : ndarray of float64, shape (K, F)
        Whole numbers, so that sums are exact.
    """

    ones: BoolArray
    weights: FloatArray

    @property
    def total(self) -> float:
        """The sum of all weights; a match in which everything disagrees has about this cost."""
        return float(self.weights.sum())

    def without(self, mask: int) -> "Pattern":
        """Give some features no weight, such as those that a rig can't tell; bit i: feature i."""
        kept = [not mask >> bit & 1 for bit in range(self.ones.shape[1])]
        return Pattern(self.ones, self.weights * kept)

    def every(self, step: int) -> "Pattern":
        """Take every so many rows, from the first."""
        return Pattern(self.ones[::step], self.weights[::step])


@dataclass(frozen=True, slots=True, eq=False)
class PatternMatching:
    """A pattern matched with documents that are laid end to end.

    Parameters
    ----------
    costs : ndarray of float32, shape (T,)
        The cost of the best match that ends at each frame: the share of all weight that
        disagrees; infinite where none can end.
    starts : ndarray of int64, shape (T,)
        The first frame of that match in its document.
    bounds : ndarray of int64, shape (D + 1,)
        Document ``d`` has the frames ``bounds[d]`` up to, not including, ``bounds[d + 1]``.
    """

    costs: CostArray
    starts: IndexArray
    bounds: IndexArray


def flipping_distances(bits: BoolArray, strong: FloatArray, weak: FloatArray) -> FloatArray:
    """Say how far each value would have to move for its feature to flip.

    Parameters
    ----------
    bits : ndarray of bool, shape (T, F)
    strong, weak : ndarray of float64, shape (T, F)
        How far the values are above the two thresholds, as `mocapidx.features.extract.Margins`
        has them.

    Returns
    -------
    ndarray of float64, shape (T, F)
        To the weaker threshold where the feature is on, to the stronger where it is off; never
        below 0; NaN where the value is unknown.
    """
    distances: FloatArray = np.maximum(np.where(bits, weak, -strong), 0.0)
    return distances


def signed_distances(example: OneShot, sigma: FloatArray) -> FloatArray:
    """Give the distances in standard deviations, positive where the feature is on.

    Parameters
    ----------
    example : OneShot
    sigma : ndarray of float64, shape (F,)
        How far two people who do the same differ in each feature, in its unit; above 0.

    Returns
    -------
    ndarray of float64, shape (K, F)
        NaN where the example can't tell.
    """
    signed: FloatArray = np.where(example.bits, 1.0, -1.0) * example.distances / sigma
    return signed


def weigh(signed: FloatArray, power: float = POWER) -> Pattern:
    """Turn signed distances into a pattern.

    Parameters
    ----------
    signed : ndarray of float64, shape (K, F)
        As `signed_distances` gives them; what is NaN gets no weight.
    power : float
        How steeply the weight grows with the distance.

    Returns
    -------
    Pattern

    Raises
    ------
    ParameterError
        If nothing has any weight.
    """
    strength = np.minimum(np.abs(np.nan_to_num(signed, nan=0.0)), FARTHEST) / FARTHEST
    weights = np.rint(strength**power * LARGEST_WEIGHT)
    if not weights.any():
        raise ParameterError("no feature of the example can be trusted, so nothing can be like it")
    return Pattern(signed > 0, weights)


def match_pattern(
    pattern: Pattern,
    words: WordArray,
    bounds: IndexArray,
    padded: bool | tuple[BoolArray, BoolArray] = True,
) -> PatternMatching:
    """Match one pattern with many documents; no match crosses documents.

    Parameters
    ----------
    pattern : Pattern
    words : ndarray of uint64, shape (T,)
        The feature words of the documents, end to end.
    bounds : ndarray of int64, shape (D + 1,)
        Where documents begin and end; none is empty.
    padded : bool or pair of ndarray of bool
        As for `mocapidx.templates.match.match_documents`.

    Returns
    -------
    PatternMatching
        All infinite if the pattern has no weight.

    Raises
    ------
    ParameterError
        If a document is empty, the bounds do not fit the words or the pattern is too long.
    """
    laid = lay_out(words, bounds, len(pattern.ones), padded)
    laid_costs, laid_starts = match_rows(pattern.ones, pattern.weights, laid.words, laid.breaks)
    ends = laid.real.copy()
    for document in np.flatnonzero(laid.padding).tolist():  # may end in the repeated last frame
        last = int(ends[bounds[document + 1] - 1])
        tail = laid_costs[last : last + int(laid.padding[document]) + 1]
        ends[bounds[document + 1] - 1] += tail.argmin()
    total = pattern.total
    costs = laid_costs[ends] / total if total else np.full(len(words), np.inf)
    lengths = np.diff(bounds)
    starts = laid_starts[ends] - np.repeat(laid.first, lengths)
    starts = np.clip(starts, 0, np.repeat(lengths - 1, lengths))
    return PatternMatching(costs.astype(np.float32), starts, bounds)


def pattern_hits(matching: PatternMatching) -> Hits:
    """Find every place where the cost is lower than around it, best first.

    Parameters
    ----------
    matching : PatternMatching

    Returns
    -------
    Hits
        As `mocapidx.templates.match.find_hits` has them, whatever they cost.
    """
    minima = local_minima(matching.costs, matching.bounds)
    minima = minima[np.argsort(matching.costs[minima], kind="stable")]
    hits = _hits_at(matching, minima)
    kept = best_of_overlapping(hits.documents, hits.starts, hits.ends, SHARED)
    return Hits(hits.documents[kept], hits.starts[kept], hits.ends[kept], hits.costs[kept])


def lowest_places(matching: PatternMatching) -> Hits:
    """Find the best place of each document.

    Parameters
    ----------
    matching : PatternMatching

    Returns
    -------
    Hits
        One for each document in which a match is possible, in their order.
    """
    spans = zip(matching.bounds[:-1].tolist(), matching.bounds[1:].tolist(), strict=True)
    lowest = [start + int(matching.costs[start:stop].argmin()) for start, stop in spans]
    frames = np.array(lowest, dtype=np.int64)
    return _hits_at(matching, frames[np.isfinite(matching.costs[frames])])


def _hits_at(matching: PatternMatching, frames: IndexArray) -> Hits:
    documents = np.searchsorted(matching.bounds, frames, side="right") - 1
    ends = frames - matching.bounds[documents] + 1
    starts = np.minimum(matching.starts[frames], ends - 1)
    return Hits(documents, starts, ends, matching.costs[frames])


def accept(costs: CostArray, documents: Sequence[int] | IndexArray, median: float) -> IndexArray:
    """Choose hits that are surely like the example, to learn more from.

    Parameters
    ----------
    costs : ndarray of float32, shape (H,)
        Best first.
    documents : sequence of int, shape (H,)
        The document of each.
    median : float
        Median cost of all hits.

    Returns
    -------
    ndarray of int64
        At most five, at most one of each document, all cheap in comparison with the median.
    """
    _, firsts = np.unique(np.asarray(documents), return_index=True)
    firsts = np.sort(firsts)
    good = firsts[costs[firsts] <= ACCEPTED * median]
    return good[:MOST_ACCEPTED].astype(np.int64)


def join_examples(
    bits: BoolArray,
    signed: FloatArray,
    others: Sequence[tuple[BoolArray, FloatArray]],
    trust: Sequence[float],
) -> FloatArray:
    """Average the signed distances of an example and of others like it.

    Parameters
    ----------
    bits : ndarray of bool, shape (K, F)
        The example's features.
    signed : ndarray of float64, shape (K, F)
        Its signed distances.
    others : sequence of (ndarray of bool, ndarray of float64), each of shape (L, F)
        Features and signed distances of the others; they are warped to the example's frames.
    trust : sequence of float
        The weight of each; the example's own is 1.

    Returns
    -------
    ndarray of float64, shape (K, F)
        The mean of what is known; NaN where nothing is.
    """
    known = np.isfinite(signed)
    total, weights = np.where(known, signed, 0.0), known.astype(np.float64)
    for weight, warped in zip(trust, warp_to(bits, others), strict=True):
        known = np.isfinite(warped)
        total += weight * np.where(known, warped, 0.0)
        weights += weight * known
    mean: FloatArray = np.divide(
        total, weights, out=np.full(total.shape, np.nan), where=weights > 0
    )
    return mean


def warp_to(
    bits: BoolArray, others: Sequence[tuple[BoolArray, FloatArray]]
) -> Iterator[FloatArray]:
    """Warp values of others to the frames of an example, aligned by the features of both.

    Parameters
    ----------
    bits : ndarray of bool, shape (K, F)
        The example's features.
    others : sequence of (ndarray of bool, ndarray of float64), each of shape (L, F)
        Features of each, and the values to be warped; NaN where unknown.

    Yields
    ------
    ndarray of float64, shape (K, F)
        One for each of the others; NaN where none of the frames that meet is known.
    """
    paths = align(bits.astype(np.float64), [own.astype(np.float64) for own, _ in others])
    for (_, rows, columns), (own, values) in zip(paths, others, strict=True):
        known, even = np.isfinite(values), np.ones(len(own))
        warped, _ = warp(np.where(known, values, 0.0), even, rows, columns)
        share, _ = warp(known.astype(np.float64), even, rows, columns)
        yield np.divide(warped, share, out=np.full(warped.shape, np.nan), where=share > 0)


def weight_shares(pattern: Pattern) -> Iterator[tuple[int, float]]:
    """Say which features a pattern is about: what the example "means".

    Parameters
    ----------
    pattern : Pattern

    Yields
    ------
    feature : int
        From 0; the weightiest first, those without weight not at all.
    share : float
        Of all weight.
    """
    shares = pattern.weights.sum(axis=0) / pattern.total
    for feature in np.argsort(-shares, kind="stable").tolist():
        if shares[feature] > 0:
            yield feature, float(shares[feature])
