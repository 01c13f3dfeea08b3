"""From one worker to two on a local cluster: index, annotate, retrieve; what a cluster costs."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from bench.archive import make_archive
from bench.corpus import Bench
from bench.matching import learned_templates
from bench.measure import interleaved, seconds_of
from bench.table import Row
from mocapidx.tasks.annotate import AnnotateOptions, annotate_motion
from mocapidx.tasks.cluster import cluster_mapping
from mocapidx.tasks.index import index_files
from mocapidx.tasks.parallel import MapFunction
from mocapidx.tasks.retrieve import retrieve

__all__ = ["measure"]

CLASSES = 10
HOURS = 100.0
WANTED = "at least 1.7 times one worker"

Job = Callable[[MapFunction], object]


def measure(bench: Bench) -> Iterator[Row]:
    """Time each job on clusters that are there already, and how long one takes to come."""
    hours = HOURS / 4 if bench.quick else HOURS
    store = bench.work / "scaling.store"
    make_archive(bench.pool_store(), store, hours)
    with ExitStack() as clusters:
        one = clusters.enter_context(cluster_mapping("local:1"))
        two, comes = coming(clusters, "local:2")
        yield Row("start a local cluster of two processes", comes)
        for what, job in jobs(bench, store, hours):
            seconds = interleaved({"1": partial(job, one), "2": partial(job, two)}, 3)
            yield Row(
                f"{what}, two workers of a cluster",
                *(seconds["2"], "one worker", seconds["1"]),
                wanted=WANTED,
            )


def coming(clusters: ExitStack, scheduler: str) -> tuple[MapFunction, float]:
    """Start a cluster; also say how long that took."""
    found: list[MapFunction] = []
    context = cluster_mapping(scheduler)
    comes = seconds_of(lambda: found.append(clusters.enter_context(context)))
    return found[0], comes


def jobs(bench: Bench, store: Path, hours: float) -> Iterator[tuple[str, Job]]:
    """Give the jobs, each as a function of what spreads it."""
    copies = bench.work / "scaling"
    for copy in range(1 if bench.quick else 4):
        shutil.copytree(bench.clips, copies / f"{copy:02d}", copy_function=shutil.copyfile)
    clips = sum(1 for _ in copies.rglob("*.amc"))
    known = learned_templates(bench)
    options = AnnotateOptions(classes=known.labels[:CLASSES])
    label = known.labels[0]

    def index(apply: MapFunction) -> object:
        made = bench.work / "scaled.store"
        shutil.rmtree(made, ignore_errors=True)
        return index_files([copies], made, map_fn=apply)

    yield f"index {clips} clips with poses", index
    yield (
        f"annotate {hours:g} hours with {len(options.classes)} classes",
        lambda apply: annotate_motion([store], known, options, map_fn=apply),
    )
    yield (
        f"retrieve a class in {hours:g} hours, {len(known.labels) - 1} rivals",
        lambda apply: retrieve(store, known, label, map_fn=apply),
    )
