"""Print how well matches are found: ``python -m bench.match_quality [FOLDER]``.

FOLDER is the ``hdm05`` folder of AMC clips with its labels file beside it. The clips of each of
three actors are joined to one document, in mixed order; a query is a whole clip, and what it
should find are the other clips of its class. Everything is compared on the same frame distance.
"""

import csv
import itertools
import random
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mocapidx.graphs.frame_distance import METRES_A_STEP, Clouds, distance_grid, frame_clouds
from mocapidx.graphs.pair_paths import in_units
from mocapidx.graphs.paths import PathRules, find_paths
from mocapidx.graphs.search import SearchRules, Stretch, search_web
from mocapidx.graphs.search_paths import SearchPaths, search_paths
from mocapidx.graphs.sweep import SWEPT, chosen_step, sweep_web
from mocapidx.store.read import open_store
from mocapidx.tasks.index import index_files
from mocapidx.tasks.stored import stored_poses

CLASSES = {
    "squat": "squat1Reps",
    "elbowToKnee": "elbowToKnee1RepsLelbowStart",
    "kickLFront": "kickLFront1Reps",
    "rotateArms": "rotateArmsBothBackward1Reps",
    "jog": "jogLeftCircle4StepsRstart",
    "grabHigh": "grabHighR",
}
EPSILONS = tuple(round(0.08 + 0.01 * n, 2) for n in range(23))
RATE = 30.0
JOINTS = np.ones(24, dtype=bool)


@dataclass(frozen=True)
class Clip:
    """A clip in the document of its actor."""

    document: str
    start: int
    end: int
    label: str


