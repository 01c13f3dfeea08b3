"""Patterns: blocks of steps that follow one another closely, and open stretches between blocks.

A query by example is a pattern of one block. One that is written by hand may bound how long a
step lasts, and leave open what happens between two blocks.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, IndexArray
from mocapidx.queries.source import Source
from mocapidx.queries.steps import FuzzyQuery, FuzzySet, mirror_bits, restrict_steps

__all__ = [
    "UNLIMITED",
    "Block",
    "Finder",
    "Pattern",
    "fitting",
    "mirror_pattern",
    "pattern_from_query",
    "pattern_hits",
    "restrict_pattern",
]

UNLIMITED: Final = 1 << 40
"""Frames; more than any store has."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Steps each of which begins where the one before ends.

    Parameters
    ----------
    query : FuzzyQuery
        The steps, and how long an example stays in each; 0 where there is no example.
    shortest, longest : ndarray of int64, shape (L,)
        Frames that a step may last, both included.
    may_fail : ndarray of bool, shape (L,)
        Whether a step may disagree where mismatches are allowed.
    """

    query: FuzzyQuery
    shortest: IndexArray
    longest: IndexArray
    may_fail: BoolArray

    @property
    def is_open(self) -> bool:
        """Whether it demands nothing."""
        return all(step.is_open for step in self.query.steps)


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """Blocks that follow one another, with anything or nothing in between.

    Parameters
    ----------
    blocks : tuple of Block
        At least one.
    gaps : tuple of (int, int)
        Frames from the end of each block to the start of the next: at least, and at most.

    Raises
    ------
    ParameterError
        If there are no blocks, or not one gap between each two.
    """

    blocks: tuple[Block, ...]
    gaps: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        if not self.blocks or len(self.gaps) != len(self.blocks) - 1:
            raise ParameterError("a pattern needs a block, and a gap between each two")

    @property
    def mask(self) -> int:
        """The features that any step looks at."""
        mask = 0
        for block in self.blocks:
            mask |= block.query.mask
        return mask

    @property
    def steps(self) -> tuple[FuzzySet, ...]:
        """The steps of all blocks."""
        return tuple(step for block in self.blocks for step in block.query.steps)

    @property
    def lengths(self) -> IndexArray:
        """Frames of the example in each step, shape (S,)."""
        return np.concatenate([block.query.lengths for block in self.blocks])

    def stretches(self, bounds: IndexArray) -> IndexArray:
        """Give the stretch of each step of some hits.

        Parameters
        ----------
        bounds : ndarray of int64, shape (H, S + B)
            As `pattern_hits` gives them.

        Returns
        -------
        ndarray of int64, shape (H, S, 2)
            Start and end.
        """
        sizes = np.array([len(block.query.steps) for block in self.blocks])
        starts = np.arange(sizes.sum()) + np.repeat(np.arange(len(sizes)), sizes)
        return np.stack([bounds[:, starts], bounds[:, starts + 1]], axis=2)


Finder: TypeAlias = Callable[[Block, Source], IndexArray]
"""Finds the hits of a block: (H, L + 1) positions, ascending by start."""


def pattern_from_query(query: FuzzyQuery, may_fail: BoolArray | None = None) -> Pattern:
    """Make a pattern of one block without bounds on how long a step lasts.

    Parameters
    ----------
    query : FuzzyQuery
    may_fail : ndarray of bool, shape (L,), optional
        Which steps may disagree where mismatches are allowed; default all.

    Returns
    -------
    Pattern
    """
    count = len(query.steps)
    shortest, longest = np.zeros(count, np.int64), np.full(count, UNLIMITED)
    free = np.ones(count, np.bool_) if may_fail is None else may_fail
    return Pattern((Block(query, shortest, longest, free),))


def restrict_pattern(pattern: Pattern, mask: int) -> Pattern | None:
    """Let a pattern look at some features only, and join what they can't tell apart.

    Parameters
    ----------
    pattern : Pattern
    mask : int
        The features to keep.

    Returns
    -------
    Pattern or None
        Bounds of joined steps are added up; one may disagree if all of its parts might. None
        if nothing is left of a block.
    """
    blocks = tuple(_restrict_block(block, mask) for block in pattern.blocks)
    return None if any(block.is_open for block in blocks) else Pattern(blocks, pattern.gaps)


def _restrict_block(block: Block, mask: int) -> Block:
    query, owners = restrict_steps(block.query, mask)
    if len(query.steps) == len(block.query.steps):
        return Block(query, block.shortest, block.longest, block.may_fail)
    first = np.flatnonzero(np.diff(owners, prepend=-1))
    return Block(
        query,
        np.add.reduceat(block.shortest, first),
        np.minimum(np.add.reduceat(block.longest, first), UNLIMITED),
        np.logical_and.reduceat(block.may_fail, first),
    )


def mirror_pattern(pattern: Pattern, permutation: IndexArray) -> Pattern:
    """Exchange left and right.

    Parameters
    ----------
    pattern : Pattern
    permutation : ndarray of int64, shape (F,)
        The mirror partner of each feature, as in `FeatureSet.mirror`.

    Returns
    -------
    Pattern
    """

    def turned(step: FuzzySet) -> FuzzySet:
        return FuzzySet(
            tuple(
                (mirror_bits(mask, permutation), mirror_bits(value, permutation))
                for mask, value in step.cubes
            )
        )

    blocks = tuple(
        Block(
            FuzzyQuery(tuple(map(turned, block.query.steps)), block.query.lengths),
            block.shortest,
            block.longest,
            block.may_fail,
        )
        for block in pattern.blocks
    )
    return Pattern(blocks, pattern.gaps)


def pattern_hits(pattern: Pattern, source: Source, find: Finder) -> IndexArray:
    """Find a pattern: each block by the index, then chains of blocks.

    There is a hit for each place where the first block stands and the rest can follow. Each
    block is then the next one, in time, after which the rest can follow.

    Parameters
    ----------
    pattern : Pattern
        Neighbouring sets of a block are disjoint.
    source : Source
        Where to look.
    find : Finder
        How a block is found.

    Returns
    -------
    ndarray of int64, shape (H, S + B)
        For each block, where its steps start and where the last one ends, in positions;
        ascending by start.
    """
    bounds = fitting(pattern.blocks[-1], find(pattern.blocks[-1], source))
    for block, gap in zip(pattern.blocks[-2::-1], pattern.gaps[::-1], strict=True):
        before = fitting(block, find(block, source)) if len(bounds) else bounds
        bounds = _chained(before, bounds, gap, source)
    if not len(bounds):
        columns = sum(len(block.query.steps) + 1 for block in pattern.blocks)
        return np.zeros((0, columns), np.int64)
    return bounds


def fitting(block: Block, bounds: IndexArray) -> IndexArray:
    """Keep the hits of a block whose steps last neither too short nor too long.

    Parameters
    ----------
    block : Block
    bounds : ndarray of int64, shape (H, L + 1)

    Returns
    -------
    ndarray of int64, shape (N, L + 1)
    """
    if (block.shortest <= 1).all() and (block.longest == UNLIMITED).all():
        return bounds
    frames = np.diff(bounds, axis=1)
    return bounds[((frames >= block.shortest) & (frames <= block.longest)).all(axis=1)]


def _chained(
    before: IndexArray, after: IndexArray, gap: Sequence[int], source: Source
) -> IndexArray:
    """Put behind each hit of a block the next one of what follows, if it comes in time."""
    if not len(before) or not len(after):
        return np.zeros((0, 0), np.int64)
    ends = before[:, -1]
    documents = source.document_at(before[:, 0])
    latest = np.minimum(ends + gap[1], source.first[documents] + source.lengths[documents])
    following = np.searchsorted(after[:, 0], ends + gap[0])
    there = np.append(after[:, 0], np.iinfo(np.int64).max)[following] <= latest
    return np.hstack([before[there], after[following[there]]])
