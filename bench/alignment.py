"""Alignment inside the region of matched segments, against all pairs of frames."""

import itertools
import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.reading import Row
from mocapidx.alignment.banded import align_inside, refine_match
from mocapidx.alignment.coarse import full_region, match_segments
from mocapidx.alignment.distances import FrameDistance, pose_distance
from mocapidx.store.read import open_store
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.index import index_files
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.tasks.stored import stored_motion

MARGIN = 3  # frames: a tenth of a second
MOST_PAIRS = 60  # of one class
AS_GOOD = 1.01


@dataclass(frozen=True)
class Take:
    """Feature words and joint positions of a document."""

    words: Any
    poses: Any


@dataclass(frozen=True)
class Outcome:
    """What one pair of takes came to."""

    ratio: float
    share: float
    rounds: int
    seconds: float
    full_seconds: float


def measure(corpus: Any, work: Path) -> Iterator[Row]:
    """Align pairs of the same class, and long takes made of one clip of each class."""
    store = work / "alignment.store"
    index_files([corpus.clips], store)
    classes, mask = takes_by_class(store)
    outcomes, unmatched = [], 0
    rng = np.random.default_rng(7)
    for takes in classes.values():
        pairs = list(itertools.combinations(takes, 2))
        for number in rng.permutation(len(pairs))[:MOST_PAIRS].tolist():
            outcome = compare(*pairs[number], mask)
            unmatched += outcome is None
            outcomes += [] if outcome is None else [outcome]
    yield from rows("pairs of one class", outcomes, unmatched)
    long = [joined([takes[n] for takes in classes.values() if len(takes) > n]) for n in range(6)]
    compared = [compare(*pair, mask) for pair in itertools.combinations(long, 2)]
    found = [each for each in compared if each is not None]
    yield from rows("takes of one clip a class", found, len(compared) - len(found))


def takes_by_class(store: Path) -> tuple[dict[str, list[Take]], int]:
    """Read the takes of each folder, and the mask of all features."""
    classes: dict[str, list[Take]] = {}
    with open_store(store) as snapshot:
        for placed in snapshot.documents():
            start, frames = placed.frame_offset, placed.document.frames
            words = snapshot.array(placed.file, FRAME_WORDS.path, start, start + frames)
            poses = stored_motion(snapshot, placed).positions
            known = np.isfinite(poses).all(axis=(0, 2))
            label = placed.document.name.rpartition("/")[0]
            classes.setdefault(label, []).append(Take(np.array(words), poses[:, known]))
        return classes, store_feature_set(snapshot).select("all")


def joined(takes: list[Take]) -> Take:
    """Lay takes end to end."""
    return Take(
        np.concatenate([take.words for take in takes]),
        np.concatenate([take.poses for take in takes]),
    )


def compare(one: Take, other: Take, mask: int) -> Outcome | None:
    """Align a pair both ways; None where no segments can be matched."""
    distance: FrameDistance = pose_distance(one.poses, other.poses)
    started = time.perf_counter()
    match = match_segments(one.words, other.words, mask)
    if match is None:
        return None
    refined = refine_match(match, distance, MARGIN)
    seconds = time.perf_counter() - started
    started = time.perf_counter()
    full = align_inside(full_region(len(one.words), len(other.words)), distance)
    return Outcome(
        refined.path.cost / full.cost,
        refined.region.share,
        refined.rounds,
        seconds,
        time.perf_counter() - started,
    )


def rows(what: str, outcomes: list[Outcome], unmatched: int) -> Iterator[Row]:
    """Lay the figures out."""
    if not outcomes:
        return
    good = sum(each.ratio <= AS_GOOD for each in outcomes) / len(outcomes)
    worst = max(each.ratio for each in outcomes)
    share = statistics.mean(each.share for each in outcomes)
    rounds = statistics.mean(each.rounds for each in outcomes)
    yield (
        f"alignment, {what}: cost within 1 % of all pairs of frames",
        f"{good:.1%}",
        f"{len(outcomes)} pairs, worst {worst:.3f}, {unmatched} without a coarse alignment",
        "",
    )
    yield (
        f"alignment, {what}: pairs of frames looked at",
        f"{share:.1%}",
        f"{rounds:.1f} rounds",
        f"{1 / share:.1f}",
    )
    seconds = statistics.median(each.seconds for each in outcomes)
    full = statistics.median(each.full_seconds for each in outcomes)
    yield (
        f"alignment, {what}: time",
        f"{seconds * 1e3:.1f} ms",
        f"{full * 1e3:.1f} ms",
        f"{full / seconds:.1f}",
    )
