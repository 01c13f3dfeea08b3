"""Quantised templates: what is consistent in a class as bits, what is variable masked out."""

from dataclasses import dataclass

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.features.words import pack_words
from mocapidx.model import FloatArray, IndexArray, WordArray

__all__ = ["Quantised", "quantise"]

LEAST_TOLD = 0.25  # share; legs alone tell about a third of most templates
ROUNDING = 1e-9  # one example of ten that disagrees is 0.1, whatever its last bits say


@dataclass(frozen=True, slots=True, eq=False)
class Quantised:
    """A template whose entries are 0, 1 or undecided, packed into words.

    Parameters
    ----------
    ones : ndarray of uint64, shape (K,)
        Bit i is set where feature i is consistently 1.
    care : ndarray of uint64, shape (K,)
        Bit i is set where feature i is consistent; the others are undecided.
    counts : ndarray of int64, shape (K,)
        Number of consistent features.
    """

    ones: WordArray
    care: WordArray
    counts: IndexArray

    def without(self, mask: int) -> "Quantised":
        """Leave some features undecided everywhere, such as those that a rig can't tell.

        Parameters
        ----------
        mask : int
            Bit i stands for feature i.

        Returns
        -------
        Quantised
        """
        care = self.care & ~np.uint64(mask)
        return Quantised(self.ones & care, care, np.bitwise_count(care).astype(np.int64))

    def is_told_without(self, mask: int) -> bool:
        """Whether enough of what is decided is left where some features can't be told.

        A rig of one leg violates next to nothing of any template: its cost of nearly 0 says
        nothing. At least a quarter of the decided entries must be left.

        Parameters
        ----------
        mask : int
            Bit i stands for feature i, which can't be told.

        Returns
        -------
        bool
        """
        left = int(self.without(mask).counts.sum()) if mask else int(self.counts.sum())
        return left >= LEAST_TOLD * int(self.counts.sum())


def quantise(matrix: FloatArray, delta: float) -> Quantised:
    """Turn the entries below `delta` into 0, above ``1 - delta`` into 1, mask out the rest.

    Parameters
    ----------
    matrix : ndarray of float, shape (K, F)
        Entries between 0 and 1, at most 64 features.
    delta : float
        Above 0 and below 0.5; both comparisons are strict.

    Returns
    -------
    Quantised

    Raises
    ------
    ParameterError
        If `delta` is out of range.

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, section 5.2.
    """
    if not 0.0 < delta < 0.5:
        raise ParameterError(f"delta must lie between 0 and 0.5, got {delta}")
    ones = matrix > 1.0 - delta + ROUNDING
    zeros = matrix < delta - ROUNDING
    care = pack_words(ones | zeros)
    return Quantised(pack_words(ones), care, np.bitwise_count(care).astype(np.int64))
