"""Blend weights that hit a target: interpolation of samples, then a few steps of refinement.

Interpolation alone is off by as much as the samples are apart, and more near the border. What
is refined always is a mixture of valid blends of a few neighbours, as the samples are: bounds
on single weights would let a dozen examples be extrapolated at once.
"""

from dataclasses import dataclass
from itertools import zip_longest
from typing import Final

import numpy as np

from mocapidx.model import FloatArray, IndexArray
from mocapidx.synthesis.sampling import NEIGHBOURS, Evaluate, nearest, shares

__all__ = ["Aim", "aim", "bounded"]

ROUNDS: Final = 40
TRIES: Final = 32
"""Blends of neighbouring examples from which a way is sought where interpolation leads to none."""

STARTS: Final = 3
"""At most so many of them are of the same examples."""

PROBE: Final = 1e-3
"""By how much a share is changed to see what it does."""


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """Blend weights for a target, and what they reach.

    Parameters
    ----------
    weights : ndarray of float64, shape (E,)
    reached : ndarray of float64, shape (D,)
        Parameters of the blend.
    miss : float
        How far they are from the target, in scaled units.
    """

    weights: FloatArray
    reached: FloatArray
    miss: float


def bounded(values: FloatArray, low: float, high: float) -> FloatArray:
    """Find the nearest values within bounds whose sum is 1.

    Parameters
    ----------
    values : ndarray of float, shape (N,)
    low, high : float
        Such that ``N * low <= 1 <= N * high``.

    Returns
    -------
    ndarray of float64, shape (N,)
    """
    below, above = float(values.min()) - high, float(values.max()) - low
    for _ in range(60):  # the shift that makes the sum 1, by bisection
        shift = (below + above) / 2
        if np.clip(values - shift, low, high).sum() > 1:
            below = shift
        else:
            above = shift
    result: FloatArray = np.clip(values - above, low, high)
    inner = (result > low) & (result < high)
    if inner.any():  # what the bisection has left over
        result[inner] += (1 - result.sum()) / inner.sum()
    return np.clip(result, low, high)


def aim(
    evaluate: Evaluate,
    points: FloatArray,
    weights: FloatArray,
    target: FloatArray,
    scales: FloatArray,
    *,
    extrapolation: float,
    enough: float,
) -> Aim:
    """Find valid blend weights whose parameters come nearest to a target.

    Parameters
    ----------
    evaluate : callable
        From weights to parameters.
    points : ndarray of float, shape (S, D)
        Parameters of the samples; the first E of them are the examples'.
    weights : ndarray of float, shape (S, E)
        Their weights.
    target : ndarray of float, shape (D,)
    scales : ndarray of float, shape (D,)
        How much of each parameter counts as much as a unit of the others.
    extrapolation : float
        How far weights may lie below 0 and above 1.
    enough : float
        A miss that needs no improvement, in scaled units.

    Returns
    -------
    Aim
        For a target out of reach, on the border of what can be reached.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 4.3. The refinement, bounded steps of
       Levenberg and Marquardt, is an addition.
    """
    scaled, goal = points / scales, target / scales

    def rest(blend_weights: FloatArray) -> FloatArray:
        return evaluate(blend_weights) / scales - goal

    near, distances = nearest(scaled, goal, NEIGHBOURS)
    best, miss = _refined(rest, weights[near], shares(distances), (0.0, 1.0), enough)
    if miss > enough:
        # A mixture of samples that lie far from each other may come nearer to a target out of
        # reach, but only a blend of neighbours is on the border of what can be reached.
        best, miss = weights[near[0]], float(distances[0])
        bounds = (-extrapolation, 1 + extrapolation)
        unit = np.eye(weights.shape[1])
        for chosen, start in _starts(scaled, weights, nearest(scaled, goal, 10 * NEIGHBOURS)[0]):
            found = _refined(rest, unit[chosen], start, bounds, enough)
            best, miss = min((best, miss), found, key=lambda pair: pair[1])
            if miss <= enough:
                break
    return Aim(best, evaluate(best), miss)


def _starts(
    scaled: FloatArray, weights: FloatArray, near: IndexArray
) -> list[tuple[IndexArray, FloatArray]]:
    """List samples as sets of examples and their weights; first one of each set, then more."""
    count, dimensions = weights.shape[1], scaled.shape[1]
    found: dict[tuple[int, ...], list[tuple[IndexArray, FloatArray]]] = {}
    for sample in near.tolist():
        chosen = np.flatnonzero(weights[sample])
        if len(chosen) <= dimensions:  # one of the examples, or a blend of few
            chosen = np.sort(nearest(scaled[:count], scaled[sample], dimensions + 1)[0])
            if weights[sample, chosen].sum() < 1 - 1e-9:
                continue
        of_set = found.setdefault(tuple(chosen.tolist()), [])
        if len(of_set) < STARTS:
            of_set.append((chosen, weights[sample, chosen]))
    rounds = zip_longest(*found.values())
    return [start for each in rounds for start in each if start is not None][:TRIES]


def _refined(
    rest: Evaluate, basis: FloatArray, start: FloatArray, bounds: tuple[float, float], enough: float
) -> tuple[FloatArray, float]:
    """Improve shares of some blends until what they make is near enough, or nothing helps more.

    Returns the blend weights, and how far off they are.
    """
    own, damping = bounded(start, *bounds), 1e-3
    now = rest(own @ basis)
    for _ in range(ROUNDS):
        if np.linalg.norm(now) <= enough:
            break
        slopes = _slopes(rest, basis, own, now)
        improved = False
        while damping < 1e6 and not improved:
            trial = bounded(own + _step(slopes, now, own, damping, bounds), *bounds)
            then = rest(trial @ basis)
            gain = np.linalg.norm(now) - np.linalg.norm(then)
            improved = bool(gain > 1e-3 * enough)
            damping = max(damping / 5, 1e-9) if improved else damping * 5
        if not improved:
            break
        own, now = trial, then
    return own @ basis, float(np.linalg.norm(now))


def _slopes(rest: Evaluate, basis: FloatArray, own: FloatArray, now: FloatArray) -> FloatArray:
    """Return what each share does, the others making room for it, shape (D, N)."""
    probes = (own + PROBE * np.eye(len(own))) / (1 + PROBE)
    return np.stack([(rest(probe @ basis) - now) / PROBE for probe in probes], axis=1)


def _step(
    slopes: FloatArray,
    now: FloatArray,
    own: FloatArray,
    damping: float,
    bounds: tuple[float, float],
) -> FloatArray:
    """Solve for the step with a sum of 0; shares that would leave their bounds stay."""
    free = np.ones(len(own), dtype=bool)
    step = np.zeros(len(own))
    for _ in range(len(own)):
        size = int(free.sum())
        part = slopes[:, free]
        matrix = np.zeros((size + 1, size + 1))
        matrix[:size, :size] = part.T @ part + damping * np.eye(size)
        matrix[size, :size] = matrix[:size, size] = 1.0
        step = np.zeros(len(own))
        try:
            step[free] = np.linalg.solve(matrix, np.append(-part.T @ now, 0.0))[:size]
        except np.linalg.LinAlgError:  # so steep that the damping is lost; a greater one follows
            return np.zeros(len(own))
        low, high = (own <= bounds[0] + 1e-12), (own >= bounds[1] - 1e-12)
        stuck = free & ((low & (step < 0)) | (high & (step > 0)))
        if not stuck.any() or size - stuck.sum() < 2:
            break
        free &= ~stuck
    return step
