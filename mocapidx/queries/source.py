"""What a query is asked of: one segment file's runs and lists, each read when first needed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pyroaring import BitMap

from mocapidx.features.words import part_words
from mocapidx.index.build import PartRuns, build_runs, first_positions
from mocapidx.index.postings import InvertedLists, encode_index, open_index
from mocapidx.model import BoolArray, IndexArray, WordArray
from mocapidx.queries.column import Column, column_of
from mocapidx.queries.steps import FuzzySet

__all__ = ["PartSource", "Source", "expand_ranges", "source_from_words"]

LIST_COST = 4000
"""Reading, checking and decoding a list takes about as long as passing over so many runs."""
KEPT_LIST_COST = 300
"""Uniting a list that has been read with others, in the same measure."""
LISTED_RUN_COST = 3
"""Writing out one run of the united lists."""
JOINED_RUN_COST = 20
"""Making one run of them part of a stretch, and meeting it with other stretches."""
READ_COST = 3
"""Reading a run's number from the store and checking it."""
LOOKUP_COST = 10
"""Looking up the word of a run by its number."""
TABLE_BITS = 20
"""Sub-indexes with more features look words up by bisection."""


@dataclass(frozen=True)
class PartSource:
    """One sub-index of a segment file.

    Parameters
    ----------
    mask : int
        The features of the sub-index.
    starts, words : Column
        Of the runs, as in `mocapidx.index.build.PartRuns`.
    open_lists : callable
        Gives the inverted lists; called once, when first needed.
    """

    mask: int
    starts: Column
    words: Column
    open_lists: Callable[[], InvertedLists]

    @cached_property
    def lists(self) -> InvertedLists:
        """The inverted lists."""
        return self.open_lists()

    @cached_property
    def ranks(self) -> NDArray[np.int32]:
        """The place of each run's word in the directory, shape (R,); W at free numbers."""
        return self._ranked(self.words.whole())

    def ranks_at(self, runs: IndexArray) -> NDArray[np.int32]:
        """Give the ranks of some runs, by their numbers; -1 is the last one.

        Parameters
        ----------
        runs : ndarray of int64, shape (N,)

        Returns
        -------
        ndarray of int32, shape (N,)
        """
        if "ranks" in self.__dict__ or len(runs) * LOOKUP_COST > len(self.words):
            return self.ranks.take(runs)
        return self._ranked(self.words.take(runs))

    def _ranked(self, words: NDArray[np.uint32]) -> NDArray[np.int32]:
        bits = self.mask.bit_count()
        if bits > TABLE_BITS:
            return np.searchsorted(self.lists.words, words).astype(np.int32)
        return self._rank_table[np.minimum(words, np.uint32(1 << bits))]

    @cached_property
    def _rank_table(self) -> NDArray[np.int32]:
        directory = self.lists.words
        table = np.full((1 << self.mask.bit_count()) + 1, len(directory), np.int32)
        table[directory] = np.arange(len(directory), dtype=np.int32)
        return table

    def admitted(self, steps: Sequence[FuzzySet]) -> BoolArray:
        """Tell which words of the directory agree with each of some sets in this sub-index.

        Parameters
        ----------
        steps : sequence of FuzzySet, length L
            Of each cube only the features of this sub-index count.

        Returns
        -------
        ndarray of bool, shape (L, W + 1)
            The last column, for free run numbers, is False.
        """
        directory = self.lists.words
        table = np.zeros((len(steps), len(directory) + 1), np.bool_)
        owners = np.repeat(np.arange(len(steps)), [len(step.cubes) for step in steps])
        masks = part_words(np.concatenate([step.masks for step in steps]), self.mask)
        values = part_words(np.concatenate([step.values for step in steps]), self.mask)
        for mask in sorted(set(masks.tolist())):  # as a rule one, or two
            alike = masks == mask
            keys = directory & mask
            order = np.argsort(keys, kind="stable")
            keys = keys[order]
            first = np.searchsorted(keys, values[alike], "left")
            last = np.searchsorted(keys, values[alike], "right")
            cubes, places = expand_ranges(first, last)
            table[owners[alike][cubes], order[places]] = True
        return table

    def counts(self, admitted: BoolArray) -> IndexArray:
        """Count the runs that each row of `admitted` tells of, shape (L,)."""
        counts: IndexArray = admitted[..., :-1] @ self.lists.counts
        return counts

    def listing_cost(self, admitted: BoolArray) -> float:
        """Estimate what it takes to write out the runs of the admitted words, shape (W + 1,)."""
        indices = np.flatnonzero(admitted)
        runs = self.lists.counts[indices].sum()
        missing = self.lists.missing(indices)
        return float(missing * LIST_COST + len(indices) * KEPT_LIST_COST + runs * LISTED_RUN_COST)

    def stretches_cost(self, admitted: BoolArray) -> float:
        """Estimate what it takes to find all stretches of the admitted words, shape (W + 1,)."""
        runs = min(self.listing_cost(admitted), self.passing_cost())
        return runs + float(self.counts(admitted)) * JOINED_RUN_COST

    def passing_cost(self) -> float:
        """Estimate what it takes to look at the word of every run."""
        known = "ranks" in self.__dict__
        return len(self.words) + (0 if known else READ_COST * self.words.unread(len(self.words)))

    def lookup_cost(self, runs: int) -> float:
        """Estimate what it takes to look up the words of so many runs and of what goes on there.

        Few of them are still looked at after the first step.
        """
        cost = LOOKUP_COST * runs
        known = "ranks" in self.__dict__
        return cost if known else cost + READ_COST * self.words.unread(runs)

    def bitmap(self, admitted: BoolArray) -> BitMap:
        """Unite the lists of the admitted words, shape (W + 1,), by equation 11."""
        lists = self.lists.lists(np.flatnonzero(admitted))
        return BitMap.union(*lists) if lists else BitMap()

    def runs(self, admitted: BoolArray) -> IndexArray:
        """Find the runs with one of the admitted words, ascending.

        Parameters
        ----------
        admitted : ndarray of bool, shape (W + 1,)
            A row of `admitted`.

        Returns
        -------
        ndarray of int64, shape (N,)
            Run numbers.
        """
        if self.passing_cost() < self.listing_cost(admitted):
            return np.flatnonzero(admitted.take(self.ranks))
        return np.asarray(self.bitmap(admitted).to_array(), dtype=np.int64)


