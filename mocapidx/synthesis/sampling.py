"""Samples of the accessible region: blends of neighbouring examples, and what they are like."""

from collections.abc import Callable
from itertools import product
from typing import Final, TypeAlias

import numpy as np

from mocapidx.model import BoolArray, FloatArray, IndexArray

__all__ = [
    "NEIGHBOURS",
    "Evaluate",
    "interpolated_weights",
    "nearest",
    "redundant_examples",
    "sample_blends",
    "shares",
    "valid_weights",
]

NEIGHBOURS: Final = 12
"""Samples that a blend is interpolated from (paper: k)."""

EXPANSION: Final = 0.2
"""By how much the box around the examples' parameters is larger in each dimension."""

Evaluate: TypeAlias = Callable[[FloatArray], FloatArray]
"""From blend weights, shape (E,), to the parameters of the blend, shape (D,)."""


def valid_weights(count: int, extrapolation: float, rng: np.random.Generator) -> FloatArray:
    """Draw nearly convex weights.

    Parameters
    ----------
    count : int
        How many, at least 1.
    extrapolation : float
        How far each may lie below 0 and above 1 (paper: delta).
    rng : Generator

    Returns
    -------
    ndarray of float64, shape (count,)
        Between ``-extrapolation`` and ``1 + extrapolation``; their sum is 1.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 4.2, equation 1.
    """
    weights = np.zeros(count)
    order = rng.permutation(count)
    total = 0.0
    for place in order[:-1].tolist():
        low = max(-extrapolation, -extrapolation - total)
        high = min(1 + extrapolation, 1 + extrapolation - total)
        weights[place] = rng.uniform(low, high)
        total += weights[place]
    weights[order[-1]] = 1 - total
    return weights


def nearest(points: FloatArray, target: FloatArray, count: int) -> tuple[IndexArray, FloatArray]:
    """Find the nearest of some points.

    Parameters
    ----------
    points : ndarray of float, shape (S, D)
    target : ndarray of float, shape (D,)
    count : int
        How many are wanted; all of them where there are fewer.

    Returns
    -------
    indices : ndarray of int64, shape (K,)
        In the order of their distances; of equal ones the first.
    distances : ndarray of float64, shape (K,)
    """
    distances = np.linalg.norm(points - target, axis=1)
    indices = np.argsort(distances, kind="stable")[:count]
    return indices, distances[indices]


def interpolated_weights(
    points: FloatArray, weights: FloatArray, target: FloatArray, neighbours: int = NEIGHBOURS
) -> FloatArray:
    """Interpolate the blend weights of the nearest samples.

    Parameters
    ----------
    points : ndarray of float, shape (S, D)
        Parameters of the samples, in units that can be compared.
    weights : ndarray of float, shape (S, E)
        Their blend weights.
    target : ndarray of float, shape (D,)
        In the same units.
    neighbours : int
        How many samples count.

    Returns
    -------
    ndarray of float64, shape (E,)
        A convex combination of the weights of samples, so within the same bounds.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 4.3, equations 2 and 3.
    """
    indices, distances = nearest(points, target, neighbours)
    mixed: FloatArray = shares(distances) @ weights[indices]
    return mixed


def shares(distances: FloatArray) -> FloatArray:
    """Give the share of each of the nearest samples by their distances.

    Parameters
    ----------
    distances : ndarray of float, shape (K,)
        Increasing.

    Returns
    -------
    ndarray of float64, shape (K,)
        At least 0; their sum is 1. All falls to a sample that has no distance at all.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 4.3, equation 3.
    """
    parts: FloatArray
    if distances[0] < 1e-12:
        parts = np.zeros(len(distances))
        parts[0] = 1.0
        return parts
    parts = 1 / distances - 1 / distances[-1]
    if parts.sum() < 1e-12:  # all equally far, or one alone
        parts = np.ones(len(parts))
    parts = parts / parts.sum()
    return parts


