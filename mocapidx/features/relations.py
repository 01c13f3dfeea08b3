"""Relational features: a value from joints, then a robust threshold.

A *condition* is a generic feature with its joints and thresholds, or a boolean combination of
conditions. Conditions are data; this module knows what each kind means.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from mocapidx.features.kinds import KINDS, Place
from mocapidx.model import BoolArray, FloatArray
from mocapidx.skeleton.joints import CANONICAL_JOINTS, MIRROR

__all__ = [
    "COMBINATIONS",
    "Condition",
    "Feature",
    "Threshold",
    "combine",
    "combine_margins",
    "joint_names",
    "leaves",
    "mirrored",
    "normal_form",
    "open_interval",
    "robust_threshold",
]

Threshold: TypeAlias = float | tuple[float, float]

COMBINATIONS: Final = ("all_of", "any_of", "not")

_OTHER_SIDE: Final[dict[str, str]] = {
    joint: CANONICAL_JOINTS[other] for joint, other in zip(CANONICAL_JOINTS, MIRROR, strict=True)
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A generic feature with its joints and thresholds, or a combination of conditions.

    Parameters
    ----------
    kind : str
        A name of `KINDS` or of `COMBINATIONS`.
    joints : tuple
        Canonical joints in the order of the formula; for ``touch`` a pair is a segment.
    unit : str
        Unit of the value and of the thresholds; empty for a combination.
    when : {"above", "below", "within"}
        On which side of the threshold the condition holds; empty for a combination.
    on, off : float or (float, float)
        The stronger and the weaker threshold; for ``within`` two closed ranges.
    of : tuple of Condition
        What a combination combines, each with a hysteresis of its own.
    """

    kind: str
    joints: tuple[Place, ...] = ()
    unit: str = ""
    when: str = ""
    on: Threshold = 0.0
    off: Threshold = 0.0
    of: tuple["Condition", ...] = ()


@dataclass(frozen=True, slots=True)
class Feature:
    """One boolean feature of a set: a condition with a name.

    Parameters
    ----------
    id : str
        Short and unique in its set, such as ``F1``.
    name : str
        What it says in words, such as ``right hand moving forwards``.
    part : {"upper", "lower", "mix"}
        The sub-index that it feeds.
    mirror : str
        The id of the feature for the other side of the body, or its own.
    condition : Condition
        Where it is on.
    """

    id: str
    name: str
    part: str
    mirror: str
    condition: Condition


def leaves(condition: Condition) -> Iterator[Condition]:
    """Yield the generic features that a condition is made of, from left to right."""
    if condition.kind in COMBINATIONS:
        for part in condition.of:
            yield from leaves(part)
    else:
        yield condition


def joint_names(places: Sequence[Place]) -> Iterator[str]:
    """Yield the joints that some places name; a segment names two."""
    for place in places:
        yield from (place,) if isinstance(place, str) else place


def mirrored(condition: Condition) -> Condition:
    """Return the condition that holds on a pose exactly where `condition` does on its mirror image.

    Parameters
    ----------
    condition : Condition
        The right version.

    Returns
    -------
    Condition
        The left version; its values on a pose are, bit by bit, those of `condition` on the pose
        with left and right joints exchanged and x negated.
    """
    exchanged = tuple(_mirrored_place(place) for place in condition.joints)
    kind = KINDS.get(condition.kind)
    if kind is not None and kind.mirror:
        exchanged = tuple(exchanged[i] for i in kind.mirror)
    return replace(condition, joints=exchanged, of=tuple(mirrored(part) for part in condition.of))


def _mirrored_place(place: Place) -> Place:
    if isinstance(place, str):
        return _OTHER_SIDE[place]
    return _OTHER_SIDE[place[0]], _OTHER_SIDE[place[1]]


def normal_form(condition: Condition) -> Condition:
    """Return the condition in a form that is equal for conditions with equal meaning.

    Of all orders of the joints that give the same value, the first in alphabetical order is
    taken; what a combination combines is sorted.
    """
    if condition.kind in COMBINATIONS:
        return replace(condition, of=tuple(sorted(map(normal_form, condition.of), key=repr)))
    places = [_sorted_place(place) for place in condition.joints]
    orders = (tuple(range(len(places))), *KINDS[condition.kind].same)
    joints = min((tuple(places[i] for i in order) for order in orders), key=repr)
    return replace(condition, joints=joints)


def _sorted_place(place: Place) -> Place:
    if isinstance(place, str):
        return place
    start, end = sorted(place)
    return start, end


def open_interval(condition: Condition, threshold: Threshold) -> tuple[float, float]:
    """Return a threshold of a condition as an open interval: inside it, the test holds.

    Ranges are closed in the papers, so their ends move out by the least step there is; the
    ends of the scale, 0 and 180 degrees, are no ends.
    """
    if not isinstance(threshold, tuple):
        return (threshold, np.inf) if condition.when == "above" else (-np.inf, threshold)
    low, high = threshold
    is_angle = KINDS[condition.kind].quantity == "angle"
    return (
        -np.inf if is_angle and low <= 0 else float(np.nextafter(low, -np.inf)),
        np.inf if is_angle and high >= 180 else float(np.nextafter(high, np.inf)),
    )


def robust_threshold(strong: BoolArray, failed: BoolArray, before: BoolArray) -> BoolArray:
    """Decide a condition frame by frame with hysteresis.

    Parameters
    ----------
    strong : ndarray of bool, shape (C, T)
        Where the strong test holds: the frame is on.
    failed : ndarray of bool, shape (C, T)
        Where the weak test fails: the frame is off. A frame that is neither, or whose value
        is unknown, is as the frame before.
    before : ndarray of bool, shape (C,)
        The state before the first frame; off at the start of a document.

    Returns
    -------
    ndarray of bool, shape (C, T)

    References
    ----------
    .. [1] Mueller, Roeder, "A relational approach to content-based analysis of motion capture
       data", section 4.3, robust threshold.
    """
    # The last frame that decides is the largest so far; its decision rides in the lowest bit.
    frames = np.arange(2, 2 * strong.shape[1] + 2, 2)
    decisions = np.where(strong | failed, frames | strong, before[:, None])
    return (np.maximum.accumulate(decisions, axis=1) & 1).astype(np.bool_)


def combine(condition: Condition, states: Mapping[Condition, BoolArray]) -> BoolArray:
    """Return where a condition holds, given where each of its generic features holds."""
    if condition.kind not in COMBINATIONS:
        return states[condition]
    parts = [combine(part, states) for part in condition.of]
    if condition.kind == "not":
        return ~parts[0]
    joined_by = np.logical_and if condition.kind == "all_of" else np.logical_or
    combined: BoolArray = joined_by.reduce(parts)
    return combined


def combine_margins(
    condition: Condition, margins: Mapping[Condition, tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """Return how far a condition is from its two thresholds, given its generic features.

    Parameters
    ----------
    condition : Condition
        A generic feature or a combination.
    margins : mapping of Condition to (ndarray, ndarray)
        For each generic feature how far it is above its strong and its weak threshold.

    Returns
    -------
    strong, weak : ndarray of float64
        All of some conditions are as far on as the least of them, any of them as the
        farthest; a denied condition turns on where the condition turns off.
    """
    if condition.kind not in COMBINATIONS:
        return margins[condition]
    strong, weak = zip(*(combine_margins(part, margins) for part in condition.of), strict=True)
    if condition.kind == "not":
        return -weak[0], -strong[0]
    joined = np.minimum if condition.kind == "all_of" else np.maximum
    return joined.reduce(strong), joined.reduce(weak)
