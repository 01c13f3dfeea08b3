"""The archive: fresh processes on a store of a thousand hours, and on smaller ones."""

import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.archive import make_archive
from bench.corpus import PROGRAM, Bench
from bench.matching import learned_templates
from bench.measure import Cost, Growth, run_process, seconds_of
from bench.table import Row, seconds_as_text
from mocapidx.segments.runs import find_runs
from mocapidx.store.read import open_store
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.templates.file import save_templates

__all__ = ["measure"]

COLUMNS = 100  # of a template; the class that comes nearest is looked for
SEGMENTS = 10  # of a query
PARTS = ("upper", "lower", "mix", "all")


def measure(bench: Bench) -> Iterator[Row]:
    """Make archives of 1, 10, ... hours up to the wanted size, and search them."""
    sizes = [hours for hours in (1.0, 10.0, 100.0) if hours < bench.hours] + [bench.hours]
    stores = [bench.work / f"{hours:g}.store" for hours in sizes]
    for hours, store in zip(sizes, stores, strict=True):
        made = make_archive(bench.pool_store(), store, hours)
    yield Row(
        f"make an archive of {sizes[-1]:g} hours: {made.documents:,} documents, "
        f"{made.frames:,} frames, {made.bytes / 1e6:,.0f} MB",
        made.seconds,
    )

    def grown(what: str, command: Callable[[Path], Sequence[str | Path]], wanted: str = "") -> Row:
        return over_sizes(bench, what, sizes, [command(store) for store in stores], wanted)

    yield grown("`info`", lambda store: (PROGRAM, "info", store), "under 0.5 s")
    yield opening(bench, sizes, stores)
    for part in PARTS:
        examples = {store: example(store, part) for store in stores}
        for mode in ("exact", "adaptive"):
            yield grown(
                f"{mode} `query` of {SEGMENTS} segments, --select {part}",
                lambda store, mode=mode, examples=examples, part=part: (
                    *(PROGRAM, "query", store, "--example", examples[store]),
                    *("--select", part, "--mode", mode, "--top", "20"),
                ),
                "under 1 s" if mode == "exact" else "",
            )
    yield from retrieving(bench, grown)


def retrieving(
    bench: Bench, grown: Callable[[str, Callable[[Path], Sequence[str | Path]], str], Row]
) -> Iterator[Row]:
    """Retrieve with one template: alone, by its keyframes, and with rivals."""
    known = learned_templates(bench)
    own = min(known.templates, key=lambda one: abs(len(one.matrix) - COLUMNS))
    alone, together = bench.work / "alone.h5", bench.work / "learned.h5"
    save_templates(alone, replace(known, templates=known.of(own.label)))
    what = f"`retrieve` with a template of {len(own.matrix)} columns"
    for words, path, options, wanted in (
        (what, alone, (), "under 10 s and 500 MB"),
        (f"{what} --keyframes auto", alone, ("--keyframes", "auto"), ""),
        (f"{what} and {len(known.labels) - 1} rivals", together, (), ""),
    ):
        yield grown(
            words,
            lambda store, path=path, options=options: (
                *(PROGRAM, "retrieve", store, "--templates", path),
                *("--class", own.label, "--top", "20", *options),
            ),
            wanted,
        )


def over_sizes(
    bench: Bench,
    what: str,
    sizes: Sequence[float],
    commands: Sequence[Sequence[str | Path]],
    wanted: str,
) -> Row:
    """Run a command on archives of all sizes in turn; tell time and memory on the largest."""
    rounds: list[list[Cost]] = [
        [run_process(command) for command in commands] for _ in range(1 if bench.quick else 3)
    ]
    seconds = [statistics.median(turn[n].seconds for turn in rounds) for n in range(len(sizes))]
    memory = [max(turn[n].megabytes for turn in rounds) for n in range(len(sizes))]
    processor = statistics.median(turn[-1].processor for turn in rounds)
    return Row(
        f"{what}: {described(seconds, memory, sizes)} "
        f"({seconds_as_text(processor)} of the processor)", seconds[-1], wanted=wanted,
        growth=in_hours(sizes, seconds),
    )  # fmt: skip


def described(seconds: Sequence[float], memory: Sequence[float], sizes: Sequence[float]) -> str:
    """Say what each size took."""
    return "; ".join(
        f"{hours:g} h {seconds_as_text(time)}, {megabytes:.0f} MB"
        for hours, time, megabytes in zip(sizes, seconds, memory, strict=True)
    )


def opening(bench: Bench, sizes: Sequence[float], stores: Sequence[Path]) -> Row:
    """Time how long it takes to open a store in a process that has imported everything."""
    seconds = [
        statistics.median(
            seconds_of(lambda store=store: open_store(store).close()) for _ in range(9)
        )
        for store in stores
    ]
    return Row(
        "open the store: "
        + ", ".join(f"{h:g} h {seconds_as_text(s)}" for h, s in zip(sizes, seconds, strict=True)),
        seconds[-1],
        growth=in_hours(sizes, seconds),
    )


def in_hours(sizes: Sequence[float], seconds: Sequence[float]) -> Growth | None:
    """Give the growth from the smallest archive on; None where there is one only."""
    if len(sizes) < 2:
        return None
    return Growth(tuple(round(size / sizes[0]) for size in sizes), tuple(seconds))


def example(store: Path, part: str) -> str:
    """Point at a part of a document of the store that goes through so many segments."""
    with open_store(store) as snapshot:
        mask = store_feature_set(snapshot).select(part)
        placed = snapshot.documents()[3]
        first = placed.frame_offset
        words = snapshot.array(placed.file, "frames/words", first, first + placed.document.frames)
        rate = snapshot.manifest.settings.rate
    _, bounds = find_runs(words & np.uint64(mask))
    middle = len(bounds) // 2
    start, end = bounds[middle] / rate, bounds[middle + SEGMENTS] / rate
    return f"{placed.document.name}@{start:.4f}:{end:.4f}"
