"""The generic features: what each kind of relation between joints measures."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Final, TypeAlias

import numpy as np

from mocapidx.features.geometry import (
    Joints,
    Poses,
    along,
    angle_between,
    length_or_nan,
    norm,
    plane_normal,
    segment_distance,
    widest_floor_distance,
)
from mocapidx.model import FloatArray

__all__ = ["KINDS", "UNITS", "Kind", "Place"]

Place: TypeAlias = str | tuple[str, str]

# The units of each quantity: hl humerus length, sw shoulder width, hw hip width.
UNITS: Final = {
    "length": ("hl", "sw", "hw", "m"),
    "speed": ("hl/s", "sw/s", "hw/s", "m/s"),
    "angle": ("deg",),
}


@dataclass(frozen=True, slots=True)
class Kind:
    """What a generic feature means.

    Parameters
    ----------
    value : callable
        From poses and joints to the value in m, m/s or degrees, shape (T,). Unless `of_all`, J
        joints may stand in each place (a list): the values then have the shape (J, T).
    count : int
        How many joints the formula names.
    quantity : {"length", "speed", "angle"}
        What the value is; decides the unit.
    apart : tuple of (int, int)
        Places of joints that must not be one point, or the value means nothing.
    mirror : tuple of int
        The order in which the exchanged joints give the value of the mirrored pose: where the
        formula has a plane normal, two joints change places to flip it.
    same : tuple of tuple of int
        Other orders of the joints that give the same value.
    of_all : bool
        Whether all joints of a pose count, not only those that the formula names.
    needs : tuple of str
        Of these, joints without which the lowest, highest or farthest one would be another.
    """

    value: Callable[..., FloatArray]
    count: int
    quantity: str
    apart: tuple[tuple[int, int], ...] = ()
    mirror: tuple[int, ...] = ()
    same: tuple[tuple[int, ...], ...] = ()
    of_all: bool = False
    needs: tuple[str, ...] = ()


def _plane(poses: Poses, j1: Joints, j2: Joints, j3: Joints, j4: Joints) -> FloatArray:
    p1 = poses.at(j1)
    return along(poses.at(j4) - p1, plane_normal(p1, poses.at(j2), poses.at(j3)))


def _plane_gap(
    poses: Poses, j1: Joints, j2: Joints, j3: Joints, j4: Joints, j5: Joints
) -> FloatArray:
    normal = plane_normal(poses.at(j1), poses.at(j2), poses.at(j3))
    return along(poses.at(j5) - poses.at(j4), normal)


def _nplane(poses: Poses, j1: Joints, j2: Joints, j3: Joints, j4: Joints) -> FloatArray:
    return along(poses.at(j4) - poses.at(j3), poses.at(j2) - poses.at(j1))


def _angle(poses: Poses, j1: Joints, j2: Joints, j3: Joints, j4: Joints) -> FloatArray:
    return angle_between(poses.at(j2) - poses.at(j1), poses.at(j4) - poses.at(j3))


def _tilt(poses: Poses, j1: Joints, j2: Joints) -> FloatArray:
    direction = poses.at(j2) - poses.at(j1)
    up = np.zeros_like(direction)
    up[1] = 1
    return angle_between(direction, up)


def _move(poses: Poses, j1: Joints, j2: Joints, j3: Joints, j4: Joints) -> FloatArray:
    return along(poses.speed_of(j4) - poses.speed_of(j3), poses.at(j2) - poses.at(j1))


def _nmove(poses: Poses, j1: Joints, j2: Joints, j3: Joints, j4: Joints) -> FloatArray:
    normal = plane_normal(poses.at(j1), poses.at(j2), poses.at(j3))
    return along(poses.speed_of(j4) - poses.speed_of(j1), normal)


def _approach(poses: Poses, j1: Joints, j2: Joints, j3: Joints, j4: Joints) -> FloatArray:
    between = poses.at(j2) - poses.at(j1)
    nearing = along(poses.speed_of(j1) - poses.speed_of(j2), between)
    axis = poses.at(j4) - poses.at(j3)
    share: FloatArray = np.abs(along(axis, between)) / length_or_nan(axis)
    return nearing * share


def _fast(poses: Poses, joint: Joints) -> FloatArray:
    return norm(poses.speed_of(joint))


def _height(poses: Poses, joint: str) -> FloatArray:
    others = poses.present[poses.present != poses.rows[joint]]
    lowest = np.fmin.reduce(poses.points[others, 1], axis=0, initial=np.inf)
    height: FloatArray = poses.at(joint)[1] - lowest
    return height


def _touch(
    poses: Poses, first: Joints | tuple[Joints, Joints], second: Joints | tuple[Joints, Joints]
) -> FloatArray:
    if not isinstance(first, tuple) and not isinstance(second, tuple):
        return norm(poses.at(first) - poses.at(second))
    ends = [place if isinstance(place, tuple) else (place, place) for place in (first, second)]
    return segment_distance(*(poses.at(joint) for pair in ends for joint in pair))


def _extent_y(poses: Poses) -> FloatArray:
    y = poses.points[poses.present, 1]
    highest: FloatArray = np.fmax.reduce(y, axis=0, initial=-np.inf)
    lowest: FloatArray = np.fmin.reduce(y, axis=0, initial=np.inf)
    return highest - lowest


def _extent_xz(poses: Poses) -> FloatArray:
    return widest_floor_distance(poses.points[poses.present])


_CYCLIC = ((1, 2, 0), (2, 0, 1))
_DIFFERENCES = ((0, 1), (2, 3))
_BOTH_TURNED = (1, 0, 3, 2)

_FEET: Final = ("lankle", "rankle")

KINDS: Final[dict[str, Kind]] = {
    "plane": Kind(
        _plane,
        count=4,
        quantity="length",
        apart=tuple(combinations(range(4), 2)),
        mirror=(0, 2, 1, 3),
        same=tuple((*turn, 3) for turn in _CYCLIC),
    ),
    "plane_gap": Kind(
        _plane_gap,
        count=5,
        quantity="length",
        apart=((0, 1), (0, 2), (1, 2), (3, 4)),
        mirror=(0, 2, 1, 3, 4),
        same=(
            *((*turn, 3, 4) for turn in _CYCLIC),
            *((*turn, 4, 3) for turn in ((0, 2, 1), (2, 1, 0), (1, 0, 2))),
        ),
    ),
    "nplane": Kind(_nplane, 4, "length", apart=_DIFFERENCES, same=(_BOTH_TURNED,)),
    "angle": Kind(
        _angle, 4, "angle", apart=_DIFFERENCES, same=(_BOTH_TURNED, (2, 3, 0, 1), (3, 2, 1, 0))
    ),
    "tilt": Kind(_tilt, 2, "angle", apart=((0, 1),)),
    "move": Kind(_move, 4, "speed", apart=_DIFFERENCES, same=(_BOTH_TURNED,)),
    "nmove": Kind(
        _nmove,
        count=4,
        quantity="speed",
        apart=((0, 1), (0, 2), (1, 2), (0, 3)),
        mirror=(0, 2, 1, 3),
    ),
    "approach": Kind(
        _approach,
        count=4,
        quantity="speed",
        apart=_DIFFERENCES,
        same=((1, 0, 2, 3), (0, 1, 3, 2), _BOTH_TURNED),
    ),
    "fast": Kind(_fast, 1, "speed"),
    "height": Kind(_height, 1, "length", of_all=True, needs=_FEET),
    "touch": Kind(_touch, 2, "length", apart=((0, 1),), same=((1, 0),)),
    "extent_y": Kind(_extent_y, 0, "length", of_all=True, needs=(*_FEET, "head")),
    "extent_xz": Kind(_extent_xz, 0, "length", of_all=True, needs=(*_FEET, "head")),
}
