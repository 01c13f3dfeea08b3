"""Rotations as matrices, one a frame: structure of arrays, (3, 3, T)."""

import numpy as np

from mocapidx.model import FloatArray, Up

__all__ = ["Up", "multiplied", "times_vector", "turned", "upright"]


def turned(
    matrices: FloatArray,
    axis: int,
    cosines: FloatArray,
    sines: FloatArray,
    *,
    in_place: bool = False,
) -> FloatArray:
    """Multiply matrices from the right by rotations about one coordinate axis.

    Parameters
    ----------
    matrices : ndarray of float, shape (3, 3, T)
        One matrix a frame, ``matrices[row, column, frame]``.
    axis : {0, 1, 2}
        x, y or z.
    cosines, sines : ndarray of float, shape (T,)
        Of the angles, counter-clockwise seen from the tip of the axis.
    in_place : bool
        Overwrite `matrices`, which saves a copy.

    Returns
    -------
    ndarray of float, shape (3, 3, T)
        The products; only two columns differ from `matrices`.
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    product = matrices if in_place else matrices.copy()
    one, other = product[:, i], product[:, j]
    crossed = one * sines
    one *= cosines
    one += other * sines
    other *= cosines
    other -= crossed
    return product


def multiplied(matrices: FloatArray, constant: FloatArray) -> FloatArray:
    """Multiply matrices from the right by one constant matrix.

    Parameters
    ----------
    matrices : ndarray of float, shape (3, 3, T)
        One matrix a frame.
    constant : ndarray of float, shape (3, 3)
        The other factor.

    Returns
    -------
    ndarray of float, shape (3, 3, T)
        The products.
    """
    product = np.empty_like(matrices)
    for j in range(3):
        product[:, j] = times_vector(matrices, constant[:, j])
    return product


def times_vector(matrices: FloatArray, vector: FloatArray) -> FloatArray:
    """Turn one vector by every matrix.

    Parameters
    ----------
    matrices : ndarray of float, shape (3, 3, T)
        One matrix a frame.
    vector : ndarray of float, shape (3,) or (3, T)
        The same vector for all frames, or one a frame.

    Returns
    -------
    ndarray of float, shape (3, T)
        The turned vectors.
    """
    product: FloatArray = matrices[:, 0] * vector[0]
    product += matrices[:, 1] * vector[1]
    product += matrices[:, 2] * vector[2]
    return product


def upright(up: Up) -> FloatArray:
    """Return the rotation that takes an axis to Y.

    Parameters
    ----------
    up : {"x", "y", "z", "-x", "-y", "-z"}
        The axis that points up.

    Returns
    -------
    ndarray of float, shape (3, 3)
        A proper rotation (no mirroring) of its entries -1, 0 and 1.
    """
    matrices = {
        "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "-y": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
        "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        "-z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        "-x": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
    }
    return np.array(matrices[up], dtype=np.float64)
