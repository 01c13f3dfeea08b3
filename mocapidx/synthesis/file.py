"""Spaces of motion as files: all that is needed to make new motion, whatever becomes of sources.

Rotations are kept in single precision: seven digits, a tenth of a micrometre at the fingertips.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import FormatError, StoreError
from mocapidx.model import FloatArray, Skeleton
from mocapidx.printable import shown
from mocapidx.skeleton.jointmap import Between, JointMap, Mapping24
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.store.space import read_space, write_space
from mocapidx.synthesis.blending import Examples
from mocapidx.synthesis.bodies import Body, Movement
from mocapidx.synthesis.parameters import QUANTITIES, parse_parameters
from mocapidx.synthesis.registration import Registration
from mocapidx.synthesis.spaces import BlendSpace, Origin

__all__ = ["load_space", "save_space"]

MOST_NODES: Final = 4096
LARGEST: Final = 1e9  # metres, radians, or units of a parameter
SLACK: Final = 1e-6
UNITS: Final = frozenset({"", *QUANTITIES.values()})
"""By how much rounding may take weights out of their bounds."""


def save_space(space: BlendSpace, path: Path) -> None:
    """Write a space of motion; it is whole and on disk afterwards, or as it was before.

    Parameters
    ----------
    space : BlendSpace
    path : Path

    Raises
    ------
    ParameterError
        If it is too large for one file.
    WriteError
        If it could not be written.
    """
    body, registration = space.examples.body, space.examples.registration
    skeleton, mapping = body.skeleton, body.mapping
    made = [[joint, m.first, m.last, m.at] for joint, m in mapping.joint_map.made.items()]
    meta = {
        "names": list(space.names),
        "units": list(space.units),
        "scales": space.scales.tolist(),
        "extrapolation": space.extrapolation,
        "parameters": space.text,
        "examples": [[o.document, o.start, o.end] for o in space.origins],
        "rates": [movement.rate for movement in space.examples.movements],
        "nodes": list(skeleton.names),
        "parents": skeleton.parents.tolist(),
        "turned_by": skeleton.turned_by,
        "joint_map": {"name": mapping.joint_map.name, "joints": list(mapping.nodes), "made": made},
    }
    curves = [
        registration.moments[:, None],
        registration.times,
        registration.turns,
        registration.shifts.real,
        registration.shifts.imag,
    ]
    arrays: dict[str, list[NDArray[Any]]] = {
        "turns": [movement.turns for movement in space.examples.movements],
        "places": [movement.places for movement in space.examples.movements],
        "curves": curves,
        "samples": [space.weights, space.parameters],
        "offsets": [skeleton.offsets],
    }
    write_space(path, meta, arrays)


def load_space(path: Path) -> BlendSpace:
    """Read a space of motion, everything checked.

    Parameters
    ----------
    path : Path

    Returns
    -------
    BlendSpace

    Raises
    ------
    StoreError
        If there is no such file, or it is damaged or of a newer version.
    """
    meta, arrays = read_space(path)
    try:
        return _space(meta, arrays)
    except (_Wrong, KeyError, TypeError, ValueError, FormatError) as exc:
        what = exc if isinstance(exc, _Wrong) else "it says of itself what can't be"
        raise StoreError(
            f"{shown(path)}: damaged ({what}); restore it, or make it again with "
            "'mocapidx blend fit'"
        ) from exc


class _Wrong(Exception):
    """What is wrong with a file."""


def _wrong(what: str) -> NoReturn:
    raise _Wrong(what)


def _space(meta: Mapping[str, Any], arrays: Mapping[str, list[NDArray[Any]]]) -> BlendSpace:
    for group, members in arrays.items():
        if not all(np.isfinite(member).all() for member in members):
            _wrong(f"{group} hold what is no number")
    body = _body(meta, arrays["offsets"])
    rates = [_number(rate, 0.1, 1e5) for rate in meta["rates"]]
    movements = _movements(arrays, rates, len(body.skeleton.names))
    count = len(movements)
    registration = _registration(arrays["curves"], count)
    for example, movement in enumerate(movements):
        last = (len(movement.places) - 1) / movement.rate
        if (
            not -SLACK
            <= registration.times[0, example]
            <= registration.times[-1, example]
            <= (last + SLACK)
        ):
            _wrong("its curves do not fit its examples")
    names, units = (tuple(map(str, meta[key])) for key in ("names", "units"))
    scales = np.array([_number(scale, 1e-9, 1e9) for scale in meta["scales"]])
    extrapolation = _number(meta["extrapolation"], 0.0, 1.0)
    weights, parameters = _samples(arrays["samples"], count, len(names), extrapolation)
    told = all(name.isprintable() for name in names) and set(units) <= UNITS
    if not (told and len(names) == len(units) == len(scales) > 0):
        _wrong("its parameters are not told rightly")
    text = str(meta["parameters"])
    if text and parse_parameters(text, "parameters").names != names:
        _wrong("its parameters are not told rightly")
    origins = tuple(
        Origin(str(document), _number(start, 0.0, 1e9), _number(end, 0.0, 1e9))
        for document, start, end in meta["examples"]
    )
    if len(origins) != count:
        _wrong("its examples are not told rightly")
    examples = Examples(body, movements, registration)
    return BlendSpace(
        examples, origins, names, units, scales, weights, parameters, extrapolation, text
    )


def _number(value: Any, low: float, high: float) -> float:
    if type(value) not in (int, float) or not low <= value <= high or not math.isfinite(value):
        _wrong(f"a number is {shown(repr(value), 40)}")
    return float(value)


def _body(meta: Mapping[str, Any], offsets: list[NDArray[Any]]) -> Body:
    names = tuple(map(str, meta["nodes"]))
    count = len(names)
    parents = np.array(meta["parents"])
    whole = parents.shape == (count,) and parents.dtype == np.int64
    if not (0 < count <= MOST_NODES and whole and len(set(names)) == count):
        _wrong("its skeleton is none")
    before = np.arange(count)
    if parents[0] != -1 or ((parents < 0) | (parents >= before))[1:].any():
        _wrong("its skeleton is no tree")
    if len(offsets) != 1 or offsets[0].shape != (count, 3) or np.abs(offsets[0]).max() > 1e6:
        _wrong("its bones are none")
    if meta["turned_by"] not in ("parent", "own"):
        _wrong("its skeleton is none")
    told = meta["joint_map"]
    nodes = tuple(told["joints"])
    if len(nodes) != len(CANONICAL_JOINTS) or not all(
        type(node) is int and -1 <= node < count for node in nodes
    ):
        _wrong("its joints are not told rightly")
    made = {}
    for joint, first, last, at in told["made"]:
        if not {joint, first, last} <= set(CANONICAL_JOINTS):
            _wrong("its joints are not told rightly")
        made[joint] = Between(first, last, _number(at, -1e3, 1e3))
    skeleton = Skeleton(names, parents, offsets[0].astype(np.float64), meta["turned_by"])
    return Body(skeleton, Mapping24(JointMap(str(told["name"]), "", {}, made), nodes))


def _movements(
    arrays: Mapping[str, list[NDArray[Any]]], rates: list[float], nodes: int
) -> tuple[Movement, ...]:
    turns, places = arrays["turns"], arrays["places"]
    if not len(turns) == len(places) == len(rates) > 0:
        _wrong("its examples are not told rightly")
    movements = []
    for own, place, rate in zip(turns, places, rates, strict=True):
        frames = len(place)
        if frames < 2 or own.shape != (frames, nodes, 4) or place.shape != (frames, 3):
            _wrong("an example has a wrong shape")
        lengths = np.linalg.norm(own.astype(np.float64), axis=2)
        if np.abs(lengths - 1).max() > 1e-3:
            _wrong("an example has rotations that are none")
        if np.abs(place).max() > 1e6:
            _wrong("an example is too far away")
        movements.append(Movement(rate, own.astype(np.float64), place.astype(np.float64)))
    return tuple(movements)


def _registration(curves: list[NDArray[Any]], count: int) -> Registration:
    shapes = [curve.shape for curve in curves]
    if len(curves) != 5 or shapes[0][1] != 1 or shapes[0][0] < 2:
        _wrong("its curves have wrong shapes")
    if any(shape != (shapes[0][0], count) for shape in shapes[1:]):
        _wrong("its curves have wrong shapes")
    moments, times, turns, east, north = (curve.astype(np.float64) for curve in curves)
    u = moments[:, 0]
    if u[0] != 0 or u[-1] != 1 or (np.diff(u) <= 0).any() or (np.diff(times, axis=0) <= 0).any():
        _wrong("its curves do not increase")
    if max(np.abs(curve).max() for curve in (turns, east, north)) > LARGEST:
        _wrong("its curves are too large")
    return Registration(u, times, turns, east + 1j * north)


def _samples(
    samples: list[NDArray[Any]], count: int, dimensions: int, extrapolation: float
) -> tuple[FloatArray, FloatArray]:
    if len(samples) != 2 or len(samples[0]) != len(samples[1]) or len(samples[0]) < count:
        _wrong("its samples are not told rightly")
    weights, parameters = (sample.astype(np.float64) for sample in samples)
    if weights.shape[1] != count or parameters.shape[1] != dimensions:
        _wrong("its samples have wrong shapes")
    if np.abs(parameters).max() > LARGEST:
        _wrong("its parameters are too large")
    low, high = -extrapolation - SLACK, 1 + extrapolation + SLACK
    sums = weights.sum(axis=1)
    if weights.min() < low or weights.max() > high or np.abs(sums - 1).max() > SLACK:
        _wrong("blend weights are out of their bounds")
    return weights, parameters
