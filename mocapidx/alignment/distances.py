"""How far two frames are from each other: by their poses, or by their feature words."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray

__all__ = ["FrameDistance", "common_joints", "pose_distance", "word_distance"]

FrameDistance: TypeAlias = Callable[[IndexArray, IndexArray], FloatArray]
"""The distances of pairs of frames, given by two vectors of equal length."""

ComplexArray: TypeAlias = NDArray[np.complexfloating[Any, Any]]


def common_joints(one: FloatArray, other: FloatArray) -> BoolArray:
    """Tell which joints two motions both have in all their frames.

    Parameters
    ----------
    one, other : ndarray of float, shape (T, J, 3)
        Each of its own length; NaN where a position is unknown.

    Returns
    -------
    ndarray of bool, shape (J,)
    """
    known = [np.isfinite(positions).all(axis=(0, 2)) for positions in (one, other)]
    return np.asarray(known[0] & known[1], dtype=np.bool_)


def pose_distance(one: FloatArray, other: FloatArray) -> FrameDistance:
    """Measure how far apart the joints of two poses are, wherever the bodies stand and face.

    The distance is the root mean square over the joints, after the shift over the ground and
    the turn about the vertical that make it least. Both have a closed form: with the joints
    seen from above as complex numbers about their centre, the best turn is the argument of
    their scalar product.

    Parameters
    ----------
    one, other : ndarray of float, shape (T, J, 3)
        In metres, Y up, each of its own length; at least one joint, no NaN.

    Returns
    -------
    callable
        From frames of `one` and frames of `other` to metres, float64.

    Raises
    ------
    ParameterError
        If there are no joints, or another number of them.

    References
    ----------
    .. [1] Kovar, Gleicher, "Automated extraction and parameterization of motions in large data
       sets", SIGGRAPH 2004, section 3.1: the distance of point clouds, here of single frames
       and with equal weights.
    """
    joints = one.shape[1]
    if not joints or other.shape[1] != joints:
        raise ParameterError(f"poses must have the same joints, got {joints} and {other.shape[1]}")
    flat, heights, sizes = _centred(one)
    other_flat, other_heights, other_sizes = _centred(other)
    other_flat = other_flat.conj()

    def distance(frames: IndexArray, other_frames: IndexArray) -> FloatArray:
        turned = np.abs(_products(flat, other_flat, frames, other_frames))
        upright = np.real(_products(heights, other_heights, frames, other_frames))
        squares = sizes[frames] + other_sizes[other_frames] - 2 * (turned + upright)
        distances: FloatArray = np.sqrt(np.maximum(squares, 0.0) / joints)
        return distances

    return distance


def _centred(positions: FloatArray) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Joints from above about their centre as complex numbers, heights, and squared sizes."""
    x, y, z = np.moveaxis(positions.astype(np.float64), 2, 0)
    flat = x + 1j * z
    flat -= flat.mean(axis=1, keepdims=True)
    sizes = (np.abs(flat) ** 2).sum(axis=1) + (y * y).sum(axis=1)
    return flat, y, sizes


def _products(
    one: FloatArray | ComplexArray,
    other: FloatArray | ComplexArray,
    frames: IndexArray,
    other_frames: IndexArray,
) -> FloatArray | ComplexArray:
    """Sum over the joints the products of pairs of frames."""
    products: FloatArray | ComplexArray = np.einsum("nj,nj->n", one[frames], other[other_frames])
    return products


def word_distance(one: WordArray, other: WordArray, mask: int) -> FrameDistance:
    """Count the features in which two frames differ.

    Parameters
    ----------
    one, other : ndarray of uint64, shape (T,)
        Feature words, each of its own length.
    mask : int
        The features that count.

    Returns
    -------
    callable
        From frames of `one` and frames of `other` to numbers of features, float64.
    """
    kept, other_kept = one & np.uint64(mask), other & np.uint64(mask)

    def distance(frames: IndexArray, other_frames: IndexArray) -> FloatArray:
        return np.bitwise_count(kept[frames] ^ other_kept[other_frames]).astype(np.float64)

    return distance
