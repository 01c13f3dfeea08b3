"""Movement carried over from one body to another: bones point where they pointed."""

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import FloatArray, Skeleton
from mocapidx.printable import shown
from mocapidx.synthesis.bodies import Body, Movement
from mocapidx.synthesis.quaternions import continuous, from_matrices, product

__all__ = ["body_difference", "carried"]


def body_difference(body: Body, other: Body) -> str | None:
    """Tell why movement of one body can't be given to another.

    Parameters
    ----------
    body, other : Body

    Returns
    -------
    str or None
        What is different about `other`'s hierarchy; None where it is the same.
    """
    one, two = body.skeleton, other.skeleton
    if one.turned_by != two.turned_by:
        return "one has the bones of an ASF, the other the joints of a BVH"
    if one.names != two.names:
        extra = [name for name in two.names if name not in one.names]
        lacks = [name for name in one.names if name not in two.names]
        if extra:
            return f"it has a joint '{shown(extra[0], 40)}' that the first lacks"
        if lacks:
            return f"it lacks the joint '{shown(lacks[0], 40)}'"
        return "its joints stand in another order"
    hung = np.flatnonzero(one.parents != two.parents)
    if len(hung):
        return f"its joint '{shown(one.names[hung[0]], 40)}' hangs on another one"
    return None


def carried(movement: Movement, body: Body, target: Body) -> Movement:
    """Give the movement of one body to another with the same hierarchy.

    Each bone points where it pointed before, whatever the zero pose of the other body is; the
    root's path is scaled by the length of the legs, so that steps fit.

    Parameters
    ----------
    movement : Movement
        Of `body`.
    body, target : Body

    Returns
    -------
    Movement
        Of `target`.

    Raises
    ------
    ParameterError
        If their hierarchies differ.
    """
    difference = body_difference(target, body)
    if difference is not None:
        raise ParameterError(difference)
    fixes = from_matrices(_changes_of_direction(target.skeleton, body.skeleton))
    undo = fixes * np.array([1.0, -1.0, -1.0, -1.0])
    above = undo[target.skeleton.parents]
    above[0] = (1.0, 0.0, 0.0, 0.0)
    turns = product(product(above, movement.turns), fixes)
    scale = target.leg / body.leg if body.leg > 0 and target.leg > 0 else 1.0
    return Movement(movement.rate, continuous(turns), movement.places * scale)


def _changes_of_direction(target: Skeleton, source: Skeleton) -> FloatArray:
    """Return for each node the least rotation from the target's bones to the source's, (N, 3, 3).

    Of several bones that one node turns, it is the rotation that fits best.
    """
    changes = np.repeat(np.eye(3)[None], len(target.names), axis=0)
    for node in range(len(target.names)):
        own = target.turned_by == "own"
        bones = [node] if own and node else np.flatnonzero(target.parents == node).tolist()
        if own and node == 0:
            continue
        one, two = (_directions(s.offsets[bones]) for s in (target, source))
        there = (np.abs(one).sum(axis=1) > 0) & (np.abs(two).sum(axis=1) > 0)
        if there.sum() == 1:
            changes[node] = _least_turn(one[there][0], two[there][0])
        elif there.sum() > 1:
            changes[node] = _best_turn(one[there], two[there])
    return changes


def _directions(offsets: FloatArray) -> FloatArray:
    lengths = np.linalg.norm(offsets, axis=1, keepdims=True)
    directions: FloatArray = np.where(lengths > 1e-6, offsets / np.maximum(lengths, 1e-6), 0.0)
    return directions


def _least_turn(one: FloatArray, two: FloatArray) -> FloatArray:
    """Return the rotation about the axis square to both directions."""
    cosine = float(one @ two)
    if cosine < -1 + 1e-9:  # opposite: half a turn about any square axis
        square = np.cross(one, np.eye(3)[int(np.argmin(np.abs(one)))])
        square /= np.linalg.norm(square)
        half: FloatArray = 2 * np.outer(square, square) - np.eye(3)
        return half
    x, y, z = np.cross(one, two)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: FloatArray = np.eye(3) + cross + cross @ cross / (1 + cosine)
    return turn


def _best_turn(one: FloatArray, two: FloatArray) -> FloatArray:
    """Return the rotation that takes directions to others with least squares (Kabsch)."""
    left, sizes, right = np.linalg.svd(two.T @ one)
    if sizes[1] < 1e-6:  # all along one line
        return _least_turn(one[0], two[0])
    sign = np.sign(np.linalg.det(left @ right))
    turn: FloatArray = left @ np.diag([1.0, 1.0, sign]) @ right
    return turn
