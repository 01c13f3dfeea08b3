"""How far two people who do the same thing differ in each feature; no labels needed.

Short stretches of motion are looked for in other documents. What is found is mostly the same
thing done by somebody else, and the differences of the values tell the standard deviation.
"""

import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.features.featureset import FeatureSet, load_feature_set
from mocapidx.features.relations import Condition, leaves, normal_form
from mocapidx.features.words import unpack_words
from mocapidx.model import FloatArray, IndexArray, WordArray
from mocapidx.templates.match import Hits
from mocapidx.templates.oneshot import (
    OneShot,
    lowest_places,
    match_pattern,
    signed_distances,
    warp_to,
    weigh,
)

__all__ = ["FEWEST_DOCUMENTS", "Sample", "estimate_sigma", "usual_sigma"]

FEWEST_DOCUMENTS: Final = 50
"""Below, a store says more about its few recordings than about people."""

SECONDS: Final = 1.0
STRETCHES: Final = 100
BEST: Final = 3
ROUNDS: Final = 2
SEED: Final = 2006
# The mean absolute difference of two normal values is 2 / sqrt(pi) standard deviations.
SIGMA_FROM_MEAN: Final = 1.2533 / np.sqrt(2)

TABLE: Final = Path(__file__).parent / "sigmas" / "f39.toml"
HUMERUS: Final = 0.3  # m, of an adult


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """A piece of a document.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
    values : ndarray of float64, shape (T, F)
        The values beneath the features; NaN where unknown, also for untrusted features.
    distances : ndarray of float64, shape (T, F)
        How far they are from flipping (`mocapidx.templates.oneshot.flipping_distances`).
    untrusted : int
        Mask of the features that the document can't tell.
    """

    words: WordArray
    values: FloatArray
    distances: FloatArray
    untrusted: int


def usual_sigma(feature_set: FeatureSet) -> FloatArray:
    """Give the standard deviations that come with mocapidx.

    Parameters
    ----------
    feature_set : FeatureSet
        Any. A feature with the value of one of `f39` has its standard deviation, whatever the
        thresholds; another one what is usual among those of its unit.

    Returns
    -------
    ndarray of float64, shape (F,)
        In the unit of each feature, all above 0.
    """
    by_value, by_unit = _table()
    return np.array(
        [
            by_value.get(_value(feature.condition)) or by_unit[_unit(feature.condition)]
            for feature in feature_set.features
        ]
    )


@cache
def _table() -> tuple[dict[Condition, float], dict[str, float]]:
    """Read the shipped table: by what is measured, and the geometric means by unit."""
    shipped = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    by_value: dict[Condition, float] = {}
    same_unit: dict[str, list[float]] = {}
    for feature in load_feature_set(shipped["feature_set"]).features:
        sigma = shipped["sigma"][feature.id]
        by_value[_value(feature.condition)] = sigma
        same_unit.setdefault(_unit(feature.condition), []).append(sigma)
    by_unit = {unit: float(np.exp(np.log(all_).mean())) for unit, all_ in same_unit.items()}
    for suffix in ("", "/s"):
        by_unit["m" + suffix] = HUMERUS * by_unit["hl" + suffix]
        for width in ("sw", "hw"):
            by_unit.setdefault(width + suffix, by_unit["hl" + suffix])
    return by_value, by_unit


def _value(condition: Condition) -> Condition:
    """Give a condition without its thresholds: what is measured."""
    return normal_form(_without_thresholds(condition))


def _without_thresholds(condition: Condition) -> Condition:
    parts = tuple(map(_without_thresholds, condition.of))
    return replace(condition, when="", on=0.0, off=0.0, of=parts)


def _unit(condition: Condition) -> str:
    return next(leaves(condition)).unit


