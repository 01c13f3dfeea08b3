"""What a motion's joints can be trusted to tell: lengths of the body and sound features."""

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from mocapidx.features.featureset import AnyFeatureSet, FeatureSet, load_feature_set
from mocapidx.features.kinds import KINDS
from mocapidx.features.relations import Condition, joint_names, leaves
from mocapidx.model import BoolArray, FloatArray, Motion
from mocapidx.skeleton.joints import CANONICAL_JOINTS

__all__ = ["absent_joints", "body_lengths", "untrusted_features"]

# Joints nearer than this throughout a take, in metres, are one point: far above the noise of
# single precision 100 m from the origin, far below the size of any bone.
COINCIDENT: Final = 1e-4

LENGTHS: Final = {
    "hl": (("lshoulder", "lelbow"), ("rshoulder", "relbow")),
    "sw": (("lshoulder", "rshoulder"),),
    "hw": (("lhip", "rhip"),),
}

LEGS: Final = (
    (("lhip", "lknee"), ("lknee", "lankle")),
    (("rhip", "rknee"), ("rknee", "rankle")),
)
HUMERUS_OF_LEG: Final = 0.33
"""The humerus as a part of thigh and shank together: .30 to .37 on the bodies of four databases.

It stands in where only the legs were captured, as in gait analysis."""


def body_lengths(motion: Motion) -> dict[str, float]:
    """Measure the lengths that thresholds are given in.

    Parameters
    ----------
    motion : Motion
        Measured on the zero pose where there is one, else as the median over the frames.

    Returns
    -------
    dict of str to float
        Metres in one ``hl`` (humerus length, mean of both sides; a part of the legs' where the
        arms are missing), ``sw`` (shoulder width), ``hw`` (hip width) and ``m``; NaN where the
        joints are missing or one point.
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
    if np.isnan(lengths["hl"]):
        lengths["hl"] = HUMERUS_OF_LEG * _leg_length(motion, rows)
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
    absent = absent_joints(motion.positions)
    bad = set(motion.made) | {joint for joint, row in rows.items() if absent[row]}
    real = {joint for joint in CANONICAL_JOINTS if joint in rows and joint not in bad}
    one_point: dict[tuple[str, str], bool] = {}

    def coincide(first: str, second: str) -> bool:
        pair = (first, second) if first < second else (second, first)
        if pair not in one_point:
            one_point[pair] = _coincide(motion, rows[first], rows[second])
        return one_point[pair]

    def is_measured(bones: tuple[tuple[str, str], ...]) -> bool:
        return all(real.issuperset(bone) and not coincide(*bone) for bone in bones)

    def is_met(demand: _Demand) -> bool:
        return (
            real.issuperset(demand.joints)
            and not any(coincide(*pair) for pair in demand.apart)
            and (not demand.bones or any(map(is_measured, demand.bones)))
        )

    mask = 0
    for demand, features in _demands(load_feature_set(feature_set)):
        if not is_met(demand):
            mask |= features
    return mask


class _Demand(NamedTuple):
    """What a generic feature needs of a motion.

    Parameters
    ----------
    joints : frozenset of str
        That must be real.
    bones : tuple of tuples of pairs of str
        In one of which all pairs must have a length.
    apart : tuple of pairs of str
        That must not be one point.
    """

    joints: frozenset[str]
    bones: tuple[tuple[tuple[str, str], ...], ...]
    apart: tuple[tuple[str, str], ...]


@lru_cache(maxsize=16)
def _demands(feature_set: FeatureSet) -> tuple[tuple[_Demand, int], ...]:
    """Return all that a set demands, and the features that do."""
    demands: dict[_Demand, int] = {}
    for i, feature in enumerate(feature_set.features):
        for leaf in leaves(feature.condition):
            demand = _Demand(
                frozenset((*joint_names(leaf.joints), *KINDS[leaf.kind].needs)),
                _measures(leaf.unit.removesuffix("/s")),
                tuple(_pairs_apart(leaf)),
            )
            demands[demand] = demands.get(demand, 0) | 1 << i
    return tuple(demands.items())


def _measures(unit: str) -> tuple[tuple[tuple[str, str], ...], ...]:
    """Return the bones, any of which tell a length."""
    single = tuple((bone,) for bone in LENGTHS.get(unit, ()))
    return (*single, *LEGS) if unit == "hl" else single


def absent_joints(positions: FloatArray) -> BoolArray:
    """Return which joints have no position in any frame.

    Parameters
    ----------
    positions : ndarray of float, shape (T, J, 3)
        NaN where a position is unknown.

    Returns
    -------
    ndarray of bool, shape (J,)
    """
    return np.asarray(np.isnan(positions).any(axis=2).all(axis=0), dtype=np.bool_)


def _leg_length(motion: Motion, rows: Mapping[str, int]) -> float:
    """Return the mean length of the legs from hip to ankle in metres; NaN where it is unknown."""
    known = []
    for bones in LEGS:
        if all(joint in rows for bone in bones for joint in bone):
            parts = [_bone_length(motion, rows[start], rows[end]) for start, end in bones]
            if min(parts) > COINCIDENT:
                known.append(sum(parts))
    return sum(known) / len(known) if known else np.nan


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
    start, end = (motion.positions[:1, joint].ravel().tolist() for joint in (first, second))
    if any(abs(b - a) > COINCIDENT for a, b in zip(start, end, strict=True)):
        return False  # nearly always the first frame tells
    gap = motion.positions[:, second].astype(np.float64) - motion.positions[:, first]
    return not bool((np.abs(gap) > COINCIDENT).any())


def _pairs_apart(condition: Condition) -> Iterable[tuple[str, str]]:
    for first, second in KINDS[condition.kind].apart:
        for one in joint_names(condition.joints[first : first + 1]):
            for other in joint_names(condition.joints[second : second + 1]):
                yield one, other
