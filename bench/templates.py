"""Templates: learning, matching and annotating 210 minutes, against librosa and libfmp."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bench.measure import median_seconds, paired_ratio
from bench.reading import Row
from bench.words import repeated_words
from mocapidx.alignment.subsequence import subsequence_costs
from mocapidx.tasks.index import index_files
from mocapidx.tasks.learn import LearnOptions, find_labels, learn_classes
from mocapidx.templates.match import find_hits, match_documents
from mocapidx.templates.path import find_path, loop_bank
from mocapidx.templates.quantise import quantise

FRAMES = 210 * 60 * 30
STEPS = np.array([[1, 1], [2, 1], [1, 2]])


def measure(corpus: Any, work: Path) -> Iterator[Row]:
    """Time each step on the words of the clips, repeated to 210 minutes at 30 Hz."""
    store = work / "templates.store"
    index_files([corpus.clips], store)
    started = time.perf_counter()
    labels = find_labels(store, labels_from="folder")
    learned = learn_classes(store, labels, LearnOptions())
    seconds = time.perf_counter() - started
    templates = learned.templates.templates
    yield f"learn {len(templates)} classes", f"{seconds:.1f} s", "with thresholds, keyframes", ""

    documents = repeated_words(store, FRAMES)
    words = np.concatenate(documents)
    bounds = np.concatenate(([0], np.cumsum([len(document) for document in documents])))
    template = sorted(templates, key=lambda one: len(one.matrix))[len(templates) // 2]
    quantised = quantise(template.matrix, template.delta)
    rows = len(quantised.ones)
    costs = masked_costs(quantised.ones, quantised.care, words)

    def ours() -> np.ndarray:
        return subsequence_costs(quantised.ones, quantised.care, words, steps="weighted")

    for name, theirs in peers(costs).items():
        fast, slow, ratio = paired_ratio(ours, theirs, runs=3)
        yield (
            f"match {rows} rows with 210 minutes",
            f"{fast * 1e3:.0f} ms",
            f"{name}, costs given: {slow * 1e3:.0f} ms",
            f"{ratio:.0f} times",
        )
    matching = match_documents(quantised, words, bounds)
    seconds = median_seconds(lambda: find_hits(matching, 0.06), runs=3)
    hits = len(find_hits(matching, 0.06).costs)
    yield f"hits below 0.06: {hits}", f"{seconds * 1e3:.1f} ms", "", ""

    bank = loop_bank([one.matrix for one in templates], [one.label for one in templates])
    columns = sum(len(one.matrix) for one in templates)
    seconds = median_seconds(lambda: find_path(words, bank), runs=1)
    yield f"annotate 210 minutes by path, {columns} columns", f"{seconds:.1f} s", "", ""


def masked_costs(ones: np.ndarray, care: np.ndarray, words: np.ndarray) -> np.ndarray:
    """Lay out equation 1 of the templates paper as the matrix that the peers take."""
    counts = np.maximum(np.bitwise_count(care), 1)[:, np.newaxis]
    wrong = np.bitwise_count((words[np.newaxis] ^ ones[:, np.newaxis]) & care[:, np.newaxis])
    return wrong / counts


def peers(costs: np.ndarray) -> dict[str, Callable[[], object]]:
    """Import the peers; Numba compiles them at their first call, which is not counted."""
    os.environ.setdefault("MPLBACKEND", "agg")
    import librosa
    from libfmp.c7 import compute_accumulated_cost_matrix_subsequence_dtw_21

    weights = np.array([1.0, 2.0, 1.0])
    return {
        "librosa": lambda: librosa.sequence.dtw(
            C=costs,
            step_sizes_sigma=STEPS,
            weights_mul=weights,
            weights_add=np.zeros(3),
            subseq=True,
            backtrack=False,
        ),
        "libfmp": lambda: compute_accumulated_cost_matrix_subsequence_dtw_21(costs),
    }
