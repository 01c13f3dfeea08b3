"""Rank everything in a store by a weighted pattern; a large store is scanned coarsely first."""

import itertools
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from mocapidx.model import FloatArray, IndexArray
from mocapidx.store.manifest import Placed
from mocapidx.store.read import Snapshot
from mocapidx.tasks.segment_sources import document_groups
from mocapidx.tasks.store_words import WordBatch, piece_batches, store_batches
from mocapidx.templates.keyframes import Pieces
from mocapidx.templates.match import Hits
from mocapidx.templates.oneshot import Pattern, match_pattern, pattern_hits

if TYPE_CHECKING:
    from mocapidx.tasks.parallel import MapFunction

__all__ = ["Area", "Ranking", "choose_area", "median_cost", "rank"]

MOST_CELLS: Final = 1_000_000_000
"""Rows of the pattern times frames of the store; about ten seconds. Beyond, a coarse scan."""

COARSE: Final = 4
"""Every so many rows and every so many frames: a sixteenth of the cells."""

KEPT: Final = 0.2
"""Share of the places of the coarse scan that are looked at closely."""

SAMPLE_SECONDS: Final = 1800.0
SEED: Final = 2007


@dataclass(frozen=True, slots=True, eq=False)
class Ranking:
    """Places in a store, best first.

    Parameters
    ----------
    documents : ndarray of int64, shape (H,)
        Numbers of the documents in the order of their names.
    starts, ends : ndarray of int64, shape (H,)
        In frames of the document, half open.
    costs : ndarray of float32, shape (H,)
    """

    documents: IndexArray
    starts: IndexArray
    ends: IndexArray
    costs: FloatArray


@dataclass(frozen=True, slots=True)
class Area:
    """What is scanned: all of a store, or pieces of it.

    Parameters
    ----------
    snapshot : Snapshot
    documents : tuple of Placed
        The documents that count, in the order of their names.
    pieces : dict of int to Pieces, optional
        By the number of the segment file; None: everything.
    map_fn : callable
        Matches what was read, with the shape of ``map``.
    """

    snapshot: Snapshot
    documents: tuple[Placed, ...]
    pieces: dict[int, Pieces] | None = field(default=None)
    map_fn: "MapFunction" = map

    def batches(self) -> Iterator[WordBatch]:
        """Read it, a bounded number of frames at a time."""
        if self.pieces is None:
            yield from self.whole({placed.document.name for placed in self.documents})
            return
        for file in self.snapshot.files:
            if file.number not in self.pieces:
                continue
            for group in document_groups(file):
                own = self.pieces[file.number].of(group.documents)
                yield from piece_batches(self.snapshot, file, own, group.untrusted)

    def whole(self, names: Collection[str]) -> Iterator[WordBatch]:
        """Read some documents as a whole."""
        for batch in store_batches(self.snapshot):
            own = [n for n, document in enumerate(batch.documents) if document.name in names]
            if len(own) == len(batch.documents):
                yield batch
            elif own:
                yield batch.select(np.array(own, dtype=np.int64))


def choose_area(
    snapshot: Snapshot,
    documents: Iterable[Placed],
    pattern: Pattern,
    map_fn: "MapFunction" = map,
) -> Area:
    """Choose what to scan for a pattern: everything, or what a coarse scan of it leaves.

    Parameters
    ----------
    snapshot : Snapshot
    documents : iterable of Placed
        The documents of the snapshot that count.
    pattern : Pattern
    map_fn : callable
        Matches, with the shape of ``map``.

    Returns
    -------
    Area
    """
    ordered = tuple(sorted(documents, key=lambda placed: placed.document.name))
    everything = Area(snapshot, ordered, None, map_fn)
    frames = sum(placed.document.frames for placed in ordered)
    if frames * len(pattern.ones) <= MOST_CELLS or len(pattern.ones) < 2 * COARSE:
        return everything
    thinned = map(_thinned, everything.batches())
    coarse = _ranked(everything, thinned, pattern.every(COARSE), whole=True)
    kept = slice(0, int(np.ceil(KEPT * len(coarse.costs))))
    margin = len(pattern.ones)
    starts = coarse.starts[kept] * COARSE - margin
    ends = coarse.ends[kept] * COARSE + margin
    return replace(everything, pieces=_pieces(ordered, coarse.documents[kept], starts, ends))


