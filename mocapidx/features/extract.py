"""From joint positions to boolean features, and to the real values beneath them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.features.featureset import FeatureSet, load_feature_set
from mocapidx.features.geometry import Poses, difference_quotient
from mocapidx.features.kinds import CANONICAL_JOINTS, KINDS, Place
from mocapidx.features.relations import (
    Condition,
    combine,
    combine_margins,
    joint_names,
    leaves,
    open_interval,
    robust_threshold,
)
from mocapidx.model import BoolArray, FloatArray, Motion

__all__ = [
    "Margins",
    "body_lengths",
    "condition_values",
    "extract_features",
    "feature_margins",
    "feature_values",
    "untrusted_features",
]

# Frames worked on at a time: enough to make each array operation worth its call, few enough
# to stay in the cache.
BLOCK: Final = 2_048

# Joints nearer than this throughout a take, in metres, are one point: far above the noise of
# single precision 100 m from the origin, far below the size of any bone.
COINCIDENT: Final = 1e-4

LENGTHS: Final = {
    "hl": (("lshoulder", "lelbow"), ("rshoulder", "relbow")),
    "sw": (("lshoulder", "rshoulder"),),
    "hw": (("lhip", "rhip"),),
}

AnyFeatureSet = str | Path | FeatureSet


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
    conditions = [feature.condition for feature in features.features]
    parts = _all_leaves(conditions)
    on, off = _intervals(parts)
    scales = body_lengths(motion)
    found = np.zeros((len(conditions), len(motion.positions)), dtype=np.bool_)
    states = np.zeros((len(parts), 1), dtype=np.bool_)
    for start, poses in _blocks(motion):
        values = _values(poses, parts, scales)
        strong = (values > on[0]) & (values < on[1])
        failed = (values <= off[0]) | (values >= off[1])
        states = robust_threshold(strong, failed, states[:, -1])
        each = dict(zip(parts, states, strict=True))
        for i, condition in enumerate(conditions):
            found[i, start : start + states.shape[1]] = combine(condition, each)
    untrusted = untrusted_features(motion, features)
    found[[i for i in range(len(conditions)) if untrusted >> i & 1]] = False
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
    scales = body_lengths(motion)
    values = np.full((len(conditions), len(motion.positions)), np.nan)
    for start, poses in _blocks(motion):
        stretch = _values(poses, conditions, scales)
        values[:, start : start + stretch.shape[1]] = stretch
    return values.T


def body_lengths(motion: Motion) -> dict[str, float]:
    """Measure the lengths that thresholds are given in.

    Parameters
    ----------
    motion : Motion
        Measured on the zero pose where there is one, else as the median over the frames.

    Returns
    -------
    dict of str to float
        Metres in one ``hl`` (humerus length, mean of both sides), ``sw`` (shoulder width),
        ``hw`` (hip width) and ``m``; NaN where the joints are missing or one point.
    """
    rows = {joint: i for i, joint in enumerate(motion.joints)}
    lengths = {"m": 1.0}
    for unit, bones in LENGTHS.items():
        found = [
            _bone_length(motion, rows[start], rows[end])
            for start, end in bones
            if start in rows and end in rows
        ]
        known = [length for length in found if length > COINCIDENT]
        lengths[unit] = sum(known) / len(known) if known else np.nan
    return lengths


def untrusted_features(motion: Motion, feature_set: AnyFeatureSet = "f39") -> int:
    """Return the features that the joints of a motion can't tell.

    Parameters
    ----------
    motion : Motion
        At any rate.
    feature_set : str, Path or FeatureSet
        A shipped name, the path of a TOML file, or a set.

    Returns
    -------
    int
        Bit i is set where feature i names a joint, or is measured in a length between joints,
        that is missing or made up, or needs two joints apart that are one point throughout.
    """
    rows = {joint: i for i, joint in enumerate(motion.joints)}
    absent = _absent(motion.positions)
    bad = {*motion.made, *(joint for joint, row in rows.items() if absent[row])}
    real = {joint for joint in CANONICAL_JOINTS if joint in rows and joint not in bad}
    one_point: dict[tuple[str, str], bool] = {}

    def coincide(first: str, second: str) -> bool:
        pair = (first, second) if first < second else (second, first)
        if pair not in one_point:
            one_point[pair] = _coincide(motion, rows[first], rows[second])
        return one_point[pair]

    def is_trusted(condition: Condition) -> bool:
        if not real.issuperset(joint_names(condition.joints)):
            return False
        unit = condition.unit.removesuffix("/s")
        if unit in LENGTHS and not any(
            real.issuperset(bone) and not coincide(*bone) for bone in LENGTHS[unit]
        ):
            return False
        return not any(coincide(*pair) for pair in _pairs_apart(condition))

    trusted: dict[Condition, bool] = {}
    mask = 0
    for i, feature in enumerate(load_feature_set(feature_set).features):
        for leaf in leaves(feature.condition):
            if leaf not in trusted:
                trusted[leaf] = is_trusted(leaf)
            if not trusted[leaf]:
                mask |= 1 << i
    return mask


def _at_rate(motion: Motion, rate: float) -> Motion:
    if motion.rate == rate:
        return motion
    from mocapidx.skeleton.resample import resample_motion

    return resample_motion(motion, rate)


def _blocks(motion: Motion) -> Iterator[tuple[int, Poses]]:
    """Yield stretches of frames, each with the number of its first frame."""
    rows = {joint: i for i, joint in enumerate(CANONICAL_JOINTS)}
    columns = {joint: i for i, joint in enumerate(motion.joints)}
    known = [joint for joint in CANONICAL_JOINTS if joint in columns]
    sources = [columns[joint] for joint in known]
    targets = [rows[joint] for joint in known]
    absent = _absent(motion.positions[:, sources])
    present = np.array(targets, dtype=np.int64)[~absent]
    frames = len(motion.positions)
    for start in range(0, frames, BLOCK):
        stop = min(start + BLOCK, frames)
        # One frame more on each side, for the velocities.
        first, last = max(start - 1, 0), min(stop + 1, frames)
        points = np.full((len(rows), 3, last - first), np.nan)
        points[targets] = motion.positions[first:last, sources].transpose(1, 2, 0)
        velocities = difference_quotient(points, motion.rate)
        inner = slice(start - first, stop - first)
        yield start, Poses(rows, points[:, :, inner], velocities[:, :, inner], present)


def _absent(positions: FloatArray) -> BoolArray:
    """Return the joints that have no position in any frame, shape (J,)."""
    absent: BoolArray = np.isnan(positions).any(axis=2).all(axis=0)
    return absent


def _values(
    poses: Poses, conditions: Sequence[Condition], scales: Mapping[str, float]
) -> FloatArray:
    """Return the values of generic features in their units, shape (C, T)."""
    known: dict[tuple[str, tuple[Place, ...]], FloatArray] = {}
    values = np.empty((len(conditions), poses.points.shape[2]))
    # Infinite positions and widths of 0 give unknown values, not warnings.
    with np.errstate(all="ignore"):
        for row, condition in zip(values, conditions, strict=True):
            measure = (condition.kind, condition.joints)
            if measure not in known:
                known[measure] = KINDS[condition.kind].value(poses, *condition.joints)
            row[:] = known[measure]
            if condition.unit != "deg":
                row /= scales[condition.unit.removesuffix("/s")]
    return values


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


def _bone_length(motion: Motion, start: int, end: int) -> float:
    """Return the distance of two joints in metres; NaN where it is unknown."""
    if motion.rest is not None:
        length = float(np.linalg.norm(motion.rest[end] - motion.rest[start]))
        if length > COINCIDENT:
            return length
    bone = motion.positions[:, end].astype(np.float64) - motion.positions[:, start]
    lengths = np.sqrt((bone * bone).sum(axis=1))
    known = lengths[np.isfinite(lengths)]
    return float(np.median(known)) if len(known) else np.nan


def _coincide(motion: Motion, first: int, second: int) -> bool:
    """Return whether two joints are one point in all frames that have both."""
    gap = motion.positions[:, second].astype(np.float64) - motion.positions[:, first]
    return not bool((np.abs(gap) > COINCIDENT).any())


def _pairs_apart(condition: Condition) -> Iterable[tuple[str, str]]:
    for first, second in KINDS[condition.kind].apart:
        for one in joint_names(condition.joints[first : first + 1]):
            for other in joint_names(condition.joints[second : second + 1]):
                yield one, other
