"""Match webs: distances against bare matrix products, a build as a process, searches."""

from collections.abc import Iterator

import numpy as np

from bench.corpus import PROGRAM, Bench
from bench.measure import interleaved, run_process
from bench.table import Row
from mocapidx.graphs.frame_distance import distance_grid, frame_clouds
from mocapidx.graphs.search import SearchRules, Stretch, search_once, search_web
from mocapidx.store.read import open_store
from mocapidx.tasks.index import index_files
from mocapidx.tasks.open_web import open_web
from mocapidx.tasks.stored import stored_poses
from mocapidx.tasks.web import web_info

__all__ = ["measure"]

SIDE = 2048
JOINTS = np.ones(24, dtype=bool)
PAPER_CELLS = 18_500**2 / 2  # 37,000 frames at 60 Hz are 18,500 at 30 Hz


def measure(bench: Bench) -> Iterator[Row]:
    """Time the distance, a build of all the clips there are, and searches in it."""
    store, web = bench.work / "webs.store", bench.work / "clips.web"
    others = bench.clips.parent / "cmu"
    index_files([bench.clips, *([others] if others.is_dir() else [])], store)
    with open_store(store) as snapshot:
        documents = [(p.document, stored_poses(snapshot, p)) for p in snapshot.documents()]
    yield distances(bench, np.concatenate([np.nan_to_num(poses) for _, poses in documents])[:SIDE])

    cost = run_process([PROGRAM, "web", "build", store, "--output", web, "--quiet"])
    info = web_info(web)
    cells = float(str(info["grid_cells"]))
    yield Row(
        f"web of {info['minutes']:.1f} minutes: {cells / 1e6:.0f} M cells, "
        f"{info['path_share']:.1%} of them in paths, {info['megabytes']:.1f} MB; in ten minutes "
        f"of motion {cost.seconds / cells * PAPER_CELLS:.0f} s",
        cost.seconds,
        wanted="under a minute for ten minutes",
    )

    with open_store(store) as snapshot:
        opened, _ = open_web(web, snapshot)
    longest = max((document for document, _ in documents), key=lambda one: one.frames)
    query = Stretch(longest.name, 0, min(45, longest.frames))
    once, often = SearchRules(epsilon=0.18), SearchRules(epsilon=0.25, most=100)
    graph, _ = search_web(opened, query, often, 30.0)
    times = interleaved(
        {
            "once": lambda: search_once(opened, query, once),
            "often": lambda: search_web(opened, query, often, 30.0),
        },
        bench.rounds,
    )
    yield Row("a query of 1.5 s, one step", times["once"], wanted="under 5 ms")
    yield Row(
        f"the same, many steps: {len(graph.nodes) - 1} matches, {len(graph.edges)} edges",
        times["often"],
        wanted="under 0.5 s for 100 matches",
    )


def distances(bench: Bench, poses: np.ndarray) -> Row:
    """Compare distances with three bare products of the same sizes."""
    one = frame_clouds(poses, JOINTS, 10)
    other = frame_clouds(poses[::-1], JOINTS, 10)  # not itself: that would be a cheaper product
    pairs = ((one.floor, other.floor), (one.floor, other.turned), (one.heights, other.heights))
    times = interleaved(
        {
            "ours": lambda: distance_grid(one, other),
            "limit": lambda: [left @ right.T for left, right in pairs],
        },
        bench.rounds,
    )
    return Row(
        f"distances of {len(poses)} x {len(poses)} frames",
        times["ours"],
        limit="the bare matrix products",
        least=times["limit"],
        wanted="at most twice the limit",
    )
