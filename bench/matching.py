"""Matching templates with long motion, one and many; annotating; whole processes."""

import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from bench.archive import make_archive
from bench.corpus import PROGRAM, Bench
from bench.measure import grow, interleaved, kernels, run_process
from bench.peers import matchers
from bench.table import Row
from bench.words import repeated_words
from mocapidx.alignment.subsequence import many_subsequence_costs, subsequence_costs
from mocapidx.model import WordArray
from mocapidx.tasks.learn import LearnOptions, find_labels, learn_classes
from mocapidx.templates.file import load_templates, save_templates
from mocapidx.templates.path import find_path, loop_bank
from mocapidx.templates.quantise import Quantised, quantise
from mocapidx.templates.template import TemplateSet

__all__ = ["learned_templates", "measure", "measure_annotation"]

OPERATIONS = 8
"""Of float32 a cell: two products and a sum for its cost, two minima, two sums; one for bits."""

LIMIT = f"{OPERATIONS} operations of float32 a cell at the pace of a matrix product"
SQUARE = np.ones((512, 512), np.float32)

BARE_MATCH = """
import sys
import numpy, h5py
from pathlib import Path
from mocapidx.store.read import open_store
from mocapidx.tasks.store_words import store_batches
with open_store(Path(sys.argv[1])) as store:
    for batch in store_batches(store):
        batch.words
"""