def rank(area: Area, pattern: Pattern) -> Ranking:
    """Find every place where a pattern costs less than around it.

    Parameters
    ----------
    area : Area
    pattern : Pattern

    Returns
    -------
    Ranking
        By cost, then document name, then start.
    """
    return _ranked(area, area.batches(), pattern)


def median_cost(area: Area, pattern: Pattern, ranking: Ranking) -> float:
    """Give the median cost of all places of a store, which costs are compared with.

    Parameters
    ----------
    area : Area
    pattern : Pattern
    ranking : Ranking
        Of the pattern in the area.

    Returns
    -------
    float
        Where only pieces were scanned, of the places in some whole documents drawn at random;
        0 if there is no place.
    """
    costs = ranking.costs
    if area.pieces is not None:
        costs = _ranked(area, _sampled(area), pattern).costs
    return float(np.median(costs)) if len(costs) else 0.0


def _ranked(
    area: Area, batches: Iterable[WordBatch], pattern: Pattern, *, whole: bool = False
) -> Ranking:
    """Match every batch; `whole`: its documents are, even if frames are left out."""
    numbers = {placed.document.name: number for number, placed in enumerate(area.documents)}
    columns: list[tuple[IndexArray, IndexArray, IndexArray, FloatArray]] = []
    for names, hits in area.map_fn(partial(_matched, pattern, whole), batches):
        own = np.array([numbers[name] for name in names], dtype=np.int64)
        columns.append((own[hits.documents], hits.starts, hits.ends, hits.costs))
    if not columns:
        nothing = np.zeros(0, dtype=np.int64)
        return Ranking(nothing, nothing, nothing, np.zeros(0))
    number, starts, ends, costs = map(np.concatenate, zip(*columns, strict=True))
    order = np.lexsort((starts, number, costs))
    return Ranking(number[order], starts[order], ends[order], costs[order])


def _matched(pattern: Pattern, whole: bool, batch: WordBatch) -> tuple[list[str], Hits]:
    """Give the names of the pieces of a batch and the hits in them; runs in any process."""
    trusted = pattern.without(batch.untrusted)
    padded = True if whole else batch.at_ends
    hits = pattern_hits(match_pattern(trusted, batch.words, batch.bounds, padded))
    first = batch.starts[hits.documents]
    names = [document.name for document in batch.documents]
    return names, replace(hits, starts=first + hits.starts, ends=first + hits.ends)


def _thinned(batch: WordBatch) -> WordBatch:
    """Take every fourth frame of each document."""
    spans = itertools.pairwise(batch.bounds.tolist())
    words = [batch.words[start:stop:COARSE] for start, stop in spans]
    bounds = np.concatenate(([0], np.cumsum([len(each) for each in words]))).astype(np.int64)
    starts = batch.starts // COARSE
    return WordBatch(batch.documents, starts, np.concatenate(words), bounds, batch.untrusted)


def _pieces(
    documents: Sequence[Placed], numbers: IndexArray, starts: IndexArray, ends: IndexArray
) -> dict[int, Pieces]:
    """Unite stretches of documents that touch, for each segment file."""
    files: dict[int, list[tuple[int, int, int]]] = {placed.file.number: [] for placed in documents}
    rows = sorted(zip(numbers.tolist(), starts.tolist(), ends.tolist(), strict=True))
    for number, same in itertools.groupby(rows, key=lambda row: row[0]):
        placed = documents[number]
        united: list[list[int]] = []
        for _, start, end in same:
            start, end = max(start, 0), min(end, placed.document.frames)
            if united and start <= united[-1][1]:
                united[-1][1] = max(united[-1][1], end)
            else:
                united.append([start, end])
        files[placed.file.number] += [(placed.ordinal, start, end) for start, end in united]
    return {number: _as_pieces(sorted(rows)) for number, rows in files.items()}


def _as_pieces(rows: Sequence[tuple[int, int, int]]) -> Pieces:
    columns = np.array(rows, dtype=np.int64).reshape(-1, 3).T
    return Pieces(columns[0], columns[1], columns[2])


def _sampled(area: Area) -> Iterator[WordBatch]:
    """Read some whole documents, drawn at random, the same ones for the same store."""
    wanted = round(SAMPLE_SECONDS * area.snapshot.manifest.settings.rate)
    names: set[str] = set()
    for number in np.random.default_rng(SEED).permutation(len(area.documents)).tolist():
        if wanted <= 0:
            break
        names.add(area.documents[number].document.name)
        wanted -= area.documents[number].document.frames
    yield from area.whole(names)
