"""Ranking by stretch lengths, and the order in which hits are shown."""

from collections.abc import Sequence

import numpy as np

from mocapidx.model import FloatArray, IndexArray

__all__ = ["length_costs", "ranking_order"]


def length_costs(bounds: IndexArray, lengths: IndexArray) -> FloatArray:
    """Compare how long hits and example stay in each step.

    The cost of a hit is the root mean square, over its steps, of log((n + 1) / (m + 1)), n and m
    being the frames that the hit and the example spend in the step. Exchanging hit and example
    changes nothing, and a step of twice or half the frames weighs the same, about 0.69, whether
    it is short or long; the 1 stands for the frame by which a border may be off. The cost is 0
    for equal lengths alone.

    Parameters
    ----------
    bounds : ndarray of int64, shape (H, L + 1)
        Where each step of each hit starts, and where the last one ends, in frames.
    lengths : ndarray of int64, shape (L,)
        Frames of the example in each step.

    Returns
    -------
    ndarray of float64, shape (H,)
        Smaller is better.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 6.2, ranks by the sum of the
       differences of frame lengths. On HDM05 clips both order equally well; this one does not
       depend on tempo and rate, so costs of different queries can be compared.

    Examples
    --------
    >>> length_costs(np.array([[0, 9, 19], [5, 9, 14]]), np.array([9, 4])).round(2).tolist()
    [0.56, 0.51]
    """
    frames = np.diff(bounds, axis=1)
    costs: FloatArray = np.sqrt(((np.log1p(frames) - np.log1p(lengths)) ** 2).mean(axis=1))
    return costs


def ranking_order(
    costs: FloatArray, documents: Sequence[str], starts: IndexArray, ends: IndexArray
) -> IndexArray:
    """Order hits by cost, then by document name, then by start and end.

    Parameters
    ----------
    costs : ndarray of float, shape (H,)
        Of each hit.
    documents : sequence of str, length H
        Name of the document of each hit.
    starts, ends : ndarray of int64, shape (H,)
        In frames of the document.

    Returns
    -------
    ndarray of int64, shape (H,)
        Places of the hits, best first; the order that came in doesn't matter.
    """
    names = {name: number for number, name in enumerate(sorted(set(documents)))}
    numbers = np.array([names[name] for name in documents], np.int64)
    return np.lexsort((ends, starts, numbers, costs))
