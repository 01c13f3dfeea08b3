"""From joint positions to boolean features, and to the real values beneath them."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from mocapidx.features.featureset import AnyFeatureSet, FeatureSet, load_feature_set
from mocapidx.features.geometry import Poses, difference_quotient
from mocapidx.features.measures import Measures, measure_values, measures_of
from mocapidx.features.relations import (
    Condition,
    combine,
    combine_margins,
    leaves,
    open_interval,
    robust_threshold,
)
from mocapidx.features.trust import absent_joints, body_lengths, untrusted_features
from mocapidx.model import BoolArray, FloatArray, IndexArray, Motion
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.skeleton.resample import resample_motion

__all__ = [
    "Margins",
    "all_features",
    "condition_values",
    "extract_features",
    "feature_margins",
    "feature_values",
    "untrusted_features",
]

# Frames worked on at a time: enough to make each array operation worth its call, few enough
# to stay in the cache.
BLOCK: Final = 2_048


@dataclass(frozen=True, slots=True)
class Margins:
    """How far each feature is from each of its thresholds.

    Parameters
    ----------
    strong : ndarray of float64, shape (T, F)
        Above 0 where the strong test holds: what a feature that is off lacks to turn on is
        ``-strong``. In the unit of the feature; NaN where the value is unknown.
    weak : ndarray of float64, shape (T, F)
        Above 0 where the weak test holds: what a feature that is on can lose before it turns
        off.
    """

    strong: FloatArray
    weak: FloatArray


def extract_features(
    motion: Motion, feature_set: AnyFeatureSet = "f39", rate: float = 30.0
) -> BoolArray:
    """Compute the boolean features of a motion.

    Parameters
    ----------
    motion : Motion
        Joints in any order; further joints are passed over.
    feature_set : str, Path or FeatureSet
        A shipped name, the path of a TOML file, or a set.
    rate : float
        The motion is resampled to this rate, in Hz.

    Returns
    -------
    ndarray of bool, shape (T, F)
        One row a frame at `rate`. Features that the motion's joints can't tell are 0
        throughout; `untrusted_features` says which.

    Raises
    ------
    FeatureSetError
        If there is no such feature set, or it is wrong.

    References
    ----------
    .. [1] Mueller, Roeder, "A relational approach to content-based analysis of motion capture
       data", sections 4.1 to 4.4.
    """
    features = load_feature_set(feature_set)
    motion = _at_rate(motion, rate)
    found = all_features(motion, features)
    untrusted = untrusted_features(motion, features)
    found[:, [i for i in range(found.shape[1]) if untrusted >> i & 1]] = False
    return found


def all_features(motion: Motion, feature_set: AnyFeatureSet = "f39") -> BoolArray:
    """Compute the boolean features of a motion, those too that its joints can't tell.

    Parameters
    ----------
    motion : Motion
        At the rate wanted.
    feature_set : str, Path or FeatureSet
        A shipped name, the path of a TOML file, or a set.

    Returns
    -------
    ndarray of bool, shape (T, F)
        As `extract_features`, but of features that `untrusted_features` names anything.
    """
    tests = _tests(load_feature_set(feature_set))
    scales = body_lengths(motion)
    found = np.zeros((tests.count, len(motion.positions)), dtype=np.bool_)
    states = np.zeros((tests.on.shape[1], 1), dtype=np.bool_)
    for start, poses in _blocks(motion):
        values = measure_values(poses, tests.measures, scales)
        strong = (values > tests.on[0]) & (values < tests.on[1])
        failed = (values <= tests.off[0]) | (values >= tests.off[1])
        states = robust_threshold(strong, failed, states[:, -1])
        stretch = found[:, start : start + states.shape[1]]
        stretch[tests.plain[0]] = states[tests.plain[1]]
        each = {part: states[row] for part, row in tests.combined_parts}
        for i, condition in tests.combined:
            stretch[i] = combine(condition, each)
    return np.ascontiguousarray(found.T)


def feature_values(
    motion: Motion, feature_set: AnyFeatureSet = "f39", rate: float = 30.0
) -> FloatArray:
    """Compute the real values beneath the features, larger where a feature is more on.

    Parameters
    ----------
    motion, feature_set, rate
        As for `extract_features`.

    Returns
    -------
    ndarray of float64, shape (T, F)
        In the unit of each feature. The value itself, or its negative where the feature is on
        below its threshold; for a range, how far inside the stronger range. A combination has
        the least (``all_of``) or the largest (``any_of``) of the values of its parts, or the
        negative (``not``). NaN where a joint is missing.
    """
    conditions = [feature.condition for feature in load_feature_set(feature_set).features]
    parts = _all_leaves(conditions)
    values = condition_values(motion, parts, rate).T
    signed = {part: _signed(part, value) for part, value in zip(parts, values, strict=True)}
    both = {part: (value, value) for part, value in signed.items()}
    return _columns([combine_margins(condition, both)[0] for condition in conditions], values)


def feature_margins(
    motion: Motion, feature_set: AnyFeatureSet = "f39", rate: float = 30.0
) -> Margins:
    """Compute how far each feature is from its thresholds, frame by frame.

    Parameters
    ----------
    motion, feature_set, rate
        As for `extract_features`.

    Returns
    -------
    Margins
    """
    conditions = [feature.condition for feature in load_feature_set(feature_set).features]
    parts = _all_leaves(conditions)
    values = condition_values(motion, parts, rate).T
    margins = (np.minimum(values - low, high - values) for low, high in _intervals(parts))
    each = dict(zip(parts, zip(*margins, strict=True), strict=True))
    both = [combine_margins(condition, each) for condition in conditions]
    strong, weak = (_columns(side, values) for side in zip(*both, strict=True))
    return Margins(strong, weak)


def condition_values(
    motion: Motion, conditions: Sequence[Condition], rate: float = 30.0
) -> FloatArray:
    """Compute the values of generic features as their formulas give them.

    Parameters
    ----------
    motion : Motion
        Joints in any order.
    conditions : sequence of Condition
        Generic features, no combinations; see `mocapidx.features.relations.leaves`.
    rate : float
        The motion is resampled to this rate, in Hz.

    Returns
    -------
    ndarray of float64, shape (T, C)
        In the unit of each condition; NaN where a joint is missing.
    """
    motion = _at_rate(motion, rate)
    scales, measures = body_lengths(motion), measures_of(conditions)
    values = np.full((len(conditions), len(motion.positions)), np.nan)
    for start, poses in _blocks(motion):
        stretch = measure_values(poses, measures, scales)
        values[:, start : start + stretch.shape[1]] = stretch
    return values.T


def _at_rate(motion: Motion, rate: float) -> Motion:
    return motion if motion.rate == rate else resample_motion(motion, rate)


def _blocks(motion: Motion) -> Iterator[tuple[int, Poses]]:
    """Yield stretches of frames, each with the number of its first frame."""
    columns = {joint: i for i, joint in enumerate(motion.joints)}
    known = [joint for joint in CANONICAL_JOINTS if joint in columns]
    sources = [columns[joint] for joint in known]
    targets = np.array([INDEX[joint] for joint in known], dtype=np.int64)
    there = motion.positions if motion.joints == CANONICAL_JOINTS else motion.positions[:, sources]
    present = targets[~absent_joints(there)]
    frames = len(motion.positions)
    for start in range(0, frames, BLOCK):
        stop = min(start + BLOCK, frames)
        # One frame more on each side, for the velocities.
        first, last = max(start - 1, 0), min(stop + 1, frames)
        points = np.full((len(INDEX), 3, last - first), np.nan)
        points[targets] = there[first:last].transpose(1, 2, 0)
        velocities = difference_quotient(points, motion.rate)
        inner = slice(start - first, stop - first)
        yield start, Poses(INDEX, points[:, :, inner], velocities[:, :, inner], present)


@dataclass(frozen=True, slots=True)
class _Tests:
    """What is tested for the features of a set: their C generic features, and how they combine.

    Parameters
    ----------
    count : int
        Features.
    measures : Measures
        Of the generic features.
    on, off : ndarray of float64, shape (2, C, 1)
        As `_intervals` gives them.
    plain : (ndarray of int64, ndarray of int64)
        Features that are one generic feature, and which.
    combined : tuple of (int, Condition)
        The other features.
    combined_parts : tuple of (Condition, int)
        The generic features that those are made of.
    """

    count: int
    measures: Measures
    on: FloatArray
    off: FloatArray
    plain: tuple[IndexArray, IndexArray]
    combined: tuple[tuple[int, Condition], ...]
    combined_parts: tuple[tuple[Condition, int], ...]


@lru_cache(maxsize=16)
def _tests(feature_set: FeatureSet) -> _Tests:
    conditions = [feature.condition for feature in feature_set.features]
    parts = _all_leaves(conditions)
    rows = {part: row for row, part in enumerate(parts)}
    plain = [(i, rows[c]) for i, c in enumerate(conditions) if c in rows]
    combined = [(i, c) for i, c in enumerate(conditions) if c not in rows]
    needed = _all_leaves(condition for _, condition in combined)
    features, found = np.array(plain, dtype=np.int64).reshape(-1, 2).T
    return _Tests(
        len(conditions),
        measures_of(parts),
        *_intervals(parts),
        (features, found),
        tuple(combined),
        tuple((part, rows[part]) for part in needed),
    )


def _intervals(conditions: Sequence[Condition]) -> tuple[FloatArray, FloatArray]:
    """Return the ends of the strong and of the weak tests, each of shape (2, C, 1)."""
    strong = [open_interval(condition, condition.on) for condition in conditions]
    weak = [open_interval(condition, condition.off) for condition in conditions]
    ends = np.array([strong, weak]).reshape(2, -1, 2, 1).transpose(0, 2, 1, 3)
    return ends[0], ends[1]


def _all_leaves(conditions: Iterable[Condition]) -> list[Condition]:
    """Return the different generic features beneath some conditions."""
    return list(dict.fromkeys(leaf for condition in conditions for leaf in leaves(condition)))


def _signed(condition: Condition, values: FloatArray) -> FloatArray:
    """Return the values of a generic feature, turned so that larger is more on."""
    low, high = open_interval(condition, condition.on)
    if np.isinf(high):
        return values
    return -values if np.isinf(low) else np.minimum(values - low, high - values)


def _columns(rows: Sequence[FloatArray], like: FloatArray) -> FloatArray:
    """Return rows over frames as a matrix with one row a frame."""
    return np.array(rows, dtype=np.float64).reshape(len(rows), like.shape[1]).T
