"""Forward kinematics: from channels over time to the points of the skeleton's nodes.

Everything is laid out with time last and runs over short blocks of frames, so that all that
one block needs stays in the processor's cache.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Literal

import numpy as np

from mocapidx.model import FloatArray, IndexArray, Recording, Skeleton
from mocapidx.skeleton.rotations import multiplied, times_vector, turned

__all__ = ["RootPositions", "node_positions", "zero_pose"]

RootPositions = Literal["add", "replace"]

BLOCK: Final = 1024  # frames


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
    needed = _with_ancestors(recording.skeleton, nodes)
    channels = np.isin(recording.channel_nodes, needed)
    part = replace(
        recording,
        channel_nodes=recording.channel_nodes[channels],
        channel_kinds=recording.channel_kinds[channels],
    )
    values = recording.values[frames]
    result = np.full((len(values), len(nodes), 3), np.nan)
    for begin in range(0, len(values), BLOCK):
        block = np.ascontiguousarray(values[begin : begin + BLOCK, channels].T)
        points = _points(part, needed, positions, block)
        for k, node in enumerate(nodes):
            if node >= 0:
                result[begin : begin + BLOCK, k] = points[node].T
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


def _points(
    recording: Recording, needed: list[int], positions: RootPositions, values: FloatArray
) -> dict[int, FloatArray]:
    """Return the points (3, T) of nodes, parents first, for one block of channels (C, T).

    The rotation of a node is C M C' with C its own constant frame. What is kept is the product
    up to M, so that C' of a node and C of its child are one constant factor.
    """
    skeleton = recording.skeleton
    by_own = skeleton.turned_by == "own"
    turning = set(needed if by_own else skeleton.parents[needed].tolist())
    channels = _channels_of(recording, needed)
    rotations = recording.channel_kinds >= 3
    cosines, sines = np.empty_like(values), np.empty_like(values)
    cosines[rotations], sines[rotations] = np.cos(values[rotations]), np.sin(values[rotations])
    points: dict[int, FloatArray] = {-1: np.zeros((3, values.shape[1]))}
    turns: dict[int, FloatArray] = {
        -1: np.broadcast_to(np.eye(3)[:, :, None], (3, 3, values.shape[1]))
    }
    undo: dict[int, FloatArray] = {-1: np.eye(3)}
    for node in needed:
        parent = int(skeleton.parents[node])
        if node in turning:
            frame: FloatArray = np.eye(3) if skeleton.axes is None else skeleton.axes[node]
            change = undo[parent] @ frame
            turn, own = turns[parent], False  # the parent's must stay as it is
            if not np.array_equal(change, np.eye(3)):
                turn, own = multiplied(turn, change), True
            for channel, kind in channels[node]:
                if kind >= 3:
                    by = cosines[channel], sines[channel]
                    turn, own = turned(turn, kind - 3, *by, in_place=own), True
            turns[node] = turn
            undo[node] = frame.T
        offset = _offset(skeleton.offsets[node], channels[node], positions, values)
        turner = node if by_own and parent >= 0 else parent
        if turner >= 0:
            offset = times_vector(turns[turner], undo[turner] @ offset)
        points[node] = points[parent] + (offset if offset.ndim == 2 else offset[:, None])
    return points


def _with_ancestors(skeleton: Skeleton, nodes: Sequence[int]) -> list[int]:
    """Return nodes and all that they hang on, parents first."""
    needed: set[int] = set()
    for node in nodes:
        while node >= 0 and node not in needed:
            needed.add(node)
            node = int(skeleton.parents[node])
    return sorted(needed)


def _channels_of(recording: Recording, nodes: list[int]) -> dict[int, list[tuple[int, int]]]:
    """Return column and kind of the channels of each node, in their order."""
    channels: dict[int, list[tuple[int, int]]] = {node: [] for node in nodes}
    for column, (node, kind) in enumerate(
        zip(recording.channel_nodes.tolist(), recording.channel_kinds.tolist(), strict=True)
    ):
        if node in channels:
            channels[node].append((column, kind))
    return channels


def _offset(
    offset: FloatArray,
    channels: list[tuple[int, int]],
    positions: RootPositions,
    values: FloatArray,
) -> FloatArray:
    """Return a node's offset (3,), or (3, T) where position channels move it."""
    moves = [(column, kind) for column, kind in channels if kind < 3]
    if not moves:
        return offset
    moved = np.repeat(offset[:, None], values.shape[1], axis=1)
    for column, kind in moves:
        moved[kind] = values[column] + (offset[kind] if positions == "add" else 0.0)
    return moved
