"""Joint positions as a rig that moves: bones of fixed length, and rotations that aim them.

From above downwards each joint is turned such that the next one lies in the direction of its
true position, seen from where the rig has come to by then; so errors of length do not add up
along a limb. What positions don't tell stays open: how far a bone is turned about itself goes
on from the bone above.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray, Motion, Recording, Skeleton
from mocapidx.skeleton.angles import channel_angles

__all__ = ["CENTIMETRE", "solved_rig"]

CENTIMETRE: Final = 0.01
"""Metres in one unit of a solved rig."""

DECIMALS: Final = 6  # of centimetres and degrees: far below what bones of fixed length leave off
ORDER: Final = (2, 1, 0)  # z, y, x: what most programs write and read
SAME_POINT: Final = 1e-6  # metres
VERTICAL: Final = np.array([0.0, 1.0, 0.0])
SIDEWAYS: Final = np.array([0.6, 0.0, 0.8])  # where up and the pair of joints are one line
# Joint, parent, name, and the way from the parent in the zero pose, a T: Y up, left is +X.
# Names are those of HumanIK, which other programs know. The collar bones hang on the chest, so
# that the arms don't follow the head there.
RIG: Final = (
    ("root", "", "Hips", (0, 0, 0)),
    ("lhip", "root", "LeftUpLeg", (1, 0, 0)),
    ("lknee", "lhip", "LeftLeg", (0, -1, 0)),
    ("lankle", "lknee", "LeftFoot", (0, -1, 0)),
    ("ltoes", "lankle", "LeftToeBase", (0, -0.5, 1)),
    ("rhip", "root", "RightUpLeg", (-1, 0, 0)),
    ("rknee", "rhip", "RightLeg", (0, -1, 0)),
    ("rankle", "rknee", "RightFoot", (0, -1, 0)),
    ("rtoes", "rankle", "RightToeBase", (0, -0.5, 1)),
    ("belly", "root", "Spine", (0, 1, 0)),
    ("chest", "belly", "Spine1", (0, 1, 0)),
    ("neck", "chest", "Neck", (0, 1, 0)),
    ("head", "neck", "Head", (0, 1, 0)),
    ("headtop", "head", "Head/End", (0, 1, 0)),
    ("lclavicle", "chest", "LeftShoulder", (0, 1, 0)),
    ("lshoulder", "lclavicle", "LeftArm", (1, 0, 0)),
    ("lelbow", "lshoulder", "LeftForeArm", (1, 0, 0)),
    ("lwrist", "lelbow", "LeftHand", (1, 0, 0)),
    ("lfingers", "lwrist", "LeftHand/End", (1, 0, 0)),
    ("rclavicle", "chest", "RightShoulder", (0, 1, 0)),
    ("rshoulder", "rclavicle", "RightArm", (-1, 0, 0)),
    ("relbow", "rshoulder", "RightForeArm", (-1, 0, 0)),
    ("rwrist", "relbow", "RightHand", (-1, 0, 0)),
    ("rfingers", "rwrist", "RightHand/End", (-1, 0, 0)),
)
PARENT: Final = {joint: parent for joint, parent, _, _ in RIG}
# Joints whose own frame can be seen: x goes from the first to the second, y towards the third,
# or the next that is there.
FRAMED: Final = {
    "root": ("rhip", "lhip", ("belly", "chest", "neck", "head")),
    "chest": ("rshoulder", "lshoulder", ("neck",)),
}


def solved_rig(motion: Motion) -> Recording:
    """Find a rig and its rotations that put the joints where they are.

    Parameters
    ----------
    motion : Motion
        The canonical joints, at least root and hips. Frames where a joint is NaN take it from
        those before and after; joints that are never there are left out.

    Returns
    -------
    Recording
        Joints with the names of HumanIK, in centimetres; the root moves and turns, others turn
        about z, y and x. Bones have the median of their lengths.

    Raises
    ------
    ParameterError
        If root or hips are not there at all.
    """
    points = _points(motion)
    for needed in ("root", "lhip", "rhip"):
        if needed not in points:
            raise ParameterError(f"the motion has no joint {needed}, so it can't be a rig")
    rig = [row for row in RIG if row[0] in points]
    joints = [joint for joint, *_ in rig]
    parents = [-1, *(joints.index(_parent(joint, points)) for joint in joints[1:])]
    frames = {
        joints.index(joint): _frame(points, right, left, upper)
        for joint, (right, left, upper) in FRAMED.items()
        if {joint, right, left} <= points.keys()
    }
    rest = np.zeros((len(rig), 3))
    for i, (joint, _, _, direction) in enumerate(rig[1:], start=1):
        ways = points[joint] - points[joints[parents[i]]]
        rest[i] = _rest(ways, direction, frames.get(parents[i]))
    turns = _aimed([points[joint] for joint in joints], parents, rest, frames)
    names = [name for _, _, name, _ in rig]
    return _recording(motion.rate, names, parents, rest, points["root"], turns)


def _points(motion: Motion) -> dict[str, FloatArray]:
    """Return the joints that are there, without gaps; collar bones may begin at the neck."""
    points: dict[str, FloatArray] = {}
    for column, joint in enumerate(motion.joints):
        own = motion.positions[:, column].astype(np.float64)
        seen = np.asarray(np.isfinite(own).all(axis=1))
        if seen.any():
            points[joint] = own if seen.all() else _filled(own, seen)
    if "neck" in points:
        points = {"lclavicle": points["neck"], "rclavicle": points["neck"]} | points
    return points


def _filled(points: FloatArray, seen: BoolArray) -> FloatArray:
    frames = np.arange(len(points))
    known = np.flatnonzero(seen)
    return np.stack([np.interp(frames, known, points[known, axis]) for axis in range(3)], axis=1)


def _parent(joint: str, points: Mapping[str, FloatArray]) -> str:
    """Return the nearest joint above that is there."""
    parent = PARENT[joint]
    while parent not in points:
        parent = PARENT[parent]
    return parent


def _frame(
    points: Mapping[str, FloatArray], right: str, left: str, upper: Sequence[str]
) -> FloatArray:
    """Return the frame of a pair of joints and a third, shape (T, 3, 3), its axes as columns."""
    middle = (points[left] + points[right]) / 2
    above = next((points[joint] for joint in upper if joint in points), middle + VERTICAL)
    x = _unit(points[left] - points[right])
    y = _across(above - middle, x)
    flat = np.linalg.norm(y, axis=1) < SAME_POINT
    y[flat] = _across(np.broadcast_to(SIDEWAYS, y[flat].shape), x[flat])
    y = _unit(y)
    return np.stack((x, y, np.cross(x, y)), axis=2)


def _across(ways: FloatArray, axes: FloatArray) -> FloatArray:
    """Return what of ways goes across unit vectors."""
    across: FloatArray = ways - (ways * axes).sum(axis=1, keepdims=True) * axes
    return across


def _rest(ways: FloatArray, direction: Sequence[float], frame: FloatArray | None) -> FloatArray:
    """Return the way of a bone in the zero pose: as a frame sees it, or along a direction."""
    offset: FloatArray
    if frame is not None:
        offset = np.median(np.einsum("tji,tj->ti", frame, ways), axis=0)
    else:
        length = np.median(np.linalg.norm(ways, axis=1))
        offset = length * np.array(direction) / np.linalg.norm(direction)
    return offset


def _aimed(
    points: Sequence[FloatArray],
    parents: Sequence[int],
    rest: FloatArray,
    frames: Mapping[int, FloatArray],
) -> list[FloatArray]:
    """Return how each joint is turned, (T, 3, 3), towards the true places of those below."""
    there: list[FloatArray] = []
    turns: list[FloatArray] = []
    turn: FloatArray
    for i, parent in enumerate(parents):
        if parent < 0:
            there.append(points[i])
            turn = np.broadcast_to(np.eye(3), (len(points[i]), 3, 3))
        else:
            there.append(there[parent] + turns[parent] @ rest[i])
            turn = turns[parent]
        turn = frames.get(i, turn)
        below = [n for n, above in enumerate(parents) if above == i]
        aim = max(below, key=lambda n: float(np.linalg.norm(rest[n])), default=None)
        # root and hips are one piece that its frame fits best as a whole
        if parent >= 0 and aim is not None and np.linalg.norm(rest[aim]) > SAME_POINT:
            turn = _swing(turn @ rest[aim], points[aim] - there[i]) @ turn
        turns.append(turn)
    return turns


def _swing(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the smallest rotations that turn vectors (T, 3) into the directions of others."""
    a, b = _unit(before), _unit(after)
    b = np.where(np.linalg.norm(after, axis=1, keepdims=True) > SAME_POINT, b, a)
    axis, cosine = np.cross(a, b), (a * b).sum(axis=1)
    cross = np.zeros((len(a), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]] = axis
    cross[:, [1, 2, 0], [2, 0, 1]] = -axis
    opposite = cosine < -1 + 1e-12
    turn: FloatArray = np.eye(3) + cross
    turn += cross @ cross / (1 + np.where(opposite, 0, cosine))[:, None, None]
    if opposite.any():  # half a turn, about any axis across
        others = np.eye(3)[np.abs(a[opposite]).argmin(axis=1)]
        across = _unit(np.cross(a[opposite], others))
        turn[opposite] = 2 * across[:, :, None] * across[:, None, :] - np.eye(3)
    return turn


