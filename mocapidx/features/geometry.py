"""Building blocks of relational features: joints as vectors over time.

Every vector has the shape (3, T), or (3, J, T) where J of them are looked at together: the
coordinates stand apart, so that each step is one pass over neighbouring frames. Sums run in the
fixed order x, y, z; negating one coordinate then negates or keeps every result bit by bit, which
is what makes mirrored features exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from mocapidx.model import FloatArray, IndexArray

__all__ = [
    "DEGENERATE",
    "Joints",
    "Poses",
    "along",
    "angle_between",
    "cross",
    "difference_quotient",
    "dot",
    "length_or_nan",
    "norm",
    "plane_normal",
    "segment_distance",
    "widest_floor_distance",
]

Joints: TypeAlias = str | Sequence[str]
"""One joint, or several at once."""

# A vector shorter than this (metres, or square metres for a normal) has no direction.
DEGENERATE = 1e-9


@dataclass(frozen=True, slots=True)
class Poses:
    """Joint positions and velocities of a stretch of frames, ready for the formulas.

    Parameters
    ----------
    rows : mapping of str to int
        The row of each joint.
    points : ndarray of float64, shape (J, 3, T)
        In metres; NaN for a joint that the motion lacks.
    velocities : ndarray of float64, shape (J, 3, T)
        In m/s.
    present : ndarray of int64, shape (P,)
        The rows of the joints that the motion has, ascending.
    """

    rows: Mapping[str, int]
    points: FloatArray
    velocities: FloatArray
    present: IndexArray

    def at(self, joint: Joints) -> FloatArray:
        """Return the position of one joint, shape (3, T), or of J, shape (3, J, T), in metres."""
        return self._of(self.points, joint)

    def speed_of(self, joint: Joints) -> FloatArray:
        """Return the velocity of one joint, shape (3, T), or of J, shape (3, J, T), in m/s."""
        return self._of(self.velocities, joint)

    def _of(self, vectors: FloatArray, joint: Joints) -> FloatArray:
        if isinstance(joint, str):
            vector: FloatArray = vectors[self.rows[joint]]
            return vector
        return vectors[[self.rows[one] for one in joint]].transpose(1, 0, 2)


def difference_quotient(points: FloatArray, rate: float) -> FloatArray:
    """Velocities by central differences, one-sided at the two ends.

    Parameters
    ----------
    points : ndarray of float, shape (..., T)
        Positions over time, in metres.
    rate : float
        Frames a second, in Hz.

    Returns
    -------
    ndarray of float, shape (..., T)
        In m/s; 0 where there is one frame only.
    """
    velocities = np.zeros_like(points)
    if points.shape[-1] > 1:
        np.subtract(points[..., 2:], points[..., :-2], out=velocities[..., 1:-1])
        velocities[..., 1:-1] *= rate / 2
        velocities[..., 0] = (points[..., 1] - points[..., 0]) * rate
        velocities[..., -1] = (points[..., -1] - points[..., -2]) * rate
    return velocities


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the scalar products of two (3, T) arrays, shape (T,)."""
    product: FloatArray = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the right-handed cross products of two (3, T) arrays, shape (3, T)."""
    product = np.empty_like(a)
    product[0] = a[1] * b[2] - a[2] * b[1]
    product[1] = a[2] * b[0] - a[0] * b[2]
    product[2] = a[0] * b[1] - a[1] * b[0]
    return product


def norm(a: FloatArray) -> FloatArray:
    """Return the lengths of a (3, T) array, shape (T,)."""
    length: FloatArray = np.sqrt(dot(a, a))
    return length


def length_or_nan(a: FloatArray) -> FloatArray:
    """Return the lengths of a (3, T) array, shape (T,); NaN where it has no direction."""
    length = norm(a)
    return np.where(length > DEGENERATE, length, np.nan)


def along(a: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the component of `a` along the unit vector of `direction`.

    Parameters
    ----------
    a, direction : ndarray of float, shape (3, T)
        `direction` may have any length.

    Returns
    -------
    ndarray of float, shape (T,)
        In the unit of `a`; NaN where `direction` has no length.
    """
    component: FloatArray = dot(a, direction) / length_or_nan(direction)
    return component


def angle_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angles between two (3, T) arrays.

    Returns
    -------
    ndarray of float, shape (T,)
        In degrees, 0 to 180; NaN where a vector has no length.
    """
    # The arc tangent stays accurate near 0 and 180 degrees, where the arc cosine does not.
    degrees = np.degrees(np.arctan2(norm(cross(a, b)), dot(a, b)))
    return np.where(np.minimum(norm(a), norm(b)) > DEGENERATE, degrees, np.nan)


def plane_normal(p1: FloatArray, p2: FloatArray, p3: FloatArray) -> FloatArray:
    """Return the normal (p2 - p1) x (p3 - p1) of an oriented plane, shape (3, T)."""
    return cross(p2 - p1, p3 - p1)


def _point_segment_distance(point: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the distance of a point from a segment, shape (T,); a segment may be a point."""
    direction = end - start
    square = dot(direction, direction)
    share = dot(point - start, direction) / np.where(square > 0, square, 1)
    return norm(point - start - np.clip(share, 0, 1) * direction)


def segment_distance(
    start: FloatArray, end: FloatArray, other_start: FloatArray, other_end: FloatArray
) -> FloatArray:
    """Return the shortest distance between two segments, frame by frame.

    Parameters
    ----------
    start, end, other_start, other_end : ndarray of float, shape (3, T)
        The ends of the segments, in metres; equal ends make a point.

    Returns
    -------
    ndarray of float, shape (T,)
        In metres.
    """
    at_an_end = np.minimum(
        np.minimum(
            _point_segment_distance(start, other_start, other_end),
            _point_segment_distance(end, other_start, other_end),
        ),
        np.minimum(
            _point_segment_distance(other_start, start, end),
            _point_segment_distance(other_end, start, end),
        ),
    )
    first, second, offset = end - start, other_end - other_start, start - other_start
    aa, bb, ab = dot(first, first), dot(second, second), dot(first, second)
    along_first, along_second = dot(first, offset), dot(second, offset)
    area = aa * bb - ab * ab
    # Parallel segments are nearest at an end, and that distance is known already.
    area = np.where(area > DEGENERATE * aa * bb, area, np.nan)
    s = (ab * along_second - bb * along_first) / area
    t = (aa * along_second - ab * along_first) / area
    inside = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    between = norm(offset + s * first - t * second)
    return np.where(inside, np.minimum(at_an_end, between), at_an_end)


def widest_floor_distance(points: FloatArray) -> FloatArray:
    """Return the largest distance between any two joints seen from above.

    Parameters
    ----------
    points : ndarray of float, shape (J, 3, T)
        In metres; y is not looked at.

    Returns
    -------
    ndarray of float, shape (T,)
        In metres.
    """
    widest = np.zeros(points.shape[2])
    x, z = points[:, 0], points[:, 2]
    for joint in range(len(points) - 1):
        dx, dz = x[joint + 1 :] - x[joint], z[joint + 1 :] - z[joint]
        dx *= dx
        dz *= dz
        dx += dz
        np.fmax(widest, np.fmax.reduce(dx, axis=0), out=widest)
    return np.sqrt(widest)
