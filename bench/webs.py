"""Match webs: distances against a bare matrix product, ten minutes of motion, searches."""

import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bench.measure import median_seconds, paired_ratio
from bench.reading import Row
from mocapidx.graphs.frame_distance import distance_grid, frame_clouds
from mocapidx.graphs.search import SearchRules, Stretch, search_once, search_web
from mocapidx.store.read import open_store
from mocapidx.tasks.index import index_files
from mocapidx.tasks.open_web import open_web
from mocapidx.tasks.stored import stored_poses
from mocapidx.tasks.web import WebOptions, build_web, web_info

FRAMES = 18_500  # ten minutes at 30 Hz, the 37,000 frames of the paper at 60 Hz
SIDE = 2048
JOINTS = np.ones(24, dtype=bool)


def measure(corpus: Any, work: Path) -> Iterator[Row]:
    """Time the distance, a build of up to ten minutes of motion, and searches in it."""
    store = work / "webs.store"
    index_files([corpus.clips, corpus.many], store)
    with open_store(store) as snapshot:
        documents = [(p.document, stored_poses(snapshot, p)) for p in snapshot.documents()]
    poses = np.concatenate([np.nan_to_num(p) for _, p in documents])[:SIDE]
    yield distance_row(poses)

    total, kept = 0, []
    for document, _ in documents:
        if total + document.frames <= FRAMES:
            total += document.frames
            kept.append(document)
    longest = max(document.frames for document in kept)
    where = " or ".join(f"document = '{document.name}'" for document in kept[:150])
    web, jobs = work / "ten.web", len(os.sched_getaffinity(0))
    started = time.perf_counter()
    build_web(store, web, WebOptions(where=where, jobs=jobs))
    seconds = time.perf_counter() - started
    info = web_info(web)
    yield (
        f"web of {info['minutes']:.1f} minutes, {info['grid_cells'] / 1e6:.0f} M cells",
        f"{seconds:.1f} s, {info['megabytes']:.1f} MB",
        f"{info['path_share']:.1%} of the cells in paths",
        f"{seconds / info['grid_cells'] * 1e9:.0f} ns a cell",
    )
    with open_store(store) as snapshot:
        opened, _ = open_web(web, snapshot)
    name = next(d.name for d in kept if d.frames == longest)
    query = Stretch(name, 0, min(45, longest))
    rules = SearchRules(epsilon=0.18)
    seconds = median_seconds(lambda: search_once(opened, query, rules))
    found = len(search_once(opened, query, rules))
    yield f"a query of 1.5 s, {found} matches", f"{seconds * 1e3:.2f} ms", "", ""
    rules = SearchRules(epsilon=0.22, most=100)
    graph, _ = search_web(opened, query, rules, 30.0)
    seconds = median_seconds(lambda: search_web(opened, query, rules, 30.0), runs=3)
    matches = len(graph.nodes) - 1
    yield (
        f"multi-step, {matches} matches",
        f"{seconds * 1e3:.0f} ms",
        f"{len(graph.edges)} edges",
        "",
    )


def distance_row(poses: np.ndarray) -> Row:
    """Compare distances with three bare products of the same sizes."""
    clouds = frame_clouds(poses, JOINTS, 10)
    other = frame_clouds(poses[::-1], JOINTS, 10)  # not itself: that would be a cheaper product

    def bare() -> None:
        for one, two in (
            (clouds.floor, other.floor),
            (clouds.floor, other.turned),
            (clouds.heights, other.heights),
        ):
            one @ two.T

    ours, theirs, ratio = paired_ratio(lambda: distance_grid(clouds, other), bare)
    return (
        f"distances, {len(poses)} x {len(poses)} frames",
        f"{ours * 1e3:.0f} ms",
        f"bare matrix products: {theirs * 1e3:.0f} ms",
        f"{ratio:.2f} of their speed",
    )
