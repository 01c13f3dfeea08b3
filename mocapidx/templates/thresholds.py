"""A threshold for each class, from training data, and rivals between classes.

A template that costs little everywhere needs a lower threshold than one that costs much even
where it is right. Both are measured: on examples that the template has not seen, and on motion
of other classes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray
from mocapidx.templates.match import SHARED, lowest_costs, match_documents
from mocapidx.templates.quantise import quantise
from mocapidx.templates.template import MotionTemplate

__all__ = [
    "POOR_SEPARATION",
    "RIVAL_SLACK",
    "Clip",
    "Threshold",
    "background_cost",
    "beaten_by_rivals",
    "held_out_costs",
    "learn_threshold",
    "lowest_in_clips",
    "own_threshold",
]

BACKGROUND_SHARE = 0.7  # where between the costs of its own and of other motion tau lies
BACKGROUND_QUANTILE = 0.02  # unlabelled motion may hold the class itself
RIVAL_SLACK = 1.1
"""Where rivals decide too, a class's own threshold may be so much wider: what it lets in of other
classes, they explain better."""
POOR_SEPARATION = 0.75
"""Positive cost over background cost from which on a class should be called badly separated."""


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """Motion to measure a template on.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        Feature words, at least one.
    untrusted : int
        Mask of features that the motion can't tell; they count as undecided.
    """

    words: WordArray
    untrusted: int = 0


@dataclass(frozen=True, slots=True)
class Threshold:
    """What a template costs on its own class and elsewhere, and the threshold in between.

    Parameters
    ----------
    positive_cost : float or None
        Median over the examples, each against a template learned without its group; None
        where there is only one example.
    background_cost : float or None
        Lowest cost on motion of other classes; None where there is none.
    tau : float or None
        ``0.3 positive + 0.7 background``; None where one of the two is not known.
    """

    positive_cost: float | None = None
    background_cost: float | None = None
    tau: float | None = None

    @property
    def separation(self) -> float | None:
        """Positive over background cost: near 0 is well separated, near 1 not at all."""
        if self.positive_cost is None or self.background_cost is None:
            return None
        return self.positive_cost / self.background_cost if self.background_cost else np.inf


def learn_threshold(
    matrix: FloatArray,
    delta: float,
    examples: Sequence[Clip],
    groups: Sequence[str],
    others: Sequence[Clip],
    background: Sequence[Clip],
    learn: Callable[[Sequence[int]], FloatArray],
) -> Threshold:
    """Set the threshold of one class.

    Parameters
    ----------
    matrix : ndarray of float64, shape (K, F)
        The template learned from all examples.
    delta : float
        For quantising.
    examples : sequence of Clip
        Of this class.
    groups : sequence of str
        The group of each example, such as a person or a recording.
    others : sequence of Clip
        Labelled motion of other classes.
    background : sequence of Clip
        Unlabelled motion; a few occurrences of the class among it do no harm.
    learn : callable
        Learns a template, an ndarray of shape (K, F), from some of the examples, given by
        their numbers.

    Returns
    -------
    Threshold
    """
    costs = held_out_costs(delta, examples, groups, learn)
    positive = None if costs is None else float(np.median(costs))
    lowest = background_cost(matrix, delta, others, background)
    if positive is None or lowest is None:
        return Threshold(positive, lowest)
    tau = (1 - BACKGROUND_SHARE) * positive + BACKGROUND_SHARE * lowest
    return Threshold(positive, lowest, tau)


def held_out_costs(
    delta: float,
    examples: Sequence[Clip],
    groups: Sequence[str],
    learn: Callable[[Sequence[int]], FloatArray],
) -> FloatArray | None:
    """Match each example with a template learned from the examples of the other groups.

    Where all examples are of one group, with one learned from the other examples.

    Parameters
    ----------
    delta : float
        For quantising.
    examples : sequence of Clip
    groups : sequence of str
        The group of each example.
    learn : callable
        As for `learn_threshold`.

    Returns
    -------
    ndarray of float64, shape (N,), or None
        The lowest cost in each example; None where there is only one.
    """
    if len(examples) < 2:
        return None
    held_out = list(groups) if len(set(groups)) > 1 else list(map(str, range(len(examples))))
    costs = np.empty(len(examples))
    for group in dict.fromkeys(held_out):
        inside = [number for number, own in enumerate(held_out) if own == group]
        matrix = learn([number for number, own in enumerate(held_out) if own != group])
        costs[inside] = lowest_in_clips(matrix, delta, [examples[number] for number in inside])
    return costs


def background_cost(
    matrix: FloatArray, delta: float, others: Sequence[Clip], background: Sequence[Clip] = ()
) -> float | None:
    """Measure how low a template's cost gets where its class does not occur.

    Parameters
    ----------
    matrix : ndarray of float64, shape (K, F)
        A template.
    delta : float
        For quantising.
    others : sequence of Clip
        Motion of other classes: the lowest cost counts.
    background : sequence of Clip
        Unlabelled motion: the 2 % quantile over the lowest costs of its clips counts, if lower.

    Returns
    -------
    float or None
        None where there is neither. Clips that tell too little of the template have no say.
    """
    others = _telling(matrix, delta, others)
    background = _telling(matrix, delta, background)
    levels = []
    if len(others):
        levels.append(float(lowest_in_clips(matrix, delta, others).min()))
    if len(background):
        lowest = lowest_in_clips(matrix, delta, background)
        levels.append(float(np.quantile(lowest, BACKGROUND_QUANTILE)))
    return min(levels, default=None)


def _telling(matrix: FloatArray, delta: float, clips: Sequence[Clip]) -> Sequence[Clip]:
    """Leave out clips in which the class would not be looked for; their costs say nothing."""
    quantised = quantise(matrix, delta)
    masks = {clip.untrusted for clip in clips}
    told = {mask: quantised.is_told_without(mask) for mask in masks}
    return [clip for clip in clips if told[clip.untrusted]]


def lowest_in_clips(matrix: FloatArray, delta: float, clips: Sequence[Clip]) -> FloatArray:
    """Lowest cost of a template in each of some clips, with weighted steps and padded ends.

    Parameters
    ----------
    matrix : ndarray of float64, shape (K, F)
        A template.
    delta : float
        For quantising.
    clips : sequence of Clip

    Returns
    -------
    ndarray of float64, shape (N,)
    """
    quantised = quantise(matrix, delta)
    costs = np.empty(len(clips))
    for mask in {clip.untrusted for clip in clips}:
        numbers = [number for number, clip in enumerate(clips) if clip.untrusted == mask]
        words = [clips[number].words for number in numbers]
        bounds = np.concatenate(([0], np.cumsum([len(each) for each in words])))
        matching = match_documents(quantised.without(mask), np.concatenate(words), bounds)
        costs[numbers] = lowest_costs(matching)
    return costs


def own_threshold(template: MotionTemplate, rivals: bool) -> float:
    """Give the cost below which a match of a template is a hit.

    Parameters
    ----------
    template : MotionTemplate
    rivals : bool
        Whether other classes may take the hit away.

    Returns
    -------
    float
        `RIVAL_SLACK` times a learned threshold where there are rivals; else the learned one, or
        the default.
    """
    slack = RIVAL_SLACK if rivals and template.tau is not None else 1.0
    return template.threshold * slack


def beaten_by_rivals(
    starts: IndexArray, ends: IndexArray, ratios: FloatArray, classes: IndexArray
) -> BoolArray:
    """Tell which hits in a document another class explains better.

    Parameters
    ----------
    starts, ends : ndarray of int64, shape (H,)
        Of the hits of all classes, in frames, end exclusive.
    ratios : ndarray of float, shape (H,)
        Cost of each hit, divided by the threshold of its class.
    classes : ndarray of int64, shape (H,)
        The class of each hit, as a number.

    Returns
    -------
    ndarray of bool, shape (H,)
        True where a hit of another class shares more than half of the shorter of the two
        stretches and has a lower ratio.
    """
    beaten = np.zeros(len(starts), dtype=np.bool_)
    order = np.argsort(starts, kind="stable")
    begins, stops, levels, kinds = starts[order], ends[order], ratios[order], classes[order]
    longest = int((stops - begins).max(initial=0))
    lows = np.searchsorted(begins, begins - longest, side="left")
    highs = np.searchsorted(begins, stops, side="left")
    for hit, (low, high) in enumerate(zip(lows.tolist(), highs.tolist(), strict=True)):
        near = slice(low, high)
        common = np.minimum(stops[near], stops[hit]) - np.maximum(begins[near], begins[hit])
        shorter = np.minimum(stops[near] - begins[near], stops[hit] - begins[hit])
        better = (levels[near] < levels[hit]) & (kinds[near] != kinds[hit])
        beaten[order[hit]] = (better & (common > SHARED * shorter)).any()
    return beaten
