"""Fuzzy sets of feature words, and the sequences of them that a query asks for.

A *cube* (mask, value) is the set of all feature words that agree with the value in the bits of
the mask; a *fuzzy set* is a union of cubes. Sets are never enumerated: a selection of features
is one cube a step, whatever the number of words that agree on them.
"""

from dataclasses import dataclass
from functools import cached_property, reduce
from operator import or_
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, IndexArray, WordArray
from mocapidx.segments.runs import find_runs

__all__ = [
    "FuzzyQuery",
    "FuzzySet",
    "intersects",
    "join_intersecting",
    "join_steps",
    "mirror_bits",
    "restrict",
    "restrict_steps",
    "steps_from_example",
]

ALL_BITS: Final = (1 << 64) - 1


@dataclass(frozen=True)
class FuzzySet:
    """A set of feature words: a union of cubes.

    Parameters
    ----------
    cubes : tuple of (int, int)
        The mask and the value of each cube; a word is in it if ``word & mask == value``. Kept
        in ascending order, each once. The mask 0 is the set of all words.

    Raises
    ------
    ParameterError
        If there are no cubes, or a value has bits outside of its mask.
    """

    cubes: tuple[tuple[int, int], ...]

    def __post_init__(self) -> None:
        if not self.cubes:
            raise ParameterError("a fuzzy set without cubes has no words")
        for mask, value in self.cubes:
            if not 0 <= mask <= ALL_BITS or value & ~mask:
                raise ParameterError(f"cube value {value:#x} has bits outside of mask {mask:#x}")
        if len(self.cubes) > 1:
            object.__setattr__(self, "cubes", tuple(sorted(set(self.cubes))))

    @property
    def is_open(self) -> bool:
        """Whether every word is in it by a cube that demands nothing."""
        return self.cubes[0][0] == 0

    @cached_property
    def mask(self) -> int:
        """The features that any cube looks at."""
        if self.cubes[0][0] == self.cubes[-1][0]:  # in ascending order, so all are the same
            return self.cubes[0][0]
        return reduce(or_, (mask for mask, _ in self.cubes))

    @cached_property
    def members(self) -> frozenset[tuple[int, int]]:
        """The cubes, to look one up."""
        return frozenset(self.cubes)

    @cached_property
    def masks(self) -> WordArray:
        """The masks of the cubes, shape (C,)."""
        if self.cubes[0][0] == self.cubes[-1][0]:
            return np.full(len(self.cubes), self.cubes[0][0], np.uint64)
        return np.array([mask for mask, _ in self.cubes], np.uint64)

    @cached_property
    def values(self) -> WordArray:
        """The values of the cubes, shape (C,)."""
        return np.array([value for _, value in self.cubes], np.uint64)

    def contains(self, words: WordArray) -> BoolArray:
        """Tell which words are in the set.

        Parameters
        ----------
        words : ndarray of uint64, shape (N,)
            Whole feature words.

        Returns
        -------
        ndarray of bool, shape (N,)
            True where a cube has the word.
        """
        if len(self.cubes) == 1:
            return np.asarray(words & self.masks[0] == self.values[0])
        inside = np.zeros(len(words), np.bool_)
        for mask in sorted({mask for mask, _ in self.cubes}):
            values = self.values[self.masks == np.uint64(mask)]
            inside |= np.isin(words & np.uint64(mask), values)
        return inside


@dataclass(frozen=True, slots=True)
class FuzzyQuery:
    """A sequence of fuzzy sets, and how long the example stays in each.

    Parameters
    ----------
    steps : tuple of FuzzySet
        V_1 to V_L of the paper.
    lengths : ndarray of int64, shape (L,)
        Frames of the example in each step.

    Raises
    ------
    ParameterError
        If there are no steps, or not one length for each.
    """

    steps: tuple[FuzzySet, ...]
    lengths: IndexArray

    def __post_init__(self) -> None:
        if not self.steps:
            raise ParameterError("a query needs at least one step")
        if len(self.lengths) != len(self.steps):
            raise ParameterError(f"{len(self.steps)} steps have {len(self.lengths)} lengths")

    @property
    def mask(self) -> int:
        """The features that any step looks at."""
        return reduce(or_, (step.mask for step in self.steps))


def intersects(one: FuzzySet, other: FuzzySet) -> bool:
    """Tell whether two sets have a word in common.

    Parameters
    ----------
    one, other : FuzzySet
        In any order.

    Returns
    -------
    bool
        True if a cube of one agrees with a cube of the other in all bits that both look at.
    """
    if one.cubes[0][0] == one.cubes[-1][0] == other.cubes[0][0] == other.cubes[-1][0]:
        return not one.members.isdisjoint(other.members)
    few, many = sorted((one, other), key=lambda step: len(step.cubes))
    return any(
        bool(((many.values ^ value) & many.masks & mask == 0).any())
        for mask, value in zip(few.masks, few.values, strict=True)
    )


