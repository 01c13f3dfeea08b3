"""Registration: which moments of examples go together, and how they are laid upon each other.

Moments are counted by ``u`` from 0 (all first frames) to 1 (all last frames).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mocapidx.alignment.distances import pose_distance
from mocapidx.errors import ParameterError
from mocapidx.graphs.match_graph import cheapest_ways
from mocapidx.model import FloatArray
from mocapidx.skeleton.joints import INDEX
from mocapidx.synthesis.timewarps import (
    STEEPEST,
    MonotoneCurve,
    slope_limited_path,
    smooth_timewarp,
)

__all__ = ["RATE", "Registration", "Tie", "register", "star", "timewarp_between"]

RATE: Final = 30.0
"""Poses a second that are compared when motions are aligned."""

WINDOW: Final = 0.2
"""Seconds before and after a frame whose poses are compared and laid upon each other with it."""

SMOOTHING: Final = 0.2
"""Seconds to either side over which time alignments are averaged."""

Tie: TypeAlias = tuple[int, int, float]
"""Two stretches that are similar, and the cost of their edge."""

ComplexArray: TypeAlias = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """One timewarp curve for all examples, and where each has to be moved on the floor.

    Parameters
    ----------
    moments : ndarray of float64, shape (K,)
        ``u`` from 0 to 1, strictly increasing.
    times : ndarray of float64, shape (K, E)
        The time in each example that belongs to a moment, in seconds from its start; strictly
        increasing.
    turns : ndarray of float64, shape (K, E)
        By what each example is turned about the vertical at a moment, in radians, from Z
        towards X.
    shifts : ndarray of complex128, shape (K, E)
        And how far it then is moved over the floor, z + ix in metres: after that all lie in the
        frame of the first example, which starts over the origin and faces Z.
    """

    moments: FloatArray
    times: FloatArray
    turns: FloatArray
    shifts: ComplexArray

    def at(self, moments: FloatArray, example: int) -> tuple[FloatArray, FloatArray, ComplexArray]:
        """Give times, turns and shifts of one example at any moments."""
        times, turns = (
            np.interp(moments, self.moments, column[:, example])
            for column in (self.times, self.turns)
        )
        shifts: ComplexArray = np.interp(moments, self.moments, self.shifts[:, example])
        return times, turns, shifts


def star(stretches: int) -> list[Tie]:
    """Tie every stretch directly to the first, where no match graph is known.

    Parameters
    ----------
    stretches : int

    Returns
    -------
    list of Tie
    """
    return [(0, other, 0.0) for other in range(1, stretches)]


def timewarp_between(one: FloatArray, other: FloatArray) -> MonotoneCurve | None:
    """Align two stretches and fit a strictly increasing spline to the time alignment.

    Parameters
    ----------
    one, other : ndarray of float, shape (T, J, 3)
        Joint positions in metres, Y up, `RATE` frames a second; no NaN, at least two frames.

    Returns
    -------
    MonotoneCurve or None
        From frames of `one` to frames of `other`; None where one lasts too long for the other.
    """
    clouds = [_windows(positions) for positions in (one, other)]
    rows, columns = (np.arange(len(cloud)) for cloud in clouds)
    pairs = np.repeat(rows, len(columns)), np.tile(columns, len(rows))
    costs = pose_distance(*clouds)(*pairs).reshape(len(rows), len(columns))
    path = slope_limited_path(costs)
    return None if path is None else smooth_timewarp(path, round(SMOOTHING * RATE))


def _windows(positions: FloatArray) -> FloatArray:
    """Put the joints of neighbouring frames together, a cloud for each frame."""
    frames = np.arange(len(positions))
    reach = round(WINDOW * RATE)
    steps = range(-reach, reach + 1, max(reach // 2, 1))
    near = [positions[np.clip(frames + step, 0, len(frames) - 1)] for step in steps]
    return np.concatenate(near, axis=1)


def register(
    poses: Sequence[FloatArray],
    durations: Sequence[float],
    ties: Sequence[Tie],
    examples: Sequence[int],
    names: Sequence[str],
    moments: int,
) -> Registration:
    """Register examples with the first of them.

    Parameters
    ----------
    poses : sequence of ndarray of float, shape (T, 24, 3)
        Joint positions of stretches: examples, and others that may lie between them. In metres,
        evenly spread from the first moment to the last, about `RATE` a second.
    durations : sequence of float
        Of the stretches, in seconds.
    ties : sequence of Tie
        Pairs of stretches that are similar; alignments go along the cheapest ways.
    examples : sequence of int
        The stretches that are to be registered, the query first.
    names : sequence of str
        Of the stretches, for messages.
    moments : int
        How many moments the curve is given at.

    Returns
    -------
    Registration

    Raises
    ------
    ParameterError
        If no way leads from the query to an example, or two motions can't be aligned.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 4.1.
    .. [2] Kovar, Gleicher, "Flexible automatic motion blending with registration curves",
       SCA 2003, sections 3 and 4.
    """
    joints = np.isfinite(np.concatenate(poses)).all(axis=(0, 2))
    known = [np.asarray(stretch[:, joints], dtype=np.float64) for stretch in poses]
    before = _ways(len(poses), ties, examples, names)
    u = np.linspace(0, 1, moments)
    frames: dict[int, FloatArray] = {examples[0]: u * (len(known[examples[0]]) - 1)}
    curves = {}
    for example in examples:
        way = [example]
        while way[-1] not in frames:
            way.append(before[way[-1]])
        for one, other in zip(way[::-1], way[-2::-1], strict=False):
            curve = timewarp_between(known[one], known[other])
            if curve is None:
                raise ParameterError(
                    f"{names[other]} lasts {durations[other]:.2f} s and {names[one]} "
                    f"{durations[one]:.2f} s, which is more than {STEEPEST} times as long; "
                    "leave one out"
                )
            curves[other] = curve
            frames[other] = curve(frames[one])
    columns = [frames[e] / (len(known[e]) - 1) for e in examples]
    first = _at_frames(known[examples[0]], columns[0])
    heading, origin = _start(poses[examples[0]][0])
    turns, shifts = [], []
    for example, column in zip(examples, columns, strict=True):
        turn, shift = _floor_alignment(first, _at_frames(known[example], column), moments)
        turns.append(np.unwrap(turn - heading))
        shifts.append((shift - origin) * np.exp(-1j * heading))
    times = np.stack([c * durations[e] for c, e in zip(columns, examples, strict=True)], axis=1)
    return Registration(u, times, np.stack(turns, axis=1), np.stack(shifts, axis=1))


def _ways(
    stretches: int, ties: Sequence[Tie], examples: Sequence[int], names: Sequence[str]
) -> list[int]:
    """Return the stretch before each on its cheapest way from the query."""
    neighbours: list[list[tuple[int, float]]] = [[] for _ in range(stretches)]
    for one, other, cost in ties:
        neighbours[one].append((other, cost))
        neighbours[other].append((one, cost))
    distances, before = cheapest_ways(neighbours, examples[0])
    for example in examples:
        if np.isinf(distances[example]):
            raise ParameterError(
                f"the match graph has no way from {names[examples[0]]} to {names[example]}; "
                "leave it out, or fit without --graph"
            )
    return before


def _at_frames(positions: FloatArray, shares: FloatArray) -> FloatArray:
    """Interpolate positions at shares (0 to 1) of their frames."""
    at = shares * (len(positions) - 1)
    before = np.clip(at.astype(np.int64), 0, len(positions) - 2)
    part = (at - before)[:, None, None]
    between: FloatArray = (1 - part) * positions[before] + part * positions[before + 1]
    return between


def _start(pose: FloatArray) -> tuple[float, complex]:
    """Return where a body faces, in radians from Z towards X, and where it stands, z + ix."""
    across = pose[INDEX["lhip"]] - pose[INDEX["rhip"]]
    heading = float(np.arctan2(-across[2], across[0]))
    root = pose[INDEX["root"]]
    return heading, complex(root[2], root[0])


def _floor_alignment(
    first: FloatArray, other: FloatArray, moments: int
) -> tuple[FloatArray, ComplexArray]:
    """Lay the poses of one motion upon those of another, moment by moment.

    Poses of the moments near by count too, the less the farther, so that the result is smooth.
    """
    one, two = (p[..., 2] + 1j * p[..., 0] for p in (first, other))
    mean, other_mean = one.mean(axis=1), two.mean(axis=1)
    if one.shape[1] < 1 or np.array_equal(first, other):
        return np.zeros(moments), np.zeros(moments, dtype=np.complex128)
    products = ((one - mean[:, None]) * (two - other_mean[:, None]).conj()).mean(axis=1)
    reach = max(moments // 12, 1)
    # Over the window the clouds are shifted as one, so their means count as well.
    total = _smoothed(products + mean * other_mean.conj(), reach)
    mean, other_mean = _smoothed(mean, reach), _smoothed(other_mean, reach)
    total -= mean * other_mean.conj()
    turn = np.unwrap(np.angle(total))
    return turn, mean - np.exp(1j * turn) * other_mean


def _smoothed(values: ComplexArray, reach: int) -> ComplexArray:
    weights = reach + 1.0 - np.abs(np.arange(-reach, reach + 1))
    padded = np.pad(values, reach, mode="edge")
    smooth: ComplexArray = np.convolve(padded, weights / weights.sum(), mode="valid")
    return smooth
