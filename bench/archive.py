"""Make a large store of motion that never was: ``python -m bench.archive SOURCE TARGET``.

Its words are pieces of the runs of a real store in random order, a frame longer or shorter and
now and then another feature, cut into documents of one to ten minutes. It is written in batches
by the same functions as any store, and the same seed gives the same store.
"""

import argparse
import hashlib
import resource
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mocapidx.features.featureset import FeatureSet
from mocapidx.model import IndexArray, WordArray
from mocapidx.queries.source import expand_ranges
from mocapidx.segments.runs import find_runs
from mocapidx.store.manifest import Document
from mocapidx.store.read import open_store
from mocapidx.store.write import writing
from mocapidx.tasks.batch import make_batch
from mocapidx.tasks.segment_sources import store_feature_set, untrusted_mask

__all__ = ["Made", "make_archive"]

SEED = 1000
MINUTES = (1.0, 10.0)  # of a document
PIECE_RUNS = (5, 200)  # that are taken from one place
CHANGED = 0.002  # part of the runs in which one feature is another
BATCH_FRAMES = 1 << 24  # 128 MiB of words, as `index` commits them


@dataclass(frozen=True)
class Made:
    """What was made, and what it took."""

    documents: int
    frames: int
    seconds: float
    bytes: int


@dataclass(frozen=True)
class Pool:
    """Runs of real motion, end to end, and documents whose rigs the new ones take over."""

    words: WordArray
    lengths: IndexArray
    documents: tuple[Document, ...]


def make_archive(source: Path, target: Path, hours: float, seed: int = SEED) -> Made:
    """Write a store of so many hours from the words of another one.

    Parameters
    ----------
    source : Path
        A store of real motion.
    target : Path
        The store to make; whatever is there is removed.
    hours : float
    seed : int

    Returns
    -------
    Made
    """
    started = time.perf_counter()
    shutil.rmtree(target, ignore_errors=True)
    rng = np.random.default_rng(seed)
    with open_store(source) as snapshot:
        settings = replace(snapshot.manifest.settings, poses=False)
        feature_set = store_feature_set(snapshot)
    pool = read_pool(source)
    lengths = document_lengths(rng, settings.rate, round(hours * 3600 * settings.rate))
    with writing(target, command="bench", create=settings) as writer:
        for first, last in batches(lengths):
            own = lengths[first:last]
            words = np.split(drawn_words(rng, pool, feature_set, own.sum()), np.cumsum(own)[:-1])
            documents = [
                document(pool, first + number, frames) for number, frames in enumerate(own.tolist())
            ]
            writer.commit(make_batch(documents, words, None, feature_set))
    size = sum(path.stat().st_size for path in target.rglob("*") if path.is_file())
    return Made(len(lengths), int(lengths.sum()), time.perf_counter() - started, size)


def read_pool(source: Path) -> Pool:
    """Read the runs of the documents in which every feature is trusted."""
    with open_store(source) as snapshot:
        trusted = [one for one in snapshot.documents() if not untrusted_mask(one.document)]
        words = [
            snapshot.array(
                one.file, "frames/words", one.frame_offset, one.frame_offset + one.document.frames
            )
            for one in trusted
        ]
    values, bounds = find_runs(np.concatenate(words))
    return Pool(values, np.diff(bounds), tuple(one.document for one in trusted))


def document_lengths(rng: np.random.Generator, rate: float, frames: int) -> IndexArray:
    """Draw lengths in frames until there are enough; the last document is cut."""
    shortest, longest = (round(minutes * 60 * rate) for minutes in MINUTES)
    drawn = rng.integers(shortest, longest + 1, size=frames // shortest + 1)
    ends = np.cumsum(drawn)
    count = int(np.searchsorted(ends, frames)) + 1
    drawn[count - 1] -= ends[count - 1] - frames
    return drawn[:count]


def batches(lengths: IndexArray) -> Iterator[tuple[int, int]]:
    """Split documents into batches: half-open ranges of their numbers."""
    batch = (np.cumsum(lengths) - lengths) // BATCH_FRAMES
    borders = np.flatnonzero(np.diff(batch, prepend=-1, append=batch[-1] + 1))
    return zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True)


def drawn_words(
    rng: np.random.Generator, pool: Pool, feature_set: FeatureSet, frames: int
) -> WordArray:
    """Draw pieces of the pool until there are enough frames."""
    words, missing = [], int(frames)
    while missing > 0:
        pieces = max(1, round(missing / (pool.lengths.mean() * np.mean(PIECE_RUNS))))
        first = rng.integers(len(pool.words), size=pieces)
        last = np.minimum(first + rng.integers(*PIECE_RUNS, size=pieces), len(pool.words))
        _, runs = expand_ranges(first, last)
        values, spans = pool.words[runs], pool.lengths[runs]
        spans = np.maximum(spans + rng.integers(-1, 2, size=len(spans)), 1)
        changed = np.flatnonzero(rng.random(len(values)) < CHANGED)
        features = rng.integers(len(feature_set.features), size=len(changed))
        values[changed] ^= np.uint64(1) << features.astype(np.uint64)
        words.append(np.repeat(values, spans)[:missing])
        missing -= len(words[-1])
    return np.concatenate(words)


def document(pool: Pool, number: int, frames: int) -> Document:
    """Describe a document as if a file of 120 Hz had been indexed."""
    name = f"session{number // 50:04d}/take{number:06d}.amc"
    return Document(
        name=name,
        root="/archive",
        path=None,
        digest=hashlib.blake2b(name.encode(), digest_size=16).hexdigest(),
        size=frames * 4 * 1000,
        mtime_ns=1_700_000_000_000_000_000 + number,
        frames=frames,
        source_frames=frames * 4,
        source_rate=120.0,
        rig=pool.documents[number % len(pool.documents)].rig,
    )


def main() -> None:
    """Make an archive and say what it took."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", type=Path, help="a store of real motion")
    parser.add_argument("target", type=Path, help="the store to make; replaced where it is")
    parser.add_argument("--hours", type=float, default=1000.0, help="default 1000")
    parser.add_argument("--seed", type=int, default=SEED, help=f"default {SEED}")
    given = parser.parse_args()
    made = make_archive(given.source, given.target, given.hours, given.seed)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{given.target}: {made.documents} documents, {made.frames} frames, "
        f"{made.bytes / 1e6:.0f} MB in {made.seconds:.1f} s, {memory:.0f} MB of memory"
    )


if __name__ == "__main__":
    main()