def sample_blends(
    evaluate: Evaluate,
    examples: FloatArray,
    scales: FloatArray,
    *,
    draws: int,
    extrapolation: float,
    tolerance: float,
    seed: int = 0,
) -> tuple[FloatArray, FloatArray]:
    """Sample blends of neighbouring examples all over the accessible region.

    Whenever a set of neighbours comes up for the first time, its most extreme blends are tried
    as well, so that the samples go as far as blends can.

    Parameters
    ----------
    evaluate : callable
        From weights to parameters.
    examples : ndarray of float, shape (E, D)
        Parameters of the examples, at least ``D + 1`` of them.
    scales : ndarray of float, shape (D,)
        How much of each parameter counts as much as a unit of the others.
    draws : int
        How many blends are tried.
    extrapolation : float
        How far weights may lie below 0 and above 1.
    tolerance : float
        Samples nearer to another one are dropped, in scaled units.
    seed : int
        The same seed draws the same blends.

    Returns
    -------
    weights : ndarray of float64, shape (S, E)
        Of the examples, then of the samples kept.
    parameters : ndarray of float64, shape (S, D)

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 4.2.
    """
    rng = np.random.default_rng(seed)
    scaled = examples / scales
    low, high = scaled.min(axis=0), scaled.max(axis=0)
    middle, reach = (low + high) / 2, (high - low) / 2 * (1 + EXPANSION)
    kept, points = list(np.eye(len(scaled))), list(scaled)
    corners = _corners(scaled.shape[1] + 1, extrapolation)
    seen: set[tuple[int, ...]] = set()
    for _ in range(draws):
        place = rng.uniform(middle - reach, middle + reach)
        chosen = np.sort(nearest(scaled, place, scaled.shape[1] + 1)[0])
        trials = [valid_weights(len(chosen), extrapolation, rng)]
        if (key := tuple(chosen.tolist())) not in seen:
            seen.add(key)
            trials += corners
        for trial in trials:
            weights = np.zeros(len(scaled))
            weights[chosen] = trial
            point = evaluate(weights) / scales
            if np.isfinite(point).all() and (
                np.linalg.norm(np.array(points) - point, axis=1).min() >= tolerance
            ):
                kept.append(weights)
                points.append(point)
    return np.array(kept), np.array(points) * scales


def _corners(count: int, extrapolation: float) -> list[FloatArray]:
    """List the extreme points of the valid weights: all but one of them at a bound."""
    low, high = -extrapolation, 1 + extrapolation
    found: dict[tuple[float, ...], FloatArray] = {}
    for rest in range(count):
        for bounds in product((low, high), repeat=count - 1):
            last = 1 - sum(bounds)
            if low - 1e-12 <= last <= high + 1e-12:
                corner = np.insert(np.array(bounds), rest, last)
                found.setdefault(tuple(np.round(corner, 9).tolist()), corner)
    return list(found.values())


def redundant_examples(
    evaluate: Evaluate, examples: FloatArray, scales: FloatArray, tolerance: float
) -> BoolArray:
    """Tell which examples the others can stand in for.

    The examples are looked at in turn, those with the nearest neighbours first. One goes if
    the interpolation of those left near it gives its parameters; ``D + 1`` always stay.

    Parameters
    ----------
    evaluate : callable
        From weights, one for each example, to parameters.
    examples : ndarray of float, shape (E, D)
        Parameters of the examples.
    scales : ndarray of float, shape (D,)
    tolerance : float
        How far off the parameters may be, in scaled units.

    Returns
    -------
    ndarray of bool, shape (E,)

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 4.4.
    """
    scaled = examples / scales
    count, dimensions = scaled.shape
    gaps = np.linalg.norm(scaled[:, None] - scaled, axis=2) + np.diag(np.full(count, np.inf))
    gone = np.zeros(count, dtype=bool)
    for example in np.argsort(gaps.min(axis=1), kind="stable").tolist():
        left = ~gone
        left[example] = False
        if example == 0 or left.sum() < dimensions + 1:  # the first example is the query
            continue
        weights = interpolated_weights(scaled[left], np.eye(count)[left], scaled[example])
        off = np.linalg.norm(evaluate(weights) / scales - scaled[example])
        gone[example] = bool(off <= tolerance)
    return gone
