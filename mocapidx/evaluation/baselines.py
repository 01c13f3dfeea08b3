"""The simpler methods that motion templates are held against.

Each takes one example of a class and searches the motion itself, by subsequence dynamic time
warping with a local distance between poses: relational features (RF), joint rotations as unit
quaternions (Q), relative positions (3D).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray, IndexArray
from mocapidx.skeleton.joints import INDEX, PARENTS

__all__ = [
    "dense_match",
    "feature_costs",
    "joint_quaternions",
    "position_costs",
    "quaternion_costs",
    "relative_positions",
]

LEFT, UP, FORWARD = np.eye(3)
SWINGS: Final = (
    # body part, from joint, to joint, direction at rest, in the frame of
    ("head", "neck", "head", UP, "chest"),
    ("lupper", "lshoulder", "lelbow", LEFT, "chest"),
    ("llower", "lelbow", "lwrist", LEFT, "lupper"),
    ("lhand", "lwrist", "lfingers", LEFT, "llower"),
    ("rupper", "rshoulder", "relbow", -LEFT, "chest"),
    ("rlower", "relbow", "rwrist", -LEFT, "rupper"),
    ("rhand", "rwrist", "rfingers", -LEFT, "rlower"),
    ("lthigh", "lhip", "lknee", -UP, "pelvis"),
    ("lshank", "lknee", "lankle", -UP, "lthigh"),
    ("lfoot", "lankle", "ltoes", FORWARD, "lshank"),
    ("rthigh", "rhip", "rknee", -UP, "pelvis"),
    ("rshank", "rknee", "rankle", -UP, "rthigh"),
    ("rfoot", "rankle", "rtoes", FORWARD, "rshank"),
)
SHORTEST: Final = 1e-9


def relative_positions(poses: FloatArray) -> FloatArray:
    """Remove place, heading and size from poses.

    The root is the origin, the hips lie along x seen from above, and the mean length of the
    bones over all frames is 1.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        Canonical joints, in metres, Y up; NaN where a rig lacks a joint.

    Returns
    -------
    ndarray of float64, shape (T, 24, 3)
    """
    relative = poses.astype(np.float64) - poses[:, :1]
    bones = relative[:, 1:] - relative[:, PARENTS[1:]]
    lengths = np.linalg.norm(bones, axis=2)
    lengths = lengths[np.isfinite(lengths)]
    size = max(lengths.mean(), SHORTEST) if len(lengths) else 1.0
    positions: FloatArray = np.einsum("tij,tnj->tni", _heading(relative), relative) / size
    return positions


def _heading(poses: FloatArray) -> FloatArray:
    """Rows left, up and forward of a body seen from above, shape (T, 3, 3)."""
    across = poses[:, INDEX["lhip"]] - poses[:, INDEX["rhip"]]
    left = _unit(across * (1.0 - UP), LEFT)
    forward = np.cross(left, UP)
    return np.stack((left, np.broadcast_to(UP, left.shape), forward), axis=1)


def _unit(vectors: FloatArray, otherwise: FloatArray) -> FloatArray:
    """Vectors of length 1; one that has no length becomes another."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length < SHORTEST, otherwise, vectors / np.maximum(length, SHORTEST))


def joint_quaternions(poses: FloatArray) -> FloatArray:
    """Derive rotations of 15 body parts from positions, as unit quaternions.

    Pelvis and chest have three points each, so their rotations are whole: the pelvis against
    the heading, the chest against the pelvis. Of the other parts positions tell the direction
    only: theirs is the shortest rotation from straight, in the frame of the part before, so
    that turning about a bone's own axis is left out.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        Canonical joints, in metres, Y up; NaN where a rig lacks a joint.

    Returns
    -------
    ndarray of float64, shape (T, 15, 4)
        Real part first; NaN where a part needs a joint that is lacking.
    """
    poses = poses.astype(np.float64)
    heading = _heading(poses)
    frames = {
        "pelvis": _body_frame(poses, "rhip", "lhip", "root", "chest"),
        "chest": _body_frame(poses, "rshoulder", "lshoulder", "chest", "neck"),
    }
    quaternions = [
        _matrix_quaternions(np.einsum("tij,tkj->tik", heading, frames["pelvis"])),
        _matrix_quaternions(np.einsum("tij,tkj->tik", frames["pelvis"], frames["chest"])),
    ]
    for part, start, end, rest, before in SWINGS:
        bone = poses[:, INDEX[end]] - poses[:, INDEX[start]]
        direction = _unit(np.einsum("tij,tj->ti", frames[before], bone), rest)
        swing = _swing(rest, direction)
        # Rows of a frame are its axes: turn them by the rotation within the frame before.
        frames[part] = np.einsum("tji,tjk->tik", _rotation_matrices(swing), frames[before])
        quaternions.append(swing)
    return np.stack(quaternions, axis=1)


def _body_frame(poses: FloatArray, right: str, left: str, low: str, high: str) -> FloatArray:
    """Rows left, up and forward of a body part, shape (T, 3, 3); up is exact."""
    up = _unit(poses[:, INDEX[high]] - poses[:, INDEX[low]], UP)
    across = poses[:, INDEX[left]] - poses[:, INDEX[right]]
    side = _unit(across - (across * up).sum(axis=1, keepdims=True) * up, LEFT)
    return np.stack((side, up, np.cross(side, up)), axis=1)


def _swing(rest: FloatArray, directions: FloatArray) -> FloatArray:
    """Quaternions of the shortest rotations from one direction to others."""
    quaternions: FloatArray = np.empty((len(directions), 4))
    quaternions[:, 0] = 1.0 + directions @ rest
    quaternions[:, 1:] = np.cross(rest, directions)
    half_turn = np.concatenate(([0.0], np.roll(rest, 1)))  # any axis at right angles will do
    return _unit(quaternions, half_turn)