class Corpus:
    """The documents, their clips and the web between them."""

    def __init__(self, folder: Path, rules: PathRules) -> None:
        self.clips: list[Clip] = []
        clouds: dict[str, Clouds] = {}
        for actor, parts in joined(folder).items():
            at, made = 0, []
            for label, poses in parts:
                self.clips.append(Clip(actor, at, at + len(poses), label))
                made.append(frame_clouds(poses, JOINTS, round(rules.window * RATE)))
                at += len(poses)
            fields = ("floor", "turned", "heights", "energy")
            clouds[actor] = Clouds(
                *(np.concatenate([getattr(one, field) for one in made]) for field in fields)
            )
        self.lengths = {actor: len(cloud) for actor, cloud in clouds.items()}
        self.grids: dict[tuple[str, str], np.ndarray] = {}
        self.parts: dict[str, list[tuple[str, int, SearchPaths]]] = {a: [] for a in clouds}
        for one, other in itertools.combinations_with_replacement(sorted(clouds), 2):
            diagonal = 0 if one == other else None
            grid = distance_grid(clouds[one], clouds[other], diagonal=diagonal)
            paths = search_paths(in_units(find_paths(grid, RATE, rules, diagonal=diagonal)))
            self.grids[one, other], self.grids[other, one] = grid, grid.T
            self.parts[one].append((other, 0, paths))
            self.parts[other].append((one, 1, paths))

    def frames(self, document: str) -> int:
        """Frames of a document."""
        return self.lengths[document]

    def pieces(self, document: str) -> list[tuple[str, int, SearchPaths]]:
        """Paths between a document and the others."""
        return self.parts[document]

    def queries(self) -> Iterator[tuple[str, Clip]]:
        """One clip of each class and actor: the one in the middle."""
        for name, label in CLASSES.items():
            for actor in sorted(self.lengths):
                clips = [c for c in self.clips if (c.document, c.label) == (actor, label)]
                yield name, clips[len(clips) // 2]


def joined(folder: Path) -> dict[str, list[tuple[str, np.ndarray]]]:
    """Give the clips of each actor in mixed order, with their labels."""
    with (folder.parent / "hdm05-labels.csv").open(newline="") as file:
        labels = {row["document"]: row for row in csv.DictReader(file)}
    actors: dict[str, list[tuple[str, np.ndarray]]] = {}
    with tempfile.TemporaryDirectory() as work:
        index_files([folder], Path(work) / "clips.store")
        with open_store(Path(work) / "clips.store") as store:
            for placed in sorted(store.documents(), key=lambda p: p.document.name):
                row = labels[placed.document.name]
                clip = row["label"], stored_poses(store, placed)
                actors.setdefault(row["actor"], []).append(clip)
    for actor in sorted(actors):
        random.Random(0).shuffle(actors[actor])
    return actors


def score(corpus: Corpus, query: Clip, found: list[Stretch]) -> tuple[float, float, float]:
    """Precision, recall and F1; a hit is right if it shares most of itself or of a clip."""
    wanted = {c for c in corpus.clips if c.label == query.label and c != query}
    right, seen, count = 0, set(), 0
    for hit in found:
        shares = {clip: shared(hit, clip) for clip in (*wanted, query)}
        best = max(shares, key=lambda clip: shares[clip])
        if shares[best] > 0.5 and best == query:
            continue
        count += 1
        if shares[best] > 0.5:
            right += 1
            seen.add(best)
    precision, recall = right / max(count, 1), len(seen) / len(wanted)
    return precision, recall, 2 * precision * recall / max(precision + recall, 1e-9)


def shared(hit: Stretch, clip: Clip) -> float:
    """Share of the shorter of two stretches that lies in the other."""
    if hit.document != clip.document:
        return 0.0
    common = min(hit.end, clip.end) - max(hit.start, clip.start)
    return max(common, 0) / min(hit.end - hit.start, clip.end - clip.start)


def by_web(corpus: Corpus, query: Clip, epsilon: float, steps: int | None) -> list[Stretch]:
    """Search the web, in one step or many."""
    stretch = Stretch(query.document, query.start, query.end)
    rules = SearchRules(epsilon=epsilon, steps=steps)
    graph, _ = search_web(corpus, stretch, rules, RATE, stop_when_full=True)
    return [Stretch(n.document, n.start_frame, n.end_frame) for n in graph.nodes[1:]]


def by_warping(corpus: Corpus, query: Clip, epsilon: float) -> list[Stretch]:
    """Subsequence DTW on the same distance: steps (1,1), (2,1) charged twice, (1,2)."""
    hits = []
    for document in sorted(corpus.lengths):
        grid = corpus.grids[query.document, document][query.start : query.end]
        costs = warped(np.ascontiguousarray(grid, dtype=np.float64) * METRES_A_STEP)
        averages, starts = costs
        for end in np.argsort(averages, kind="stable"):
            if averages[end] > epsilon:
                break
            hits.append((averages[end], Stretch(document, int(starts[end]), int(end) + 1)))
    kept: list[Stretch] = []
    for _, hit in sorted(hits, key=lambda entry: entry[0]):
        if all(hit.document != k.document or overlap(hit, k) <= 0.2 for k in kept):
            kept.append(hit)
    return kept


def warped(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least average a query frame of a match that ends at each column, and where it starts."""
    rows, columns = grid.shape
    total = np.full((rows, columns), np.inf)
    start = np.zeros((rows, columns), dtype=np.int64)
    total[0], start[0] = grid[0], np.arange(columns)
    for row in range(1, rows):
        ways = np.full((3, columns), np.inf)
        begins = np.zeros((3, columns), dtype=np.int64)
        ways[0, 1:], begins[0, 1:] = total[row - 1, :-1] + grid[row, 1:], start[row - 1, :-1]
        if row > 1:
            ways[1, 1:] = total[row - 2, :-1] + 2 * grid[row, 1:]
            begins[1, 1:] = start[row - 2, :-1]
        ways[2, 2:], begins[2, 2:] = total[row - 1, :-2] + grid[row, 2:], start[row - 1, :-2]
        best = ways.argmin(axis=0)
        total[row] = ways[best, np.arange(columns)]
        start[row] = begins[best, np.arange(columns)]
    return total[-1] / rows, start[-1]


def overlap(one: Stretch, other: Stretch) -> float:
    """Share of the union of two stretches of a document that both have."""
    common = max(min(one.end, other.end) - max(one.start, other.start), 0)
    return common / (one.end - one.start + other.end - other.start - common)


Finder = Callable[[Corpus, Clip, float], list[Stretch]]
WAYS: dict[str, tuple[Finder, float]] = {
    "single step": (lambda corpus, query, e: by_web(corpus, query, e, 1), 0.30),
    "multi-step": (lambda corpus, query, e: by_web(corpus, query, e, None), 0.22),
    "subsequence DTW": (by_warping, 0.30),
}


def main() -> None:
    """Print a table."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "../shared/data/hdm05")
    corpus = Corpus(folder, PathRules())
    queries = list(corpus.queries())
    print("| way | class | P / R / F1 at each query's best epsilon | epsilon |")
    print("| --- | --- | --- | --- |")
    for way, (find, most) in WAYS.items():
        epsilons = [epsilon for epsilon in EPSILONS if epsilon <= most + 1e-9]
        scores = np.array(
            [[score(corpus, q, find(corpus, q, e)) for e in epsilons] for _, q in queries]
        )
        best = scores[:, :, 2].argmax(axis=1)
        for name in CLASSES:
            rows = [n for n, (other, _) in enumerate(queries) if other == name]
            mean = scores[rows, best[rows]].mean(axis=0)
            at = sorted({epsilons[n] for n in best[rows]})
            text = " / ".join(f"{value:.2f}" for value in mean)
            print(f"| {way} | {name} | {text} | {at[0]:.2f} to {at[-1]:.2f} |", flush=True)
        one = scores.mean(axis=0)
        top = one[:, 2].argmax()
        print(
            f"| {way} | **all** | F1 **{scores[:, :, 2].max(axis=1).mean():.3f}**; one epsilon "
            f"F1 {one[top, 2]:.3f} (P {one[top, 0]:.2f}, R {one[top, 1]:.2f}) | "
            f"{epsilons[top]:.2f} |",
            flush=True,
        )
    chosen = []
    for _, query in queries:
        stretch = Stretch(query.document, query.start, query.end)
        step = chosen_step(list(sweep_web(corpus, stretch, SearchRules(), RATE, SWEPT)))
        found = [Stretch(n.document, n.start_frame, n.end_frame) for n in step.graph.nodes[1:]]
        chosen.append(score(corpus, query, found))
    text = " / ".join(f"{value:.2f}" for value in np.mean(chosen, axis=0)[:2])
    print(f"| multi-step | **epsilon chosen** | {text} / {np.mean(chosen, axis=0)[2]:.3f} | |")


if __name__ == "__main__":
    main()