def measure(bench: Bench) -> Iterator[Row]:
    """Match one template, then all, with the words of the clips repeated to 210 minutes."""
    known = learned_templates(bench)
    documents = repeated_words(bench.clip_store(), bench.minutes * 60 * 30)
    words = np.concatenate(documents)
    quantised = [quantise(one.matrix, one.delta) for one in known.templates]
    middle = sorted(quantised, key=lambda one: len(one.ones))[len(quantised) // 2]
    yield from one_template(bench, middle, words)
    yield from many_templates(bench, quantised, words)
    yield from whole_process(bench, known)


def one_template(bench: Bench, template: Quantised, words: WordArray) -> Iterator[Row]:
    """Match one template, and let the peers do so with the masked costs that they need."""
    rows = len(template.ones)

    def ours(kernel: str, given: WordArray = words) -> Callable[[], object]:
        def match() -> object:
            with kernels(kernel):
                return subsequence_costs(template.ones, template.care, given)

        return match

    peers = matchers(lambda: masked_costs(template, words), rows, len(words))
    seconds = interleaved({"c": ours("c"), "numpy": ours("numpy"), "limit": product, **peers}, 3)
    growth = grow(lambda n: ours("c", np.resize(words, len(words) * n // 4)), bench.times)
    aims = {("c", "libfmp"): 30, ("c", "librosa"): 60, ("numpy", "libfmp"): 5}
    for kernel in ("c", "numpy"):
        for name in peers:
            aim = aims.get((kernel, name))
            yield Row(
                f"match {rows} columns with {bench.minutes} minutes, {kernel}",
                seconds[kernel],
                "stumpy, one series unwarped" if name == "stumpy" else f"{name}, its costs made",
                seconds[name],
                LIMIT,
                least_seconds(rows * len(words), seconds["limit"]),
                growth if kernel == "c" else None,
                "" if aim is None else f"at least {aim} times",
            )


def many_templates(bench: Bench, templates: Sequence[Quantised], words: WordArray) -> Iterator[Row]:
    """Match all templates in one pass, in one thread and in two."""
    pairs = [(one.ones, one.care) for one in templates]
    columns = sum(len(ones) for ones, _ in pairs)
    nowhere = [None] * len(pairs)
    seconds = interleaved(
        {
            "one": lambda: many_subsequence_costs(pairs, words, nowhere),
            "two": lambda: many_subsequence_costs(pairs, words, nowhere, threads=2),
            "single": lambda: [subsequence_costs(*pair, words) for pair in pairs],
            "limit": product,
        },
        3,
    )
    what = f"match {len(pairs)} templates, {columns} columns, with {bench.minutes} minutes"
    least = least_seconds(columns * len(words), seconds["limit"])
    yield Row(
        f"{what}, one thread",
        seconds["one"],
        "one after the other",
        seconds["single"],
        LIMIT,
        least,
    )
    yield Row(
        f"{what}, two threads",
        seconds["two"],
        "one thread",
        seconds["one"],
        wanted="at least 1.7 times",
    )


def whole_process(bench: Bench, known: TemplateSet) -> Iterator[Row]:
    """Retrieve a class from a store of 210 minutes, as against reading its words."""
    store, path = bench.work / "matching.store", bench.work / "templates.h5"
    make_archive(bench.pool_store(), store, bench.minutes / 60)
    label = sorted(known.templates, key=lambda one: len(one.matrix))[
        len(known.templates) // 2
    ].label
    save_templates(path, replace(known, templates=known.of(label)))
    retrieve = (PROGRAM, "retrieve", store, "--templates", path, "--class", label, "--top", "20")
    bare = (sys.executable, "-c", BARE_MATCH, store)
    both = [(run_process(retrieve), run_process(bare)) for _ in range(10)][1:]
    ours, theirs = zip(*both, strict=True)
    yield Row(
        f"the process `mocapidx retrieve`, {bench.minutes} minutes",
        statistics.median(one.seconds for one in ours),
        limit="import NumPy and h5py, read the words",
        least=statistics.median(one.seconds for one in theirs),
        wanted="at most 1.15 times the limit",
    )


def measure_annotation(bench: Bench) -> Iterator[Row]:
    """Annotate words by one path through the loops of all templates."""
    known = learned_templates(bench)
    words = np.concatenate(repeated_words(bench.clip_store(), bench.minutes * 60 * 30))
    words = words[: bench.minutes * 60 * 30]
    bank = loop_bank(
        [one.matrix for one in known.templates], [one.label for one in known.templates]
    )
    columns = sum(len(one.matrix) for one in known.templates)

    def ours(kernel: str, times: int) -> Callable[[], object]:
        given = np.resize(words, len(words) * times // 64)

        def find() -> object:
            with kernels(kernel):
                return find_path(given, bank)

        return find

    frames = len(words) // 16
    seconds = interleaved({"c": ours("c", 4), "numpy": ours("numpy", 4), "limit": product}, 3)
    growth = grow(lambda n: ours("c", n), bench.times, 1)
    for kernel in ("c", "numpy"):
        yield Row(
            f"annotate {frames} frames by path, {columns} columns, {kernel}: "
            f"{seconds[kernel] / frames / columns * 1e9:.2f} ns a cell",
            seconds[kernel],
            limit=LIMIT,
            least=least_seconds(columns * frames, seconds["limit"]),
            growth=growth if kernel == "c" else None,
        )


def learned_templates(bench: Bench) -> TemplateSet:
    """Learn the classes of the clips, which lie in a folder each; done once."""
    path = bench.work / "learned.h5"
    if not path.exists():
        store = bench.clip_store()
        labels = find_labels(store, labels_from="folder")
        save_templates(path, learn_classes(store, labels, LearnOptions()).templates)
    return load_templates(path)


def product() -> object:
    """Multiply two matrices in one thread: as many operations a second as there can be."""
    return SQUARE @ SQUARE


def least_seconds(cells: int, seconds: float) -> float:
    """Estimate the seconds of so many cells at the pace of `product`, which took `seconds`."""
    return seconds * cells * OPERATIONS / (2 * len(SQUARE) ** 3)


def masked_costs(template: Quantised, words: WordArray) -> np.ndarray:
    """Lay out equation 1 of the templates paper as the matrix that the peers take."""
    care, ones = template.care[:, np.newaxis], template.ones[:, np.newaxis]
    wrong = np.bitwise_count((words[np.newaxis] ^ ones) & care)
    return wrong / np.maximum(np.bitwise_count(care), 1)
