"""Medians and other quantiles; those of NumPy import masked arrays, a tenth of a small search."""

import numpy as np

from mocapidx.model import FloatArray

__all__ = ["median", "quantile"]


def median(values: FloatArray) -> FloatArray:
    """Give the medians along the first axis, as `quantile` does."""
    return quantile(values, 0.5)


def quantile(values: FloatArray, share: float) -> FloatArray:
    """Give the values that a share of the others lies below, interpolated.

    Parameters
    ----------
    values : ndarray of float, shape (N, ...)
        At least one.
    share : float
        From 0 to 1.

    Returns
    -------
    ndarray of float, shape (...)
        NaN where one of the values is.
    """
    ordered = np.sort(values, axis=0)  # NaN comes last
    last = len(ordered) - 1
    below = int(share * last)
    part = share * last - below
    above = ordered[min(below + 1, last)]
    found = ordered[below] * (1 - part) + above * part if part else ordered[below]
    return np.where(np.isnan(ordered[last]), np.nan, found)
