"""Alignment inside the region of matched segments, against all pairs of frames."""

import importlib
import itertools
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.corpus import Bench
from bench.measure import grow, interleaved
from bench.table import Row
from mocapidx.alignment.banded import align_inside, refine_match
from mocapidx.alignment.coarse import full_region, match_segments
from mocapidx.alignment.distances import FrameDistance, pose_distance
from mocapidx.store.read import open_store
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.tasks.stored import stored_motion

MARGIN = 3  # frames: a tenth of a second
MOST_PAIRS, QUICK_PAIRS = 60, 4  # of one class
MOST_TIMES = 16  # 256 times as many pairs of frames
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


def measure(bench: Bench) -> Iterator[Row]:
    """Align pairs of the same class, and long takes made of one clip of each class."""
    classes, mask = takes_by_class(bench.clip_store())
    rng = np.random.default_rng(7)
    pairs = []
    for takes in classes.values():
        own = list(itertools.combinations(takes, 2))
        most = QUICK_PAIRS if bench.quick else MOST_PAIRS
        pairs += [own[number] for number in rng.permutation(len(own))[:most].tolist()]
    yield from rows("pairs of one class", [compare(*pair, mask) for pair in pairs])
    long = [joined([takes[n] for takes in classes.values() if len(takes) > n]) for n in range(6)]
    long_pairs = list(itertools.combinations(long[:3] if bench.quick else long, 2))
    yield from rows("takes of one clip a class", [compare(*pair, mask) for pair in long_pairs])
    yield against_librosa(bench, *long[:2])


def against_librosa(bench: Bench, one: Take, other: Take) -> Row:
    """Compare all pairs of frames of two long takes, as librosa does, distances made for both."""
    librosa = importlib.import_module("librosa")

    def stretched(take: Take, times: int) -> Any:
        return np.resize(take.poses, (len(take.poses) * times // 4, *take.poses.shape[1:]))

    def ours(times: int) -> Callable[[], object]:
        first, second = stretched(one, times), stretched(other, times)
        region = full_region(len(first), len(second))
        return lambda: align_inside(region, pose_distance(first, second))

    def theirs() -> object:
        x, y = (stretched(take, 4).reshape(len(take.poses), -1).T for take in (one, other))
        return librosa.sequence.dtw(x, y)

    seconds = interleaved({"ours": ours(4), "librosa": theirs}, bench.rounds)
    growth = grow(ours, [n for n in bench.times if n <= MOST_TIMES], 1)
    what = f"align all of {len(one.poses)} with {len(other.poses)} frames; both grow"
    return Row(what, seconds["ours"], "librosa", seconds["librosa"], growth=growth)


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


def rows(what: str, compared: list[Outcome | None]) -> Iterator[Row]:
    """Lay the figures out."""
    outcomes = [each for each in compared if each is not None]
    if not outcomes:
        return
    good = sum(each.ratio <= AS_GOOD for each in outcomes) / len(outcomes)
    share = statistics.mean(each.share for each in outcomes)
    yield Row(
        f"align {len(outcomes)} {what}: {good:.0%} cost within 1 % of the best, "
        f"{share:.1%} of the pairs of frames looked at",
        statistics.median(each.seconds for each in outcomes),
        "all pairs of frames, by us",
        statistics.median(each.full_seconds for each in outcomes),
    )