def _rotation_matrices(quaternions: FloatArray) -> FloatArray:
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _matrix_quaternions(matrices: FloatArray) -> FloatArray:
    """Quaternions of rotation matrices, up to their sign."""
    xx, yy, zz = (matrices[:, i, i] for i in range(3))
    # The largest of the four squares is at least 1/4: divide by that component.
    squares = np.stack((1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz))
    m = matrices
    products = np.array(
        [
            [squares[0], m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]],
            [m[:, 2, 1] - m[:, 1, 2], squares[1], m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0]],
            [m[:, 0, 2] - m[:, 2, 0], m[:, 0, 1] + m[:, 1, 0], squares[2], m[:, 1, 2] + m[:, 2, 1]],
            [m[:, 1, 0] - m[:, 0, 1], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1], squares[3]],
        ]
    )
    largest = squares.argmax(axis=0)
    rows = products[largest, :, np.arange(len(matrices))]
    return _unit(rows, np.array([1.0, 0.0, 0.0, 0.0]))


def feature_costs(query: BoolArray, features: BoolArray) -> FloatArray:
    """Share of the features that differ: the Manhattan distance, divided by their number.

    Parameters
    ----------
    query : ndarray of bool, shape (K, F)
    features : ndarray of bool, shape (L, F)

    Returns
    -------
    ndarray of float64, shape (K, L)
    """
    one, other = query.astype(np.float64), features.astype(np.float64)
    counts = one.sum(axis=1)[:, None] + other.sum(axis=1)[None, :]
    differing: FloatArray = (counts - 2 * one @ other.T) / query.shape[1]
    return differing


def quaternion_costs(query: FloatArray, quaternions: FloatArray) -> FloatArray:
    """Mean spherical distance of the rotations, as a part of the largest, from 0 to 1.

    Parameters
    ----------
    query : ndarray of float, shape (K, J, 4)
    quaternions : ndarray of float, shape (L, J, 4)
        Opposite quaternions are the same rotation; parts with NaN are left out.

    Returns
    -------
    ndarray of float64, shape (K, L)
    """
    total = np.zeros((len(query), len(quaternions)))
    count = np.zeros_like(total)
    for part in range(query.shape[1]):
        cosines = np.abs(query[:, part] @ quaternions[:, part].T)
        known = np.isfinite(cosines)
        total += np.where(known, np.arccos(np.clip(cosines, 0.0, 1.0)), 0.0)
        count += known
    return total / np.maximum(count, 1) * 2 / np.pi


def position_costs(query: FloatArray, positions: FloatArray) -> FloatArray:
    """Root mean square over the joints of the Euclidean distance.

    Parameters
    ----------
    query : ndarray of float, shape (K, 24, 3)
    positions : ndarray of float, shape (L, 24, 3)
        As from `relative_positions`; joints with NaN are left out.

    Returns
    -------
    ndarray of float64, shape (K, L)
    """
    total = np.zeros((len(query), len(positions)))
    count = np.zeros_like(total)
    for joint in range(query.shape[1]):
        squares = (
            (query[:, joint] ** 2).sum(axis=1)[:, None]
            + (positions[:, joint] ** 2).sum(axis=1)[None, :]
            - 2 * query[:, joint] @ positions[:, joint].T
        )
        known = np.isfinite(squares)
        total += np.where(known, np.maximum(squares, 0.0), 0.0)
        count += known
    return np.sqrt(total / np.maximum(count, 1))


def dense_match(
    costs: FloatArray, breaks: IndexArray | None = None
) -> tuple[NDArray[np.float32], IndexArray]:
    """Match a query with all there is, given the local costs: the weighted steps of templates.

    Parameters
    ----------
    costs : ndarray of float, shape (K, L)
        Not negative.
    breaks : ndarray of int64, optional
        Frames that no match touches; two in a row keep documents apart.

    Returns
    -------
    distances : ndarray of float32, shape (L,)
        Cost of the best match that ends at a frame, divided by K; infinite where none can.
    starts : ndarray of int64, shape (L,)
        Its first frame; -1 where there is none.

    Raises
    ------
    ParameterError
        If the query is empty.
    """
    if not len(costs):
        raise ParameterError("the query has no frames")
    costs = costs.astype(np.float64)
    if breaks is not None:
        costs[:, breaks] = np.inf
    length = costs.shape[1]
    rows = np.full((3, length + 2), np.inf)  # two infinite frames stand before the first
    origins = np.full((3, length + 2), -1, dtype=np.int64)
    rows[0, 2:], origins[0, 2:] = costs[0], np.arange(length)
    for k in range(1, len(costs)):
        here, above, skipped = (row % 3 for row in (k, k - 1, k - 2))
        candidates = np.stack((rows[above, 1:-1], rows[above, :-2], rows[skipped, 1:-1] + costs[k]))
        if k == 1:
            candidates[2] = np.inf
        choice = candidates.argmin(axis=0)
        sources = np.stack((origins[above, 1:-1], origins[above, :-2], origins[skipped, 1:-1]))
        frames = np.arange(length)
        rows[here, 2:] = candidates[choice, frames] + costs[k]
        origins[here, 2:] = sources[choice, frames]
    last = (len(costs) - 1) % 3
    distances = rows[last, 2:] / len(costs)
    starts = np.where(np.isfinite(distances), origins[last, 2:], -1)
    return distances.astype(np.float32), starts
