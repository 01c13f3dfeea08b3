"""Queries by one example that choose features for themselves."""

from collections.abc import Callable, Iterator

from bench.archive import make_archive
from bench.corpus import Bench
from bench.measure import grow
from bench.table import Row
from mocapidx.tasks.oneshot import query_auto

__all__ = ["measure"]

HOURS = 0.5


def measure(bench: Bench) -> Iterator[Row]:
    """Time the whole job on archives of half an hour and of 4, 16 and 64 times as much."""
    example = sorted(bench.clips.rglob("*.amc"))[0]

    def ask(times: int) -> Callable[[], object]:
        store = bench.work / f"oneshot{times}.store"
        make_archive(bench.pool_store(), store, HOURS * times)
        return lambda: query_auto(store, example)

    growth = grow(ask, bench.times, 1 if bench.quick else 3)
    yield Row(
        f"one-shot query by a clip in {HOURS * 60:.0f} minutes",
        growth.seconds[0],
        growth=growth,
    )
