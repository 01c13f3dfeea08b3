"""What no body does: joints that jump, and left and right that change places at once."""

from typing import Final

import numpy as np

from mocapidx.model import FloatArray, IndexArray
from mocapidx.skeleton.joints import CANONICAL_JOINTS, MIRROR

__all__ = ["exchanges", "jumps"]

FASTEST: Final = 25.0  # m/s: faster than any hand or foot
SUDDEN: Final = 0.05  # metres from one frame to the next ...
RATIO: Final = 6.0  # ... and that many times what the steps around it are
CROSSED: Final = 0.3  # of the way that both sides go, what is left if they changed places
FAR: Final = 0.15  # metres that both sides go together


def jumps(positions: FloatArray, rate: float) -> IndexArray:
    """Find where joints move faster than bodies do.

    Parameters
    ----------
    positions : ndarray of float, shape (T, 24, 3)
        In metres; NaN where a joint is not known.
    rate : float
        Frames a second, in Hz.

    Returns
    -------
    ndarray of int64, shape (N, 2)
        Frame and joint, in the order of time: the joint is suddenly elsewhere in that frame.
    """
    if len(positions) < 2:
        return np.empty((0, 2), dtype=np.int64)
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=2)
    known = np.where(np.isfinite(steps), steps, 0.0)
    around = np.pad(known, ((2, 2), (0, 0)))
    before = np.minimum(around[:-4], around[1:-3])
    after = np.minimum(around[3:-1], around[4:])
    sudden = (known > SUDDEN) & (known > RATIO * np.maximum(before, after))
    sudden[[0, -1]] = False  # there is nothing on one side to compare with
    found = np.argwhere(sudden | (known * rate > FASTEST))
    return np.asarray(found + np.array([1, 0]), dtype=np.int64)


def exchanges(positions: FloatArray) -> IndexArray:
    """Find where left and right change places from one frame to the next.

    Parameters
    ----------
    positions : ndarray of float, shape (T, 24, 3)
        In metres; NaN where a joint is not known.

    Returns
    -------
    ndarray of int64, shape (N, 2)
        Frame and left joint, in the order of time.
    """
    left = [i for i, j in enumerate(CANONICAL_JOINTS) if j[0] == "l" and MIRROR[i] != i]
    one, other = positions[:, left], positions[:, MIRROR[left]]
    straight = _way(one[:-1], one[1:]) + _way(other[:-1], other[1:])
    crossed = _way(one[:-1], other[1:]) + _way(other[:-1], one[1:])
    # NaN is neither far nor near
    found = np.argwhere((straight > FAR) & (crossed < CROSSED * straight))
    return np.column_stack((found[:, 0] + 1, np.array(left, dtype=np.int64)[found[:, 1]]))


def _way(start: FloatArray, end: FloatArray) -> FloatArray:
    way: FloatArray = np.linalg.norm(end - start, axis=2)
    return way