@dataclass(frozen=True)
class Source:
    """One segment file, as queries see it.

    Parameters
    ----------
    first : ndarray of int64, shape (D,)
        Position of the first frame of each document.
    lengths : ndarray of int64, shape (D,)
        Frames of each document.
    parts : tuple of PartSource
        The sub-indexes; no two share a feature.
    """

    first: IndexArray
    lengths: IndexArray
    parts: tuple[PartSource, ...]

    def touched(self, mask: int) -> list[PartSource]:
        """Give the sub-indexes that have one of some features."""
        return [part for part in self.parts if part.mask & mask]

    def document_at(self, positions: IndexArray) -> IndexArray:
        """Give the documents that positions (of frames, or just after the last) are in."""
        return np.searchsorted(self.first, positions, "right") - 1


def expand_ranges(first: IndexArray, last: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Write out half-open ranges of numbers.

    Parameters
    ----------
    first, last : ndarray of int64, shape (N,)
        Where each range begins and ends; a range may be empty, never negative.

    Returns
    -------
    owners : ndarray of int64, shape (M,)
        The range that each number is of.
    numbers : ndarray of int64, shape (M,)
        The numbers of the ranges, one range after the other.

    Examples
    --------
    >>> [a.tolist() for a in expand_ranges(np.array([5, 9]), np.array([7, 10]))]
    [[0, 0, 1], [5, 6, 9]]
    """
    sizes = last - first
    owners = np.repeat(np.arange(len(sizes)), sizes)
    return owners, np.arange(len(owners)) + np.repeat(last - np.cumsum(sizes), sizes)


def source_from_words(words: Sequence[WordArray], masks: dict[str, int]) -> Source:
    """Index documents in memory.

    Parameters
    ----------
    words : sequence of ndarray of uint64, each of shape (T,)
        The feature words of each document.
    masks : dict of str to int
        The features of each sub-index, by its name.

    Returns
    -------
    Source
        As a segment file with these documents gives it.
    """
    runs = {name: build_runs(words, mask) for name, mask in masks.items()}
    data, head = encode_index({name: part.words for name, part in runs.items()})
    lists = open_index(data[:head], lambda at, size: data[at : at + size], len(data))
    parts = tuple(_part_in_memory(masks[name], runs[name], lists[name]) for name in masks)
    lengths = np.array([len(document) for document in words], np.int64)
    return Source(first_positions(lengths), lengths, parts)


def _part_in_memory(mask: int, runs: PartRuns, lists: InvertedLists) -> PartSource:
    return PartSource(mask, column_of(runs.starts), column_of(runs.words), lambda: lists)
