"""Adaptive segmentation: cut a motion where its feature word changes.

A *run* is a maximal stretch of frames with one and the same feature word.
"""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.model import IndexArray

__all__ = ["find_runs"]

Word = TypeVar("Word", bound=np.integer[Any])


def find_runs(words: NDArray[Word]) -> tuple[NDArray[Word], IndexArray]:
    """Split a sequence of feature words into runs of equal words.

    Parameters
    ----------
    words : ndarray of an integer type, shape (T,)
        One feature word a frame, whole or of one sub-index.

    Returns
    -------
    values : ndarray of the same type, shape (R,)
        The word of each run; neighbours always differ.
    bounds : ndarray of int64, shape (R + 1,)
        In frames; run ``r`` is ``bounds[r]`` up to, not including, ``bounds[r + 1]``.

    Raises
    ------
    ParameterError
        If `words` is not a vector of integers, or has no frames.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, "Efficient content-based retrieval of motion capture
       data", SIGGRAPH 2005, section 4.

    Examples
    --------
    >>> find_runs(np.array([0, 0, 3], dtype=np.uint64))[1].tolist()
    [0, 2, 3]
    """
    if words.ndim != 1 or not np.issubdtype(words.dtype, np.integer):
        got = f"{words.dtype} {words.shape}"
        raise ParameterError(f"words must be integers of shape (T,), got {got}")
    if not len(words):
        raise ParameterError("words has no frames, so it has no runs")
    changes = np.flatnonzero(words[1:] != words[:-1]) + 1
    bounds = np.concatenate(([0], changes, [len(words)])).astype(np.int64)
    return words[bounds[:-1]], bounds
