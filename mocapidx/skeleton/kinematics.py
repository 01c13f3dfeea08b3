"""Forward kinematics: from channels over time to the points of the skeleton's nodes.

Everything is laid out with time last and runs over short blocks of frames, so that all that
one block needs stays in the processor's cache.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal

import numpy as np

from mocapidx.kernels.choice import compiled
from mocapidx.model import FloatArray, IndexArray, Recording, Skeleton
from mocapidx.skeleton.rotations import multiplied, times_vector, turned

__all__ = ["RootPositions", "node_positions", "zero_pose"]

RootPositions = Literal["add", "replace"]

BLOCK: Final = 1024  # frames
NOT, OWN, CHANGED = range(3)  # a node needs no matrix, has one, or one after a change of axes


def node_positions(
    recording: Recording,
    nodes: Sequence[int],
    positions: RootPositions = "add",
    frames: slice | IndexArray = slice(None),
) -> FloatArray:
    """Compute where nodes are, in the units and axes of the file.

    Parameters
    ----------
    recording : Recording
        The skeleton and its channels.
    nodes : sequence of int
        The nodes wanted, K of them; only these and their ancestors are computed. -1 is a node
        that is not there: NaN.
    positions : {"add", "replace"}
        Whether a node's position channels add to its offset or replace it.
    frames : slice or ndarray of int
        The frames wanted, T of them; by default all.

    Returns
    -------
    ndarray of float64, shape (T, K, 3)
        In file units.
    """
    plan = _plan_for(recording, tuple(nodes), positions)
    kernel = compiled("kinematics")
    values = recording.values[frames]
    result = np.full((len(values), len(nodes), 3), np.nan)
    for begin in range(0, len(values), BLOCK):
        block = values[begin : begin + BLOCK]
        angles = np.ascontiguousarray(block[:, plan.rotations].T)
        turns = np.cos(angles), np.sin(angles)
        moved = _moved(plan, block)
        found = result[begin : begin + BLOCK]
        if kernel is not None:
            kernel.place_nodes(*plan.arrays, *turns, moved, plan.wanted, found)
        else:
            points = _points(plan, *turns, moved)
            for k, n in enumerate(plan.wanted.tolist()):
                if n >= 0:
                    found[:, k] = points[n].T
    return result


def zero_pose(skeleton: Skeleton) -> FloatArray:
    """Return the points of all nodes with all channels 0 and the root at the origin.

    Parameters
    ----------
    skeleton : Skeleton
        The skeleton.

    Returns
    -------
    ndarray of float64, shape (N, 3)
        In file units.
    """
    points = skeleton.offsets.copy()
    points[0] = 0
    for node, parent in enumerate(skeleton.parents[1:], start=1):
        points[node] += points[parent]
    return points


@dataclass(frozen=True, slots=True)
class _Plan:
    """What is to be done for each of the N nodes needed, parents first.

    The rotation of a node is C M C' with C its own constant frame. What is kept is the product
    up to M, so that C' of a node and C of its child are one constant factor, the change.

    Parameters
    ----------
    nodes : ndarray of int64, shape (N, 4)
        The parent; the node whose matrix turns the offset; `NOT`, `OWN` or `CHANGED`; the row
        of `moves`. -1: none.
    changes : ndarray of float64, shape (N, 3, 3)
    offsets : ndarray of float64, shape (N, 3)
        In the frame of the node that turns them.
    bounds : ndarray of int64, shape (N + 1,)
        Node ``n`` has the rotations ``bounds[n]`` up to ``bounds[n + 1]``.
    axes : ndarray of int64, shape (R,)
        Of each rotation: 0, 1, 2.
    rotations : list of int
        The column of each rotation.
    moves : list of (offset, undo, channels)
        Of each offset that position channels move: what it is without them, the frame of the
        node that turns it (None: identity), and axis and column of each channel.
    wanted : ndarray of int64, shape (K,)
    """

    nodes: IndexArray
    changes: FloatArray
    offsets: FloatArray
    bounds: IndexArray
    axes: IndexArray
    rotations: list[int]
    moves: list[tuple[FloatArray, FloatArray | None, list[tuple[int, int]]]]
    wanted: IndexArray

    @property
    def arrays(self) -> tuple[FloatArray | IndexArray, ...]:
        """What the kernel wants to know first."""
        return self.nodes, self.changes, self.offsets, self.bounds, self.axes


def _plan_for(recording: Recording, nodes: tuple[int, ...], positions: RootPositions) -> _Plan:
    """Return the plan of a recording; those of one skeleton have it in common."""
    skeleton = recording.skeleton
    return _plan(
        skeleton.turned_by == "own",
        skeleton.parents.tobytes(),
        skeleton.offsets.tobytes(),
        None if skeleton.axes is None else skeleton.axes.tobytes(),
        tuple(recording.channel_nodes.tolist()),
        tuple(recording.channel_kinds.tolist()),
        nodes,
        positions,
    )


@lru_cache(maxsize=16)
def _plan(
    by_own: bool,
    parent_bytes: bytes,
    offset_bytes: bytes,
    axis_bytes: bytes | None,
    channel_nodes: tuple[int, ...],
    channel_kinds: tuple[int, ...],
    wanted: tuple[int, ...],
    positions: RootPositions,
) -> _Plan:
    parents = np.frombuffer(parent_bytes, dtype=np.int64).tolist()
    all_offsets = np.frombuffer(offset_bytes).reshape(-1, 3)
    axes = None if axis_bytes is None else np.frombuffer(axis_bytes).reshape(-1, 3, 3)
    needed = _with_ancestors(parents, wanted)
    number = {-1: -1} | {node: n for n, node in enumerate(needed)}
    turning = set(needed if by_own else [parents[node] for node in needed])
    channels = _channels_of(channel_nodes, channel_kinds)
    frames = np.broadcast_to(np.eye(3), (len(parents) + 1, 3, 3)) if axes is None else axes
    nodes = np.full((len(needed), 4), -1, dtype=np.int64)
    changes = np.zeros((len(needed), 3, 3))
    offsets = np.zeros((len(needed), 3))
    bounds, turns = [0], []
    moves: list[tuple[FloatArray, FloatArray | None, list[tuple[int, int]]]] = []
    for n, node in enumerate(needed):
        parent, own = parents[node], channels.get(node, [])
        nodes[n, :3] = number[parent], -1, NOT
        if node in turning:
            changes[n] = frames[node] if parent < 0 else frames[parent].T @ frames[node]
            nodes[n, 2] = OWN if np.array_equal(changes[n], np.eye(3)) else CHANGED
            turns += [(kind - 3, column) for column, kind in own if kind >= 3]
        bounds.append(len(turns))
        turner = node if by_own and parent >= 0 else parent
        nodes[n, 1] = number[turner]
        undo = None if axes is None or turner < 0 else axes[turner].T
        offset = all_offsets[node].copy()
        moved = [(kind, column) for column, kind in own if kind < 3]
        if moved:
            if positions == "replace":
                offset[[kind for kind, _ in moved]] = 0.0
            nodes[n, 3] = len(moves)
            moves.append((offset, undo, moved))
        else:
            offsets[n] = offset if undo is None else undo @ offset
    return _Plan(
        nodes,
        changes,
        offsets,
        np.array(bounds, dtype=np.int64),
        np.array([axis for axis, _ in turns], dtype=np.int64),
        [column for _, column in turns],
        moves,
        np.array([number.get(node, -1) if node >= 0 else -1 for node in wanted], dtype=np.int64),
    )


def _moved(plan: _Plan, values: FloatArray) -> FloatArray:
    """Return the offsets that position channels move, shape (M, 3, T), for values (T, C)."""
    moved = np.empty((len(plan.moves), 3, len(values)))
    for row, (offset, undo, channels) in zip(moved, plan.moves, strict=True):
        row[:] = offset[:, None]
        for kind, column in channels:
            row[kind] += values[:, column]
        if undo is not None:
            row[:] = times_vector(undo[:, :, None], row)
    return moved


def _points(
    plan: _Plan, cosines: FloatArray, sines: FloatArray, moved: FloatArray
) -> list[FloatArray]:
    """Return the points (3, T) of all nodes needed."""
    frames = moved.shape[2]
    points: list[FloatArray] = []
    turns: dict[int, FloatArray] = {-1: np.broadcast_to(np.eye(3)[:, :, None], (3, 3, frames))}
    for n, (parent, turner, turning, move) in enumerate(plan.nodes.tolist()):
        if turning != NOT:
            turn, own = turns[parent], False  # the parent's must stay as it is
            if turning == CHANGED:
                turn, own = multiplied(turn, plan.changes[n]), True
            for r in range(plan.bounds[n], plan.bounds[n + 1]):
                turn = turned(turn, int(plan.axes[r]), cosines[r], sines[r], in_place=own)
                own = True
            turns[n] = turn
        offset = moved[move] if move >= 0 else plan.offsets[n]
        if turner >= 0:
            offset = times_vector(turns[turner], offset)
        base = points[parent] if parent >= 0 else np.zeros((3, frames))
        points.append(base + (offset if offset.ndim == 2 else offset[:, None]))
    return points


def _with_ancestors(parents: list[int], nodes: tuple[int, ...]) -> list[int]:
    """Return nodes and all that they hang on, parents first."""
    needed: set[int] = set()
    for node in nodes:
        while node >= 0 and node not in needed:
            needed.add(node)
            node = parents[node]
    return sorted(needed)


def _channels_of(
    nodes: tuple[int, ...], kinds: tuple[int, ...]
) -> dict[int, list[tuple[int, int]]]:
    """Return column and kind of the channels of each node, in their order."""
    channels: dict[int, list[tuple[int, int]]] = {}
    for column, (node, kind) in enumerate(zip(nodes, kinds, strict=True)):
        channels.setdefault(node, []).append((column, kind))
    return channels
