"""Bodies and their movement: joint rotations and the root's path, and the points they lead to."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from mocapidx.model import FloatArray, Recording, Skeleton
from mocapidx.skeleton.canonical import completed_positions
from mocapidx.skeleton.jointmap import Mapping24
from mocapidx.skeleton.joints import INDEX
from mocapidx.skeleton.kinematics import RootPositions
from mocapidx.skeleton.rotations import Up, multiplied, turned, upright
from mocapidx.synthesis.quaternions import continuous, from_matrices, to_matrices

__all__ = [
    "Body",
    "Movement",
    "body_of",
    "joint_points",
    "movement_of",
    "nodes_needed",
]

LEGS: Final = (("lhip", "lknee"), ("lknee", "lankle"), ("rhip", "rknee"), ("rknee", "rankle"))


@dataclass(frozen=True)
class Body:
    """A body: a skeleton in metres whose bones keep their lengths.

    Parameters
    ----------
    skeleton : Skeleton
        In metres, without frames of its own for rotations.
    mapping : Mapping24
        Which node is which canonical joint.
    """

    skeleton: Skeleton
    mapping: Mapping24

    @cached_property
    def leg(self) -> float:
        """Length from hip over knee to ankle in metres, both sides averaged."""
        skeleton = self.skeleton
        still = np.zeros((1, len(skeleton.names), 4))
        still[..., 0] = 1
        points = joint_points(self, Movement(1.0, still, np.zeros((1, 3))))[0]
        lengths = [np.linalg.norm(points[INDEX[a]] - points[INDEX[b]]) for a, b in LEGS]
        return float(np.sum(lengths)) / 2


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """How a body moves.

    Parameters
    ----------
    rate : float
        Frames a second, in Hz.
    turns : ndarray of float64, shape (T, N, 4)
        The rotation of each node against its parent, quaternions that change sign nowhere.
    places : ndarray of float64, shape (T, 3)
        Where the root is, in metres, Y up.
    """

    rate: float
    turns: FloatArray
    places: FloatArray


def body_of(
    recording: Recording, mapping: Mapping24, unit: float, positions: RootPositions
) -> Body:
    """Give the body of a recording.

    Parameters
    ----------
    recording : Recording
    mapping : Mapping24
        Which node is which canonical joint.
    unit : float
        Metres in one unit of the file.
    positions : {"add", "replace"}
        Whether position channels add to a node's offset or replace it.

    Returns
    -------
    Body
        Where nodes below the root have position channels, their bones have the lengths that
        are the median over the recording.
    """
    skeleton = recording.skeleton
    offsets = skeleton.offsets.copy()
    for column in np.flatnonzero(recording.channel_kinds < 3).tolist():
        node, kind = int(recording.channel_nodes[column]), int(recording.channel_kinds[column])
        middle = float(np.median(recording.values[:, column]))
        offsets[node, kind] = middle + (offsets[node, kind] if positions == "add" else 0.0)
    offsets[0] = 0.0
    return Body(replace(skeleton, offsets=offsets * unit, axes=None), mapping)


def movement_of(
    recording: Recording, mapping: Mapping24, unit: float, up: Up, positions: RootPositions,
    frames: slice, rate: float,
) -> Movement:  # fmt: skip
    """Take rotations and the root's path from a recording.

    Where the pelvis hangs on other nodes (a point on the ground, say), the topmost of them
    carries all its movement: a long lever would make averages of it meaningless.

    Parameters
    ----------
    recording : Recording
    mapping : Mapping24
    unit : float
        Metres in one unit of the file.
    up : {"x", "y", "z", "-x", "-y", "-z"}
        The axis of the file that points up.
    positions : {"add", "replace"}
    frames : slice
        The frames wanted.
    rate : float
        In Hz.

    Returns
    -------
    Movement
        Of the body that `body_of` gives.
    """
    skeleton = recording.skeleton
    values = np.ascontiguousarray(recording.values[frames].T)
    local = [_local_turns(recording, node, values) for node in range(len(skeleton.names))]
    pelvis = max(mapping.nodes[INDEX["root"]], 0)
    chain = _way_down(skeleton, pelvis)
    world = upright(up)
    turn = np.repeat(world[:, :, None], values.shape[1], axis=2)
    place = np.zeros((3, values.shape[1]))
    for node in chain:
        offset = _moving_offset(recording, node, positions, values)
        own = skeleton.turned_by == "own" and node > 0
        after = _matrix_product(turn, local[node])
        place += np.einsum("ijt,jt->it", after if own else turn, offset)
        turn = after
    body = body_of(recording, mapping, 1.0, positions)
    below = np.sum(body.skeleton.offsets[chain], axis=0)
    place -= np.einsum("ijt,j->it", turn, below)
    for node in chain:
        local[node] = turn if node == 0 else np.repeat(np.eye(3)[:, :, None], turn.shape[2], axis=2)
    matrices = np.moveaxis(np.array(local), 3, 0)
    return Movement(rate, continuous(from_matrices(matrices)), place.T * unit)


def _local_turns(recording: Recording, node: int, values: FloatArray) -> FloatArray:
    """Return the rotation of a node against its parent, (3, 3, T)."""
    turn: FloatArray = np.repeat(np.eye(3)[:, :, None], values.shape[1], axis=2)
    moved = False
    for column in np.flatnonzero(recording.channel_nodes == node).tolist():
        kind = int(recording.channel_kinds[column])
        if kind >= 3:
            angles = values[column]
            turn, moved = (
                turned(turn, kind - 3, np.cos(angles), np.sin(angles), in_place=True),
                True,
            )
    axes = recording.skeleton.axes
    if moved and axes is not None:
        turn = np.einsum("ij,jkt->ikt", axes[node], multiplied(turn, axes[node].T))
    return turn


def _moving_offset(
    recording: Recording, node: int, positions: RootPositions, values: FloatArray
) -> FloatArray:
    offset = np.repeat(recording.skeleton.offsets[node][:, None], values.shape[1], axis=1)
    for column in np.flatnonzero(recording.channel_nodes == node).tolist():
        kind = int(recording.channel_kinds[column])
        if kind < 3:
            fixed = recording.skeleton.offsets[node, kind] if positions == "add" else 0.0
            offset[kind] = values[column] + fixed
    return offset


def _way_down(skeleton: Skeleton, node: int) -> list[int]:
    """List a node and those above it, from the root on."""
    way = [node]
    while skeleton.parents[way[-1]] >= 0:
        way.append(int(skeleton.parents[way[-1]]))
    return way[::-1]


def _matrix_product(first: FloatArray, second: FloatArray) -> FloatArray:
    matrices: FloatArray = np.einsum("ijt,jkt->ikt", first, second)
    return matrices


def joint_points(
    body: Body, movement: Movement, joints: tuple[str, ...] | None = None
) -> FloatArray:
    """Compute where the canonical joints are.

    Parameters
    ----------
    body : Body
    movement : Movement
        Of this body.
    joints : tuple of str, optional
        Only these are needed.

    Returns
    -------
    ndarray of float64, shape (T, 24, 3)
        In metres, Y up; NaN where the body lacks a joint, and for joints that are not needed.
    """
    nodes = body.mapping.nodes
    if joints is not None and nodes_needed(body, joints) is None:
        joints = None
    wanted = [nodes[INDEX[j]] for j in joints] if joints else [n for n in nodes if n >= 0]
    points = _node_points(body.skeleton, movement, wanted)
    result = np.full((len(movement.places), len(nodes), 3), np.nan)
    for joint, node in enumerate(nodes):
        if node in points:
            result[:, joint] = points[node]
    return result if joints is not None else completed_positions(result, body.mapping)


def nodes_needed(body: Body, joints: tuple[str, ...]) -> list[int] | None:
    """List the nodes whose rotations say where joints are.

    Parameters
    ----------
    body : Body
    joints : tuple of str
        Canonical names.

    Returns
    -------
    list of int or None
        In increasing order, the root first; None where a joint is made up from others, so that
        all are needed.
    """
    nodes = [body.mapping.nodes[INDEX[joint]] for joint in joints]
    return None if min(nodes, default=0) < 0 else _with_those_above(body.skeleton, [0, *nodes])


def _with_those_above(skeleton: Skeleton, nodes: list[int]) -> list[int]:
    return sorted({above for node in nodes for above in _way_down(skeleton, node)})


def _node_points(
    skeleton: Skeleton, movement: Movement, wanted: list[int]
) -> dict[int, FloatArray]:
    needed = _with_those_above(skeleton, [0, *wanted])
    matrices = to_matrices(movement.turns[:, needed])
    turns: dict[int, FloatArray] = {0: matrices[:, 0]}
    points: dict[int, FloatArray] = {0: movement.places}
    for column, node in enumerate(needed[1:], start=1):
        parent = int(skeleton.parents[node])
        turns[node] = turns[parent] @ matrices[:, column]
        turner = node if skeleton.turned_by == "own" else parent
        points[node] = points[parent] + turns[turner] @ skeleton.offsets[node]
    return points