def join_intersecting(query: FuzzyQuery) -> FuzzyQuery:
    """Conjoin adjacent sets that intersect until no two do.

    Parameters
    ----------
    query : FuzzyQuery
        Any sequence of sets.

    Returns
    -------
    FuzzyQuery
        Adjacent sets are disjoint; the lengths of joined steps are added up.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 5.2: "we iteratively conjoin
       adjacent sets with nonempty intersection".

    Examples
    --------
    >>> bent, straight = FuzzySet(((1, 1),)), FuzzySet(((1, 0),))
    >>> joined = join_intersecting(FuzzyQuery((bent, bent, straight), np.array([3, 4, 5])))
    >>> len(joined.steps), joined.lengths.tolist()
    (2, [7, 5])
    """
    return join_steps(query)[0]


def join_steps(query: FuzzyQuery) -> tuple[FuzzyQuery, IndexArray]:
    """Conjoin adjacent sets that intersect, and tell what became of each.

    Parameters
    ----------
    query : FuzzyQuery
        Any sequence of sets.

    Returns
    -------
    joined : FuzzyQuery
        As `join_intersecting` gives it.
    owners : ndarray of int64, shape (L,)
        The joined step that each of the steps is part of, from 0.
    """
    steps: list[FuzzySet] = []
    lengths: list[int] = []
    sizes: list[int] = []
    for following, frames in zip(query.steps, query.lengths.tolist(), strict=True):
        step, size = following, 1
        while steps and intersects(steps[-1], step):  # a joined set may reach further back
            step = FuzzySet(steps.pop().cubes + step.cubes)
            frames += lengths.pop()
            size += sizes.pop()
        steps.append(step)
        lengths.append(frames)
        sizes.append(size)
    owners = np.repeat(np.arange(len(sizes)), sizes)
    if len(steps) == len(query.steps):
        return query, owners
    return FuzzyQuery(tuple(steps), np.array(lengths, np.int64)), owners


def restrict(query: FuzzyQuery, mask: int) -> FuzzyQuery:
    """Let a query look at some features only, and join what they can't tell apart.

    Parameters
    ----------
    query : FuzzyQuery
        Any query.
    mask : int
        The features to keep.

    Returns
    -------
    FuzzyQuery
        With disjoint neighbours.
    """
    return restrict_steps(query, mask)[0]


def restrict_steps(query: FuzzyQuery, mask: int) -> tuple[FuzzyQuery, IndexArray]:
    """Let a query look at some features only, and tell what became of each step.

    Parameters
    ----------
    query, mask
        As for `restrict`.

    Returns
    -------
    restricted : FuzzyQuery
        As `restrict` gives it.
    owners : ndarray of int64, shape (L,)
        The step of it that each of the steps is part of, from 0.
    """
    if query.mask & ~mask:
        steps = tuple(
            FuzzySet(tuple((bits & mask, value & mask) for bits, value in step.cubes))
            for step in query.steps
        )
        query = FuzzyQuery(steps, query.lengths)
    return join_steps(query)


def mirror_bits(bits: int, permutation: IndexArray) -> int:
    """Exchange left and right in a mask or a value.

    Parameters
    ----------
    bits : int
        Bit i stands for feature i.
    permutation : ndarray of int64, shape (F,)
        The mirror partner of each feature, as in `FeatureSet.mirror`.

    Returns
    -------
    int
    """
    return sum(1 << partner for i, partner in enumerate(permutation.tolist()) if bits >> i & 1)


def steps_from_example(words: WordArray, mask: int) -> FuzzyQuery:
    """Take an example's sequence on selected features as the query.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        The example's feature words, one a frame.
    mask : int
        The selected features.

    Returns
    -------
    FuzzyQuery
        One cube a step.

    Raises
    ------
    ParameterError
        If no feature is selected or the example has no frames.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 4, and section 5.2, last paragraphs.

    Examples
    --------
    >>> query = steps_from_example(np.array([0, 2, 1, 1], np.uint64), 1)
    >>> [step.cubes for step in query.steps], query.lengths.tolist()
    ([((1, 0),), ((1, 1),)], [2, 2])
    """
    if not mask:
        raise ParameterError("no feature is selected, so every motion would match")
    if not len(words):
        raise ParameterError("the example has no frames")
    values, bounds = find_runs(words & np.uint64(mask))
    steps = tuple(FuzzySet(((mask, value),)) for value in values.tolist())
    return FuzzyQuery(steps, np.diff(bounds))
