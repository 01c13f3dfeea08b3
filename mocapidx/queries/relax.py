"""Automatic selection: from everything the example shows to what matters, until there are hits.

A family of feature sets is reduced feature by feature, the least important first, and the example
is asked for with each of them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.model import FloatArray, WordArray

__all__ = ["FEWEST_STEPS", "Relaxation", "relaxations"]

FEWEST_STEPS: Final = 3
"""With fewer the example is no sequence of events any more, and nearly everything is like it."""


@dataclass(frozen=True, slots=True)
class Relaxation:
    """Selections of as many features each, to be asked for together.

    Parameters
    ----------
    left_out : int
        How many features of the largest family do not count any more.
    masks : tuple of int
        The selections; bit i stands for feature i.
    """

    left_out: int
    masks: tuple[int, ...]


def relaxations(
    words: WordArray, families: Sequence[int], importance: FloatArray
) -> Iterator[Relaxation]:
    """Give the selections to ask an example for, from all features to few.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        The example.
    families : sequence of int
        Masks of features, such as all of them and those of each sub-index. Each is reduced on
        its own; a small one joins in when the larger ones have become as small.
    importance : ndarray of float, shape (F,)
        The least important feature of a family is left out first; of equal ones the last.

    Yields
    ------
    Relaxation
        One for each number of features, falling. A family ends where the example has fewer
        than three steps; no selection comes twice.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 6.2, last paragraph: start with
       predefined feature sets, reduce the number of features, pose a query for each, until
       enough hits have been found.
    """
    orders = [_by_importance(family, importance) for family in dict.fromkeys(families)]
    largest = max(map(len, orders), default=0)
    seen: set[int] = set()
    for count in range(largest, 0, -1):
        orders = [
            order
            for order in orders
            if len(order) < count or _steps(words, order[:count]) >= FEWEST_STEPS
        ]
        masks = {sum(1 << bit for bit in order[:count]) for order in orders if len(order) >= count}
        new = tuple(sorted(masks - seen))
        seen.update(new)
        if new:
            yield Relaxation(largest - count, new)


def _by_importance(family: int, importance: FloatArray) -> list[int]:
    """Give the features of a family, the most important first."""
    bits = [bit for bit in range(len(importance)) if family >> bit & 1]
    return sorted(bits, key=lambda bit: (-float(importance[bit]), bit))


def _steps(words: WordArray, features: Sequence[int]) -> int:
    """Count the segments of an example that some features make."""
    selected = words & np.uint64(sum(1 << bit for bit in features))
    return 1 + int(np.count_nonzero(selected[1:] != selected[:-1]))
