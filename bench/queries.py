"""Queries inside one process, on the words of the clips repeated to 180 minutes."""

import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bench.reading import Row
from mocapidx.features.featureset import PARTS
from mocapidx.queries.evaluate import FINDERS
from mocapidx.queries.source import source_from_words
from mocapidx.queries.steps import steps_from_example
from mocapidx.store.read import open_store
from mocapidx.tasks.index import index_files
from mocapidx.tasks.segment_sources import store_feature_set

FRAMES = 180 * 60 * 30
QUERIES = 2_000


def measure(corpus: Any, work: Path) -> Iterator[Row]:
    """Time random queries that have at least one hit."""
    store = work / "queries.store"
    index_files([corpus.clips], store)
    with open_store(store) as snapshot:
        feature_set = store_feature_set(snapshot)
        documents = []
        for entry in snapshot.documents():
            end = entry.frame_offset + entry.document.frames
            words = snapshot.array(entry.file, "frames/words", entry.frame_offset, end)
            documents.append(np.array(words))
    repeated = documents * -(-FRAMES // sum(map(len, documents)))
    masks = {part: feature_set.part_mask(part) for part in PARTS}
    source = source_from_words(repeated, masks)
    rng = np.random.default_rng(180)
    for mode in ("exact", "adaptive"):
        for steps in (5, 10):
            queries = list(random_queries(documents, masks["upper"], steps, rng))
            seconds, hits = [], []
            for query in queries:
                started = time.perf_counter()
                found = FINDERS[mode](query, source)
                seconds.append(time.perf_counter() - started)
                hits.append(len(found))
            yield (
                f"{mode} query of {steps} segments, upper, 180 minutes",
                f"{statistics.median(seconds) * 1e3:.3f} ms",
                f"{len(queries)} queries, {statistics.median(hits):.0f} hits",
                "",
            )


def random_queries(
    documents: list[Any], mask: int, steps: int, rng: np.random.Generator
) -> Iterator[Any]:
    """Cut random stretches of so many segments out of the documents."""
    whole = [steps_from_example(words, mask) for words in documents]
    long = [query for query in whole if len(query.steps) >= steps]
    for _ in range(QUERIES if long else 0):
        query = long[rng.integers(len(long))]
        first = int(rng.integers(len(query.steps) - steps + 1))
        part = slice(first, first + steps)
        yield type(query)(query.steps[part], query.lengths[part])
