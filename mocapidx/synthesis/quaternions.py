"""Rotations as unit quaternions (w, x, y, z), in arrays whose last axis has the four numbers.

A rotation and its negative are the same; before rotations are averaged or interpolated, those
that lie on the far half of the sphere are therefore negated.
"""

import numpy as np

from mocapidx.model import FloatArray, IndexArray

__all__ = [
    "about_vertical",
    "averaged",
    "continuous",
    "from_matrices",
    "product",
    "sampled",
    "to_matrices",
]


def product(first: FloatArray, second: FloatArray) -> FloatArray:
    """Multiply rotations: what `second` turns, `first` turns after it.

    Parameters
    ----------
    first, second : ndarray of float, shape (..., 4)
        Broadcast against each other.

    Returns
    -------
    ndarray of float, shape (..., 4)
    """
    a, b, c, d = np.moveaxis(first, -1, 0)
    w, x, y, z = np.moveaxis(second, -1, 0)
    return np.stack(
        (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ),
        axis=-1,
    )


def about_vertical(angles: FloatArray) -> FloatArray:
    """Give the rotations about Y by angles.

    Parameters
    ----------
    angles : ndarray of float, shape (...)
        In radians, from Z towards X.

    Returns
    -------
    ndarray of float, shape (..., 4)
    """
    zeros = np.zeros_like(angles)
    return np.stack((np.cos(angles / 2), zeros, np.sin(angles / 2), zeros), axis=-1)


def from_matrices(matrices: FloatArray) -> FloatArray:
    """Turn matrices into quaternions.

    Parameters
    ----------
    matrices : ndarray of float, shape (..., 3, 3)
        Proper rotations.

    Returns
    -------
    ndarray of float64, shape (..., 4)
        Of unit length; either of the two signs.
    """
    m = np.asarray(matrices, dtype=np.float64)
    x, y, z = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # Four products of the number sought with one of its fellows; the largest loses no digits.
    rows = np.empty((*m.shape[:-2], 4, 4))
    rows[..., 0, 0] = 1 + x + y + z
    rows[..., 1, 1] = 1 + x - y - z
    rows[..., 2, 2] = 1 - x + y - z
    rows[..., 3, 3] = 1 - x - y + z
    for i, (j, k) in ((1, (2, 3)), (2, (3, 1)), (3, (1, 2))):
        rows[..., 0, i] = rows[..., i, 0] = m[..., k - 1, j - 1] - m[..., j - 1, k - 1]
        rows[..., j, k] = rows[..., k, j] = m[..., k - 1, j - 1] + m[..., j - 1, k - 1]
    best = np.argmax(np.einsum("...ii->...i", rows), axis=-1)
    chosen = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
    return _unit(chosen)


def to_matrices(quaternions: FloatArray) -> FloatArray:
    """Turn quaternions of unit length into matrices.

    Parameters
    ----------
    quaternions : ndarray of float, shape (..., 4)

    Returns
    -------
    ndarray of float, shape (..., 3, 3)
    """
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    matrices = np.empty((*w.shape, 3, 3))
    for i, j, k, a, b, c in ((0, 1, 2, x, y, z), (1, 2, 0, y, z, x), (2, 0, 1, z, x, y)):
        matrices[..., i, i] = 1 - 2 * (b * b + c * c)
        matrices[..., i, j] = 2 * (a * b - w * c)
        matrices[..., i, k] = 2 * (a * c + w * b)
    return matrices


def continuous(quaternions: FloatArray) -> FloatArray:
    """Choose signs such that neighbours in time lie on one half of the sphere.

    Parameters
    ----------
    quaternions : ndarray of float, shape (T, ..., 4)

    Returns
    -------
    ndarray of float, shape (T, ..., 4)
        The same rotations.
    """
    steps = np.sum(quaternions[1:] * quaternions[:-1], axis=-1, keepdims=True)
    signs = np.cumprod(np.where(steps < 0, -1.0, 1.0), axis=0)
    return np.concatenate((quaternions[:1], quaternions[1:] * signs))


def sampled(quaternions: FloatArray, before: IndexArray, part: FloatArray) -> FloatArray:
    """Interpolate between neighbouring frames.

    Parameters
    ----------
    quaternions : ndarray of float, shape (T, N, 4)
        As `continuous` makes them.
    before : ndarray of int64, shape (F,)
        The frame before each time; the one after it exists too.
    part : ndarray of float, shape (F,)
        How far each time lies on the way to the next frame, 0 to 1.

    Returns
    -------
    ndarray of float, shape (F, N, 4)
        Of unit length; where `part` is 0, the rotations of the frame.
    """
    share = part[:, None, None]
    return _unit((1 - share) * quaternions[before] + share * quaternions[before + 1])


def averaged(rotations: FloatArray, weights: FloatArray) -> FloatArray:
    """Average rotations: the weighted sum on one half of the sphere, brought to unit length.

    Parameters
    ----------
    rotations : ndarray of float, shape (E, ..., 4)
    weights : ndarray of float, shape (E,)
        Their sum is 1; small negative ones extrapolate.

    Returns
    -------
    ndarray of float, shape (..., 4)
        On the half of the sphere of the rotation with the largest weight.
    """
    leading = rotations[int(np.argmax(weights))]
    sides = np.where(np.sum(rotations * leading, axis=-1) < 0, -1.0, 1.0)
    scaled = sides * weights.reshape(-1, *[1] * (rotations.ndim - 2))
    return _unit(np.sum(scaled[..., None] * rotations, axis=0))


def _unit(quaternions: FloatArray) -> FloatArray:
    lengths: FloatArray = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    unit: FloatArray = quaternions / np.where(lengths > 0, lengths, 1.0)
    return unit
