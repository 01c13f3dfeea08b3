"""Numbers as text: the shortest that reads back as the very same number."""

from typing import Final

import numpy as np

from mocapidx.model import FloatArray

__all__ = ["decimal", "decimal_rows", "degrees"]

TO_RADIANS: Final = np.pi / 180  # the factor that readers multiply by
SHORT: Final = (4, 6, 9, 12)  # decimals that angles in files have


def decimal(number: float) -> str:
    """Write one number.

    Parameters
    ----------
    number : float
        Finite.

    Returns
    -------
    str
        The fewest digits that read back as the same double; whole numbers without a point.

    Examples
    --------
    >>> decimal(0.1), decimal(-90.0), decimal(1e-7)
    ('0.1', '-90', '1e-07')
    """
    return repr(float(number)).removesuffix(".0")


def decimal_rows(values: FloatArray) -> list[list[str]]:
    """Write a table of numbers.

    Parameters
    ----------
    values : ndarray of float, shape (T, C)
        Finite.

    Returns
    -------
    list of list of str
        Each as `decimal` writes it.
    """
    return [[repr(v).removesuffix(".0") for v in row] for row in values.tolist()]


def degrees(radians: FloatArray) -> FloatArray:
    """Turn angles into degrees that a reader turns back into the same radians.

    Parameters
    ----------
    radians : ndarray of float64
        Angles.

    Returns
    -------
    ndarray of float64
        Those with few decimals where they read back the same, which undoes the rounding of
        angles that came from degrees. About one double in ten is no product of a double and
        pi / 180; it comes back as its neighbour.
    """
    near = radians / TO_RADIANS
    found = near.copy()
    for candidate in (np.nextafter(near, -np.inf), np.nextafter(near, np.inf), near):
        _keep_same(found, candidate, radians)
    for decimals in reversed(SHORT):
        _keep_same(found, np.round(near, decimals), radians)
    signed: FloatArray = np.copysign(found, radians)
    return signed


def _keep_same(found: FloatArray, candidate: FloatArray, radians: FloatArray) -> None:
    np.copyto(found, candidate, where=candidate * TO_RADIANS == radians)
