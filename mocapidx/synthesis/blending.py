"""Blends: weighted averages of registered examples, in pose, path and timing."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.model import FloatArray
from mocapidx.synthesis.bodies import Body, Movement
from mocapidx.synthesis.quaternions import (
    about_vertical,
    averaged,
    continuous,
    product,
    sampled,
)
from mocapidx.synthesis.registration import Registration

__all__ = ["Blend", "Examples", "blend", "blend_at", "blend_times"]

SLOWEST: Final = 0.2
"""No moment passes faster than at this share of its time in the fastest example."""


@dataclass(frozen=True, slots=True, eq=False)
class Examples:
    """Registered movements of one body.

    Parameters
    ----------
    body : Body
    movements : tuple of Movement
        All of the body.
    registration : Registration
    """

    body: Body
    movements: tuple[Movement, ...]
    registration: Registration


@dataclass(frozen=True, slots=True, eq=False)
class Blend:
    """A new movement.

    Parameters
    ----------
    movement : Movement
        In the frame of the registration: it starts near the origin, facing Z.
    moments : ndarray of float64, shape (T,)
        The moments of the registration that its frames are.
    times : ndarray of float64, shape (T,)
        When its frames are, in seconds from the start.
    """

    movement: Movement
    moments: FloatArray
    times: FloatArray


def blend_times(registration: Registration, weights: FloatArray) -> FloatArray:
    """Give the time at which a blend passes each moment of its registration.

    Parameters
    ----------
    registration : Registration
    weights : ndarray of float64, shape (E,)
        Their sum is 1.

    Returns
    -------
    ndarray of float64, shape (K,)
        From 0, strictly increasing, in seconds. Each moment takes as long as the weighted
        average of the examples says; negative weights can't make time stand still.

    References
    ----------
    .. [1] Kovar, Gleicher, "Flexible automatic motion blending with registration curves",
       SCA 2003, section 5: the advance along the timewarp curve.
    """
    active = np.flatnonzero(weights)
    steps = np.diff(registration.times[:, active], axis=0)
    average = steps @ weights[active]
    passing = np.maximum(average, SLOWEST * steps.min(axis=1))
    return np.concatenate(([0.0], np.cumsum(passing)))


def blend(examples: Examples, weights: FloatArray, rate: float) -> Blend:
    """Blend examples into a movement at a frame rate.

    Parameters
    ----------
    examples : Examples
    weights : ndarray of float64, shape (E,)
        Their sum is 1.
    rate : float
        Frames a second, in Hz.

    Returns
    -------
    Blend
        With all the weight on one example, that example from its own first frame on, up to a
        turn and a shift on the floor.

    Raises
    ------
    ParameterError
        If there is not one weight for each example, or their sum is not 1.
    """
    _check(examples, weights)
    times = blend_times(examples.registration, weights)
    frames = np.arange(int(np.floor(times[-1] * rate + 1e-6)) + 1) / rate
    moments = np.interp(frames, times, examples.registration.moments)
    return Blend(_blended(examples, weights, moments, rate), moments, frames)


def blend_at(
    examples: Examples, weights: FloatArray, moments: FloatArray, nodes: Sequence[int] | None = None
) -> Blend:
    """Blend examples at given moments of their registration.

    Parameters
    ----------
    examples : Examples
    weights : ndarray of float64, shape (E,)
        Their sum is 1.
    moments : ndarray of float64, shape (T,)
        From 0 to 1, increasing.
    nodes : sequence of int, optional
        The nodes whose rotations are wanted, the root among them; others stay unturned.

    Returns
    -------
    Blend
        Its frames are not evenly spread in time; the rate is that of the first example.

    Raises
    ------
    ParameterError
        If there is not one weight for each example, or their sum is not 1.
    """
    _check(examples, weights)
    times = blend_times(examples.registration, weights)
    rate = examples.movements[0].rate
    movement = _blended(examples, weights, moments, rate, nodes)
    return Blend(movement, moments, np.interp(moments, examples.registration.moments, times))


def _check(examples: Examples, weights: FloatArray) -> None:
    if weights.shape != (len(examples.movements),):
        raise ParameterError(f"{len(examples.movements)} examples need as many weights")
    if not abs(float(weights.sum()) - 1) < 1e-6:
        raise ParameterError(f"blend weights have the sum 1, not {float(weights.sum()):g}")


def _blended(
    examples: Examples,
    weights: FloatArray,
    moments: FloatArray,
    rate: float,
    nodes: Sequence[int] | None = None,
) -> Movement:
    active = np.flatnonzero(weights)
    kept = slice(None) if nodes is None else np.asarray(nodes)
    rotations, heights, paths, turns, shifts = [], [], [], [], []
    for example in active.tolist():
        movement = examples.movements[example]
        times, turn, shift = examples.registration.at(moments, example)
        before, part = _frames_at(times * movement.rate, len(movement.places))
        own = sampled(movement.turns[:, kept], before, part)
        own[:, 0] = product(about_vertical(turn), own[:, 0])
        place = movement.places[before] * (1 - part)[:, None]
        place += movement.places[before + 1] * part[:, None]
        rotations.append(own)
        heights.append(place[:, 1])
        paths.append(np.exp(1j * turn) * (place[:, 2] + 1j * place[:, 0]) + shift)
        turns.append(turn)
        shifts.append(shift)
    share = weights[active]
    average = averaged(np.array(rotations), share)
    heading, path = _travelled(np.array(turns), np.array(shifts), share @ np.array(paths), share)
    average[:, 0] = product(about_vertical(heading), average[:, 0])
    places = np.stack((path.imag, share @ np.array(heights), path.real), axis=1)
    if nodes is None:
        return Movement(rate, continuous(average), places)
    whole = np.zeros((len(moments), len(examples.body.skeleton.names), 4))
    whole[..., 0] = 1.0
    whole[:, kept] = average
    return Movement(rate, whole, places)


def _frames_at(frames: FloatArray, count: int) -> tuple[NDArray[np.int64], FloatArray]:
    """Split times, in frames, into the frame before and the part of the way to the next."""
    before = np.clip(np.floor(frames + 1e-9).astype(np.int64), 0, count - 2)
    return before, np.clip(frames - before, 0.0, 1.0)


def _travelled(
    turns: FloatArray,
    shifts: NDArray[np.complexfloating[Any, Any]],
    path: NDArray[np.complexfloating[Any, Any]],
    weights: FloatArray,
) -> tuple[FloatArray, NDArray[np.complexfloating[Any, Any]]]:
    """Give the blend a way of its own: each step is the average of the examples' steps.

    Laid upon the first example at every moment, all would walk its way. So the frame that they
    are laid into moves on itself: from one moment to the next, each example alone would have it
    move such that the example goes on as it did; these moves are averaged about the root.
    """
    heading_steps = turns[:, :-1] - turns[:, 1:]
    moved = np.exp(1j * heading_steps) * (path[1:] - shifts[:, 1:]) + shifts[:, :-1]
    heading = np.concatenate(([0.0], np.cumsum(weights @ heading_steps)))
    steps = (weights @ moved - path[:-1]) * np.exp(1j * heading[:-1])
    return heading, path[0] + np.concatenate(([0.0], np.cumsum(steps)))
