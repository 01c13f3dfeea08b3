"""Spaces of motion: registered examples, samples of their blends, and what steers them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray, Motion
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.synthesis.aiming import Aim, aim
from mocapidx.synthesis.blending import Examples, blend, blend_at
from mocapidx.synthesis.bodies import joint_points, nodes_needed
from mocapidx.synthesis.parameters import Parameters, measure
from mocapidx.synthesis.registration import Registration
from mocapidx.synthesis.sampling import (
    Evaluate,
    interpolated_weights,
    redundant_examples,
    sample_blends,
)

__all__ = [
    "ENOUGH",
    "BlendSpace",
    "FitOptions",
    "MotionFunction",
    "Origin",
    "evaluator",
    "fit_space",
    "reach",
]

ENOUGH: Final = 1e-3
"""A miss of a millimetre needs no improvement."""

RATE: Final = 60.0
"""Frames a second at which blends are measured."""

MotionFunction = Callable[[Motion], Sequence[float] | FloatArray]
"""A user's own parameters of a motion."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where an example comes from.

    Parameters
    ----------
    document : str
    start, end : float
        In seconds.
    """

    document: str
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How a space is fitted.

    Parameters
    ----------
    extrapolation : float
        How far blend weights may lie below 0 and above 1 (paper: delta).
    draws : int
        How many blends are tried.
    tolerance : float
        Samples nearer to another one are dropped; in metres (or metres a second, seconds,
        radians).
    redundant : float or None
        Examples whose parameters the others give, off by no more than this, are left out.
    seed : int
        Of the random blends.

    Raises
    ------
    ParameterError
        If a value is out of its range.
    """

    extrapolation: float = 0.1
    draws: int = 1000
    tolerance: float = 0.0127
    redundant: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.extrapolation <= 1:
            raise ParameterError(f"extrapolation must be between 0 and 1, got {self.extrapolation}")
        if not 0 <= self.draws <= 100_000:
            raise ParameterError(f"samples must be between 0 and 100000, got {self.draws}")
        if not self.tolerance >= 0:
            raise ParameterError(f"tolerance must be at least 0, got {self.tolerance}")
        if self.redundant is not None and not self.redundant >= 0:
            raise ParameterError(f"redundant must be at least 0, got {self.redundant}")