def _unit(vectors: FloatArray) -> FloatArray:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: FloatArray = vectors / np.where(lengths > 0, lengths, 1)
    return unit


def _recording(
    rate: float,
    names: Sequence[str],
    parents: Sequence[int],
    rest: FloatArray,
    root: FloatArray,
    turns: Sequence[FloatArray],
) -> Recording:
    leaves = [i for i in range(len(names)) if i not in parents and not names[i].endswith("/End")]
    nodes, kinds, columns = [0, 0, 0], [0, 1, 2], [np.round(root / CENTIMETRE, DECIMALS)]
    for i, name in enumerate(names):
        if not name.endswith("/End"):
            above = turns[parents[i]] if i else np.broadcast_to(np.eye(3), turns[0].shape)
            local = np.einsum("tji,tjk->ikt", above, turns[i])
            angles = np.rad2deg(channel_angles(local, ORDER).T)
            columns.append(np.deg2rad(np.round(angles, DECIMALS)))
            nodes += [i] * 3
            kinds += [axis + 3 for axis in ORDER]
    offsets = np.round(rest / CENTIMETRE, DECIMALS) + 0.0  # no -0
    skeleton = Skeleton(
        names=(*names, *(f"{names[i]}/End" for i in leaves)),
        parents=np.array([*parents, *leaves], np.int64),
        offsets=np.concatenate((offsets, np.zeros((len(leaves), 3)))),
        turned_by="parent",
    )
    values = np.concatenate(columns, axis=1)
    return Recording(skeleton, np.array(nodes), np.array(kinds), values, rate, CENTIMETRE)
