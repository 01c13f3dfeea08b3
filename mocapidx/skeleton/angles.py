"""Rotation matrices as the three angles of channels."""

import numpy as np

from mocapidx.model import FloatArray

__all__ = ["channel_angles"]

POLE = 1e-9  # nearer to a right angle the other two turn about one and the same axis


def channel_angles(matrices: FloatArray, order: tuple[int, int, int]) -> FloatArray:
    """Split rotations into turns about the coordinate axes.

    Parameters
    ----------
    matrices : ndarray of float, shape (3, 3, T)
        One matrix a frame, ``matrices[row, column, frame]``.
    order : tuple of int
        The axes 0, 1, 2 in the order in which their matrices are multiplied from left to right.

    Returns
    -------
    ndarray of float64, shape (3, T)
        Angles in radians, in the order of `order`; over time they go on from frame to frame
        without jumps of a whole turn.
    """
    i, j, k = order
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    flat = np.hypot(matrices[i, i], matrices[i, j])
    middle = np.arctan2(sign * matrices[i, k], flat)
    first = np.arctan2(-sign * matrices[j, k], matrices[k, k])
    last = np.arctan2(-sign * matrices[i, j], matrices[i, i])
    pole = flat < POLE
    first[pole] = np.arctan2(sign * matrices[k, j], matrices[j, j])[pole]
    last[pole] = 0.0
    angles: FloatArray = np.unwrap(np.stack((first, middle, last)), axis=1)
    return angles