@dataclass(frozen=True, slots=True, eq=False)
class BlendSpace:
    """A parameterised motion.

    Parameters
    ----------
    examples : Examples
    origins : tuple of Origin
        Of the examples.
    names, units : tuple of str
        Of the parameters.
    scales : ndarray of float64, shape (D,)
        How much of each parameter counts as much as a metre.
    weights : ndarray of float64, shape (S, E)
        Blend weights of the samples; the first E are the examples.
    parameters : ndarray of float64, shape (S, D)
        What the samples are like.
    extrapolation : float
        How far weights may lie below 0 and above 1.
    text : str
        The parameter file; empty where the parameters are a function's.
    """

    examples: Examples
    origins: tuple[Origin, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    scales: FloatArray
    weights: FloatArray
    parameters: FloatArray
    extrapolation: float
    text: str


def evaluator(examples: Examples, what: Parameters | MotionFunction) -> Evaluate:
    """Give the function from blend weights to parameters.

    Parameters
    ----------
    examples : Examples
    what : Parameters or callable
        A callable gets a motion at 60 Hz: the 24 canonical joints in metres, Y up, in the frame
        that the motion starts in, over the origin and facing Z.

    Returns
    -------
    callable
        From weights, shape (E,), to parameters, shape (D,). It raises `ParameterError` where a
        user's function fails or returns no plain numbers.
    """
    if not isinstance(what, Parameters):
        return _user_evaluator(examples, what)
    registration = examples.registration
    frames = max(int(np.ceil(registration.times[-1].max() * RATE)) + 1, 3)
    moments = np.linspace(0, 1, frames)
    first_times, _, _ = registration.at(moments, 0)
    nodes = nodes_needed(examples.body, what.joints)

    def evaluate(weights: FloatArray) -> FloatArray:
        blended = blend_at(examples, weights, moments, nodes)
        points = joint_points(examples.body, blended.movement, what.joints)
        return measure(what, points, blended.times, first_times)

    return evaluate


def _user_evaluator(examples: Examples, function: MotionFunction) -> Evaluate:
    def evaluate(weights: FloatArray) -> FloatArray:
        movement = blend(examples, weights, RATE).movement
        motion = Motion(CANONICAL_JOINTS, joint_points(examples.body, movement), RATE)
        try:
            values = np.atleast_1d(np.asarray(function(motion), dtype=np.float64))
        except Exception as exc:
            raise ParameterError(
                f"the parameter function failed with {type(exc).__name__}: {exc}"
            ) from exc
        if values.ndim != 1 or not np.isfinite(values).all():
            raise ParameterError(
                "the parameter function must return finite numbers, one or a sequence"
            )
        return values

    return evaluate


def fit_space(
    examples: Examples,
    origins: Sequence[Origin],
    what: Parameters | MotionFunction,
    options: FitOptions,
) -> BlendSpace:
    """Build a space of motion: measure the examples, and sample blends of them.

    Parameters
    ----------
    examples : Examples
    origins : sequence of Origin
        Where they come from.
    what : Parameters or callable
        What the motion shall be steered by.
    options : FitOptions

    Returns
    -------
    BlendSpace

    Raises
    ------
    ParameterError
        If there are too few examples, or a joint that is measured is unknown.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, sections 4.2 and 4.4.
    """
    evaluate = evaluator(examples, what)
    count = len(examples.movements)
    measured = np.array([evaluate(weights) for weights in np.eye(count)])
    dimensions = measured.shape[1]
    if count < dimensions + 1:
        raise ParameterError(
            f"{count} examples are too few for {dimensions} parameters: at least "
            f"{dimensions + 1} are needed, more make better motion"
        )
    if isinstance(what, Parameters):
        names, units, scales, text = what.names, what.units, what.scales, what.text
    else:
        names = tuple(f"value {n}" for n in range(1, dimensions + 1))
        units, scales, text = ("",) * dimensions, np.ones(dimensions), ""
    unknown = np.flatnonzero(~np.isfinite(measured).all(axis=0))
    if len(unknown):
        raise ParameterError(
            f"{names[unknown[0]]} is unknown in these motions: their skeleton lacks a joint"
        )
    if options.redundant is not None:
        gone = redundant_examples(evaluate, measured, scales, options.redundant)
        examples, origins = _without(examples, origins, gone)
        evaluate, measured = evaluator(examples, what), measured[~gone]
    weights, parameters = sample_blends(
        evaluate,
        measured,
        scales,
        draws=options.draws,
        extrapolation=options.extrapolation,
        tolerance=options.tolerance,
        seed=options.seed,
    )
    return BlendSpace(
        examples, tuple(origins), names, units, scales, weights, parameters,
        options.extrapolation, text,
    )  # fmt: skip


def _without(
    examples: Examples, origins: Sequence[Origin], gone: BoolArray
) -> tuple[Examples, list[Origin]]:
    kept = np.flatnonzero(~gone).tolist()
    old = examples.registration
    registration = Registration(
        old.moments, old.times[:, kept], old.turns[:, kept], old.shifts[:, kept]
    )
    movements = tuple(examples.movements[n] for n in kept)
    return (
        replace(examples, movements=movements, registration=registration),
        [origins[n] for n in kept],
    )


def reach(space: BlendSpace, target: FloatArray, what: Parameters | MotionFunction | None) -> Aim:
    """Find the blend that comes nearest to a target.

    Parameters
    ----------
    space : BlendSpace
    target : ndarray of float, shape (D,)
        In the units of the parameters.
    what : Parameters or callable or None
        What the space was fitted with; None: the weights are interpolated only, and nobody
        knows what they reach.

    Returns
    -------
    Aim
        Where nothing was measured, `reached` and `miss` are NaN.

    Raises
    ------
    ParameterError
        If the target has another number of values, or one is not finite.
    """
    if target.shape != space.scales.shape or not np.isfinite(target).all():
        raise ParameterError(
            f"a target of this space is {len(space.names)} numbers: {', '.join(space.names)}"
        )
    if what is None:
        weights = interpolated_weights(
            space.parameters / space.scales, space.weights, target / space.scales
        )
        return Aim(weights, np.full(len(target), np.nan), float("nan"))
    return aim(
        evaluator(space.examples, what),
        space.parameters,
        space.weights,
        target,
        space.scales,
        extrapolation=space.extrapolation,
        enough=ENOUGH,
    )
