"""Queries inside one process, as in Table 3 of the 2005 paper, and on ever larger stores.

The words of the clips are repeated to three hours, and the runs of these to 4, 16 and 64 times as
many. A query is cut out of the clips at random, so it has at least one hit; a fuzzy one has 64
alternatives at each step, drawn from the words that occur, one of them the true one, none of them
also in the step before.
"""

import statistics
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from bench.corpus import Bench
from bench.measure import Growth, interleaved
from bench.table import Row
from bench.words import repeated_words
from mocapidx.index.build import PartRuns, build_runs, first_positions
from mocapidx.index.postings import encode_index, open_index
from mocapidx.model import IndexArray, WordArray
from mocapidx.queries.adaptive import adaptive_hits
from mocapidx.queries.column import column_of
from mocapidx.queries.exact import exact_hits
from mocapidx.queries.fuzzy import fuzzy_hits
from mocapidx.queries.mismatch import mismatch_hits
from mocapidx.queries.source import PartSource, Source
from mocapidx.queries.steps import FuzzyQuery, FuzzySet
from mocapidx.segments.runs import find_runs
from mocapidx.store.read import open_store
from mocapidx.tasks.segment_sources import store_feature_set

__all__ = ["measure"]

FRAMES = 180 * 60 * 30
QUERIES = 1000
LENGTHS = (5, 10, 20)
ALTERNATIVES = 64
SECONDS = 1.0  # for each size of each kind of query; fewer queries then

Finder = Callable[[FuzzyQuery, Source], IndexArray]
FINDERS: dict[str, tuple[Finder, bool]] = {
    "exact": (exact_hits, False),
    "fuzzy": (fuzzy_hits, True),
    "adaptive fuzzy": (adaptive_hits, True),
    "one mismatch": (lambda query, source: mismatch_hits(query, source, 1), False),
}


def measure(bench: Bench) -> Iterator[Row]:
    """Time random queries on the upper sub-index of stores of all sizes."""
    store = bench.clip_store()
    with open_store(store) as snapshot:
        mask = store_feature_set(snapshot).part_mask("upper")
    words = repeated_words(store, FRAMES)
    lengths = np.array([len(document) for document in words], np.int64)
    runs = build_runs(words, mask)
    documents = words[: len(set(map(id, words)))]
    sources = [repeated_source(runs, lengths, mask, times) for times in bench.times]
    scanned = np.concatenate(words)
    bare = interleaved({"scan": lambda: np.count_nonzero(scanned == scanned[0])}, bench.rounds)
    for name, (find, fuzzy) in FINDERS.items():
        for length in LENGTHS[1:2] if bench.quick else LENGTHS:
            queries = list(random_queries(documents, mask, length, fuzzy, QUERIES))
            medians, hits = [], 0.0
            for source in sources:
                seconds, found = timed(find, queries, source, SECONDS)
                medians.append(statistics.median(seconds))
                hits = hits or statistics.median(found)
            yield Row(
                f"{name} query of {length} segments, 180 minutes, {hits:.0f} hits",
                medians[0],
                limit="compare each word once",
                least=bare["scan"],
                growth=Growth(bench.times, tuple(medians)),
            )


def timed(
    find: Finder, queries: Sequence[FuzzyQuery], source: Source, budget: float
) -> tuple[list[float], list[int]]:
    """Time queries one by one, at least ten, until the time is used up."""
    seconds: list[float] = []
    hits: list[int] = []
    for query in queries:
        started = time.perf_counter()
        found = find(query, source)
        seconds.append(time.perf_counter() - started)
        hits.append(len(found))
        budget -= seconds[-1]
        if budget < 0 and len(seconds) >= 10:
            break
    return seconds, hits


def repeated_source(runs: PartRuns, lengths: IndexArray, mask: int, times: int) -> Source:
    """Lay the runs of some documents end to end so many times, and index them."""
    span = int((lengths + 1).sum())
    starts = np.empty((times, len(runs.starts)), np.uint32)
    for turn, part in enumerate(starts):
        np.add(runs.starts, np.uint32(turn * span), out=part)
    words = np.tile(runs.words, times)
    data, head = encode_index({"upper": words})
    lists = open_index(data[:head], lambda at, size: data[at : at + size], len(data))["upper"]
    lengths = np.tile(lengths, times)
    flat = starts.reshape(-1)
    part = PartSource(mask, column_of(flat), column_of(words), lambda: lists)
    return Source(first_positions(lengths), lengths, (part,))


def random_queries(
    documents: Sequence[WordArray], mask: int, length: int, fuzzy: bool, count: int
) -> Iterator[FuzzyQuery]:
    """Cut random stretches of so many segments out of the documents."""
    rng = np.random.default_rng([180, length])
    sequences = [find_runs(words & np.uint64(mask))[0] for words in documents]
    long = [sequence for sequence in sequences if len(sequence) >= length]
    everything = np.unique(np.concatenate(sequences))
    frames = np.ones(length, np.int64)
    for _ in range(count if long else 0):
        sequence = long[rng.integers(len(long))]
        first = int(rng.integers(len(sequence) - length + 1))
        values = sequence[first : first + length]
        sets = alternatives(values, everything, rng) if fuzzy else [{int(v)} for v in values]
        steps = (FuzzySet(tuple((mask, value) for value in one)) for one in sets)
        yield FuzzyQuery(tuple(steps), frames)


def alternatives(
    values: WordArray, everything: WordArray, rng: np.random.Generator
) -> list[set[int]]:
    """Draw for each step words that occur, disjoint from those of the step before."""
    sets: list[set[int]] = []
    drawn = everything[rng.integers(len(everything), size=(len(values), 3 * ALTERNATIVES))]
    for place, (value, words) in enumerate(zip(values.tolist(), drawn.tolist(), strict=True)):
        taken = {value} | (sets[-1] if sets else set())
        taken |= set(values[place + 1 : place + 2].tolist())
        others = [word for word in dict.fromkeys(words) if word not in taken]
        sets.append({value, *others[: ALTERNATIVES - 1]})
    return sets
