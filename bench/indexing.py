"""Indexing whole folders: source frames a second and core, two workers, growth, memory."""

import shutil
import statistics
from collections.abc import Callable, Iterator
from pathlib import Path

from bench.corpus import PROGRAM, Bench
from bench.measure import Cost, grow, interleaved, run_process
from bench.table import Row
from mocapidx.store.read import open_store
from mocapidx.tasks.index import index_files

__all__ = ["measure"]

FEWEST = 2  # clips that growth begins with


def measure(bench: Bench) -> Iterator[Row]:
    """Index the clips into a store with poses, as a process with one worker and with two."""
    clips = sorted(bench.clips.rglob("*.amc"))
    store = bench.work / "indexing.store"
    size = sum(path.stat().st_size for path in clips) / 1e6

    def index(paths: list[Path]) -> Callable[[], object]:
        def run() -> object:
            shutil.rmtree(store, ignore_errors=True)
            return index_files(paths, store)

        return run

    bare = interleaved(
        {
            "ours": index([bench.clips]),
            "limit": lambda: [path.read_bytes().count(b"\n") for path in clips],
        },
        bench.rounds,
    )
    with open_store(store) as snapshot:
        frames = sum(entry.document.source_frames for entry in snapshot.documents())
    times = [n for n in bench.times if n * FEWEST <= len(clips)]
    growth = grow(lambda n: index(clips[: n * FEWEST]), times, bench.rounds)
    yield Row(
        f"index {len(clips)} clips, {size:.0f} MB, with poses, in one process: "
        f"{frames / bare['ours']:,.0f} source frames/s",
        bare["ours"],
        limit="read, count the line ends",
        least=bare["limit"],
        growth=growth,
        wanted="at least 20,000 source frames/s",
    )
    yield from workers(bench, clips, frames)


def workers(bench: Bench, clips: list[Path], frames: int) -> Iterator[Row]:
    """Index copies of the clips with one worker process and with two."""
    copies = 1 if bench.quick else 4
    folder = bench.work / "copies"
    for copy in range(copies):
        shutil.copytree(bench.clips, folder / f"{copy:02d}", copy_function=shutil.copyfile)
    taken: dict[int, list[Cost]] = {1: [], 2: []}
    for _ in range(3):
        for jobs, costs in taken.items():
            store = bench.work / "copies.store"
            shutil.rmtree(store, ignore_errors=True)
            command = [PROGRAM, "index", folder, "--store", store, "--jobs", str(jobs), "--quiet"]
            costs.append(run_process(command))
    one, two = (statistics.median(cost.seconds for cost in taken[jobs]) for jobs in (1, 2))
    peak = max(cost.megabytes for cost in taken[1])
    yield Row(
        f"index {copies * len(clips)} clips, two workers: {copies * frames / two:,.0f} "
        f"source frames/s; one worker's process takes {peak:.0f} MB",
        two,
        "one worker",
        one,
        wanted="at least 1.7 times one",
    )
    shutil.rmtree(folder)