def estimate_sigma(samples: Sequence[Sample], feature_set: FeatureSet, rate: float) -> FloatArray:
    """Measure how far the values of two people differ where both do the same.

    Parameters
    ----------
    samples : sequence of Sample
        Of different documents.
    feature_set : FeatureSet
    rate : float
        Frames a second, in Hz.

    Returns
    -------
    ndarray of float64, shape (F,)
        In the unit of each feature, the same for both sides of the body; NaN where nothing was
        found, as for features that no sample can tell.
    """
    frames = max(3, round(SECONDS * rate))
    chosen = _stretches([len(sample.words) for sample in samples], frames)
    values = np.concatenate([sample.values for sample in samples])
    known = np.isfinite(values)
    counts = np.maximum(known.sum(axis=0), 1)
    means = np.where(known, values, 0.0).sum(axis=0) / counts
    squares = np.where(known, (values - means) ** 2, 0.0).sum(axis=0)
    sigma = np.sqrt(squares / counts)
    for _ in range(ROUNDS):
        if len(samples) > 1 and chosen:
            sigma = _measured(samples, chosen, frames, np.where(sigma > 0, sigma, np.inf))
    return _both_sides(sigma, feature_set.mirror)


def _stretches(lengths: Sequence[int], frames: int) -> list[tuple[int, int]]:
    """Draw stretches: the sample and the first frame of each."""
    places = np.maximum(np.array(lengths) - frames + 1, 0)
    ends = np.cumsum(places)
    if not len(ends) or not ends[-1]:
        return []
    drawn = np.random.default_rng(SEED).integers(0, ends[-1], STRETCHES)
    sample = np.searchsorted(ends, drawn, side="right")
    first = drawn - (ends - places)[sample]
    return list(zip(sample.tolist(), first.tolist(), strict=True))


def _measured(
    samples: Sequence[Sample], chosen: Iterable[tuple[int, int]], frames: int, sigma: FloatArray
) -> FloatArray:
    """Measure the deviations, the stretches being weighed by those of the round before."""
    total, count = np.zeros((2, len(sigma)))
    groups = _groups(samples)
    for own, first in chosen:
        sample, part = samples[own], slice(first, first + frames)
        bits = unpack_words(sample.words[part], len(sigma))
        signed = signed_distances(OneShot(bits, sample.distances[part]), sigma)
        if not np.nan_to_num(signed, nan=0.0).any():
            continue
        others = []
        for other, start, end in _best_elsewhere(samples, groups, own, signed):
            there = slice(start, end)
            words, values = samples[other].words[there], samples[other].values[there]
            others.append((unpack_words(words, len(sigma)), values))
        for warped in warp_to(bits, others):
            gaps = np.abs(warped - sample.values[part])
            known = np.isfinite(gaps)
            total += np.where(known, gaps, 0.0).sum(axis=0)
            count += known.sum(axis=0)
    mean = np.divide(total, count, out=np.full(len(sigma), np.nan), where=count > 0)
    measured: FloatArray = SIGMA_FROM_MEAN * mean
    return measured


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Samples that can't tell the same features, end to end."""

    numbers: IndexArray
    untrusted: int
    words: WordArray
    bounds: IndexArray


def _groups(samples: Sequence[Sample]) -> list[_Group]:
    numbers: dict[int, list[int]] = {}
    for number, sample in enumerate(samples):
        numbers.setdefault(sample.untrusted, []).append(number)
    groups = []
    for untrusted, own in numbers.items():
        words = [samples[number].words for number in own]
        bounds = np.concatenate(([0], np.cumsum([len(each) for each in words]))).astype(np.int64)
        groups.append(_Group(np.array(own), untrusted, np.concatenate(words), bounds))
    return groups


def _best_elsewhere(
    samples: Sequence[Sample], groups: Sequence[_Group], own: int, signed: FloatArray
) -> list[tuple[int, int, int]]:
    """Find the best places in other samples: number, first frame and end of each."""
    pattern = weigh(signed, power=1.0)
    found: list[tuple[float, int, int, int]] = []
    for group in groups:
        trusted = pattern.without(group.untrusted)
        hits: Hits = lowest_places(match_pattern(trusted, group.words, group.bounds))
        columns = (hits.costs, group.numbers[hits.documents], hits.starts, hits.ends)
        found += zip(*(column.tolist() for column in columns), strict=True)
    return [place[1:] for place in sorted(found) if place[1] != own][:BEST]


def _both_sides(sigma: FloatArray, mirror: IndexArray) -> FloatArray:
    """Average left and right; a side that is not known is as the other."""
    both = np.array([sigma, sigma[mirror]])
    known = np.isfinite(both)
    total = np.where(known, both, 0.0).sum(axis=0)
    unknown = np.full(len(sigma), np.nan)
    mean: FloatArray = np.divide(total, known.sum(axis=0), out=unknown, where=known.any(axis=0))
    return mean
