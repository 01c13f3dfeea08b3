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
from mocapidx.queries.steps import FuzzySet

__all__ = ["PartSource", "Source", "expand_ranges", "source_from_words"]

LIST_COST = 4000
"""Reading, checking and decoding a list takes about as long as passing over so many runs."""
KEPT_LIST_COST = 300
"""Uniting a list that has been read with others, in the same measure."""
LISTED_RUN_COST = 3
"""Writing out one run of the united lists."""
TABLE_BITS = 20
"""Sub-indexes with more features look words up by bisection."""


@dataclass(frozen=True)
class PartSource:
    """One sub-index of a segment file.

    Parameters
    ----------
    mask : int
        The features of the sub-index.
    read_starts, read_words : callable
        Give the runs as in `mocapidx.index.build.PartRuns`; called once, when first needed.
    open_lists : callable
        Gives the inverted lists; called once, when first needed.
    """

    mask: int
    read_starts: Callable[[], NDArray[np.uint32]]
    read_words: Callable[[], NDArray[np.uint32]]
    open_lists: Callable[[], InvertedLists]

    @cached_property
    def starts(self) -> NDArray[np.uint32]:
        """Start position of each run number, shape (R,)."""
        return self.read_starts()

    @cached_property
    def words(self) -> NDArray[np.uint32]:
        """The part's word of each run number, shape (R,)."""
        return self.read_words()

    @cached_property
    def lists(self) -> InvertedLists:
        """The inverted lists."""
        return self.open_lists()

    @cached_property
    def ranks(self) -> NDArray[np.int32]:
        """The place of each run's word in the directory, shape (R,); W at free numbers."""
        words, directory = self.words, self.lists.words
        bits = self.mask.bit_count()
        if bits > TABLE_BITS:
            ranks = np.searchsorted(directory, words).astype(np.int32)
        else:
            table = np.full((1 << bits) + 1, len(directory), np.int32)
            table[directory] = np.arange(len(directory), dtype=np.int32)
            ranks = table[np.minimum(words, np.uint32(1 << bits))]
        return ranks

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

    def prefers_table(self, admitted: BoolArray) -> bool:
        """Tell whether to look runs up one by one rather than to unite lists of many words."""
        return "ranks" in self.__dict__ or self._passing_is_quicker(np.any(admitted, axis=0))

    def _passing_is_quicker(self, admitted: BoolArray) -> bool:
        """Tell whether passing over all runs takes less time than the lists of these words."""
        indices = np.flatnonzero(admitted)
        runs = self.lists.counts[indices].sum()
        missing = self.lists.missing(indices)
        cost = missing * LIST_COST + len(indices) * KEPT_LIST_COST + runs * LISTED_RUN_COST
        return bool(cost > self.lists.runs)

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
        if self._passing_is_quicker(admitted):
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
    return PartSource(mask, lambda: runs.starts, lambda: runs.words, lambda: lists)
