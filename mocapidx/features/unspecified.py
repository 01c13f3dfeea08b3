"""Feature words, and where in a motion some of their features can't be told.

Joints that a rig lacks make features untrusted throughout. Joints that are missing for a while
make them unspecified for that while: a stretch of frames and a mask.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from mocapidx.features.extract import all_features, untrusted_features
from mocapidx.features.featureset import AnyFeatureSet, load_feature_set
from mocapidx.features.gaps import Unspecified
from mocapidx.features.kinds import KINDS
from mocapidx.features.relations import Condition, joint_names, leaves
from mocapidx.features.trust import absent_joints
from mocapidx.features.words import pack_words
from mocapidx.model import BoolArray, Motion, WordArray

__all__ = ["FeatureWords", "feature_words"]

MOST_STRETCHES: Final = 1000
NEAR: Final = 1.0  # seconds between stretches that are united where there are too many


@dataclass(frozen=True, slots=True, eq=False)
class FeatureWords:
    """The feature words of a motion and what of them counts.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        Bit i is feature i; what is untrusted or unspecified is 0.
    untrusted : int
        Mask of the features that can't be told anywhere.
    unspecified : tuple of (int, int, int)
        Stretches in which further features can't be told.
    """

    words: WordArray
    untrusted: int
    unspecified: Unspecified


def feature_words(motion: Motion, feature_set: AnyFeatureSet = "f39") -> FeatureWords:
    """Compute the feature words of a motion.

    Parameters
    ----------
    motion : Motion
        At the rate wanted; positions are NaN where a joint is not known.
    feature_set : str, Path or FeatureSet
        A shipped name, the path of a TOML file, or a set.

    Returns
    -------
    FeatureWords
    """
    features = load_feature_set(feature_set)
    untrusted = untrusted_features(motion, features)
    words = pack_words(all_features(motion, features))
    unknown = _unknown_joints(motion)
    if unknown is None:
        return FeatureWords(words & ~np.uint64(untrusted), untrusted, ())
    open_bits = _open_features(motion, features, unknown)
    open_words = pack_words(open_bits) & ~np.uint64(untrusted)
    everywhere = int(np.bitwise_and.reduce(open_words))
    unspecified = open_words & ~np.uint64(everywhere)
    stretches, further = _stretches(unspecified, motion.rate)
    untrusted |= everywhere | further
    for start, end, mask in stretches:
        words[start:end] &= ~np.uint64(mask)
    return FeatureWords(words & ~np.uint64(untrusted), untrusted, stretches)


def _unknown_joints(motion: Motion) -> dict[str, BoolArray] | None:
    """Return for each joint that is missing for a while in which frames; None: there is none."""
    if np.isfinite(motion.positions.sum()):  # the usual case, and the quickest way to tell
        return None
    unknown = np.asarray(np.isnan(motion.positions).any(axis=2), dtype=np.bool_)
    unknown[:, absent_joints(motion.positions)] = False
    if not unknown.any():
        return None
    columns = np.flatnonzero(unknown.any(axis=0)).tolist()
    return {motion.joints[column]: unknown[:, column] for column in columns}


def _open_features(
    motion: Motion, feature_set: AnyFeatureSet, unknown: dict[str, BoolArray]
) -> BoolArray:
    """Return which features can't be told in which frames, shape (T, F)."""
    nowhere = np.zeros(len(motion.positions), dtype=np.bool_)
    moving = {joint: _with_neighbours(frames) for joint, frames in unknown.items()}
    known: dict[Condition, BoolArray] = {}

    def frames_of(leaf: Condition) -> BoolArray:
        if leaf not in known:
            kind = KINDS[leaf.kind]
            own = moving if kind.quantity == "speed" else unknown
            names = own if kind.of_all else joint_names(leaf.joints)
            known[leaf] = np.logical_or.reduce([nowhere, *(own[n] for n in names if n in own)])
        return known[leaf]

    return np.column_stack(
        [
            np.logical_or.reduce([frames_of(leaf) for leaf in leaves(feature.condition)])
            for feature in load_feature_set(feature_set).features
        ]
    )


def _with_neighbours(frames: BoolArray) -> BoolArray:
    """Velocities take the frames before and after."""
    wider = frames.copy()
    wider[1:] |= frames[:-1]
    wider[:-1] |= frames[1:]
    return wider


def _stretches(words: WordArray, rate: float) -> tuple[Unspecified, int]:
    """Return where words are not 0, and features that come and go too often to be followed."""
    bounds = np.concatenate(([0], np.flatnonzero(np.diff(words)) + 1, [len(words)])).tolist()
    runs = [(start, end, int(words[start])) for start, end in pairwise(bounds) if words[start]]
    if len(runs) > MOST_STRETCHES:
        runs = _united(runs, round(NEAR * rate))
    if len(runs) > MOST_STRETCHES:
        return (), int(np.bitwise_or.reduce(words))
    return tuple(runs), 0


def _united(runs: list[tuple[int, int, int]], near: int) -> list[tuple[int, int, int]]:
    united = runs[:1]
    for start, end, mask in runs[1:]:
        first, last, before = united[-1]
        if start - last <= near:
            united[-1] = (first, end, before | mask)
        else:
            united.append((start, end, mask))
    return united
