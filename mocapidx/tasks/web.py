"""Build a match web of the documents of a store; add what is new to one that is there."""

import os
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any, Final

import numpy as np

from mocapidx.errors import Interrupted, ParameterError, StoreError
from mocapidx.graphs.pair_paths import Unit, pair_paths
from mocapidx.graphs.paths import PathRules
from mocapidx.printable import count, shown
from mocapidx.store.manifest import Placed
from mocapidx.store.read import Snapshot, open_store
from mocapidx.store.web import WebDocument, document_identity, read_web
from mocapidx.tasks.parallel import MapFunction, mapping
from mocapidx.tasks.records import Record
from mocapidx.tasks.web_building import Building, Pair, path_totals
from mocapidx.tasks.where import document_facts, meeting, name_facts, name_regex

__all__ = ["WebOptions", "WebProgress", "WebSummary", "build_web", "path_rules", "web_info"]

BATCH_CELLS: Final = 1_000_000_000
"""Cells after which what is done is written, so that an interrupted build goes on from there."""

THREADS: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""What the libraries behind matrix products look at when they are loaded."""

JOB_CELLS: Final = 20_000_000
"""Starting a worker takes as long as comparing so many."""


@dataclass(frozen=True, slots=True)
class WebOptions:
    """Which documents of a store are compared, and how.

    Parameters
    ----------
    where : str, optional
        A condition on documents, by the grammar of `mocapidx.tasks.where`.
    group_by : str, optional
        A key of the documents' facts: only documents of equal value are compared, and those
        without one with none.
    name_pattern : str, optional
        Takes facts for `group_by` from names, by named groups; without it, the facts are those
        that the documents were indexed with.
    rules : PathRules
    jobs : int
        Worker processes.
    batch_cells : int
        Cells of grids after which what is done is written.
    """

    where: str | None = None
    group_by: str | None = None
    name_pattern: str | None = None
    rules: PathRules = field(default_factory=PathRules)
    jobs: int = 1
    batch_cells: int = BATCH_CELLS


@dataclass(frozen=True, slots=True)
class WebProgress:
    """How far a build has come, in pairs of documents and in cells of grids."""

    pairs: int
    all_pairs: int
    cells: int
    all_cells: int


@dataclass(slots=True)
class WebSummary:
    """What one run of `build_web` did.

    Parameters
    ----------
    documents : int
    pairs : int
        In the web, now.
    new_pairs : int
        Compared in this run.
    cells : int
        Of their grids.
    path_cells : int
        Of all paths in the web.
    size : int
        Of the file, in bytes.
    changed_rules : bool
        Whether a web with other rules was there and was built anew.
    seconds : float
    """

    documents: int = 0
    pairs: int = 0
    new_pairs: int = 0
    cells: int = 0
    path_cells: int = 0
    size: int = 0
    changed_rules: bool = False
    seconds: float = 0.0


def path_rules(**values: Any) -> PathRules:
    """Make rules from the values of options.

    Parameters
    ----------
    **values
        Fields of `mocapidx.graphs.paths.PathRules`.

    Returns
    -------
    PathRules

    Raises
    ------
    ParameterError
        If a value is out of its bounds.
    """
    return PathRules(**values)


def build_web(
    store: str | Path,
    output: str | Path,
    options: WebOptions | None = None,
    *,
    progress: Callable[[WebProgress], None] | None = None,
    map_fn: MapFunction | None = None,
) -> WebSummary:
    """Compare the documents of a store with each other; only pairs that are new.

    Equal documents and options give equal bytes, in one run or in several, whatever the jobs.

    Parameters
    ----------
    store : str or Path
    output : str or Path
        The web; where it is there already, what it knows is kept.
    options : WebOptions, optional
    progress : callable, optional
        Called after each part.
    map_fn : callable, optional
        Runs the comparisons, with the shape of ``map``; by default ``options.jobs`` processes.

    Returns
    -------
    WebSummary

    Raises
    ------
    StoreError
        If the store has no poses or is damaged, or `output` is no web.
    ParameterError, WriteError
    """
    options, output = options or WebOptions(), Path(output)
    started = time.perf_counter()
    with open_store(Path(store)) as snapshot:
        chosen = _chosen(snapshot, options)
        building = Building(snapshot, chosen, options.rules, output)
        wanted = _wanted_pairs([placed for _, placed in chosen], options)
        known, changed = building.known_pairs()
        kept = {pair: known[pair] for pair in wanted if pair in known}
        missing = [pair for pair in wanted if pair not in kept]
        summary = WebSummary(len(chosen), len(wanted), len(missing), changed_rules=changed)
        blocks = list(building.blocks(missing))
        all_cells = sum(block.cells for block in blocks)
        summary.cells = all_cells
        workers = _workers(options.jobs, all_cells)
        compare = partial(_compare, rate=building.rate, rules=options.rules)
        done = pending = compared = written = 0
        try:
            with _one_thread(), nullcontext(map_fn) if map_fn else mapping(workers) as apply:
                found = apply(compare, map(building.filled, blocks))
                for block, pieces in zip(blocks, found, strict=True):
                    building.add(block, pieces, kept)
                    done, pending = done + block.cells, pending + block.cells
                    compared += len(block.completes)
                    if pending >= options.batch_cells and done < all_cells:
                        building.write(kept)
                        pending, written = 0, compared
                    if progress is not None:
                        progress(WebProgress(compared, len(missing), done, all_cells))
        except Interrupted as exc:
            message = f"stopped after {count(written, 'pair')}; run again to continue"
            raise Interrupted(exc.signal_number, message) from exc
        if missing or changed or building.differs(kept):
            building.write(kept)
    summary.path_cells = building.path_cells(kept)
    summary.size = output.stat().st_size
    summary.seconds = time.perf_counter() - started
    return summary


def _chosen(snapshot: Snapshot, options: WebOptions) -> list[tuple[WebDocument, Placed]]:
    """List the documents that are compared, ordered by their identities."""
    settings = snapshot.manifest.settings
    if not settings.poses:
        raise StoreError(
            f"{shown(snapshot.path)}: keeps no poses, so its frames can't be compared; index "
            "again without --no-poses"
        )
    placed = snapshot.documents()
    if options.where is not None:
        documents = [entry.document for entry in placed]
        holds = meeting(documents, options.where, settings.rate)
        placed = [entry for entry, good in zip(placed, holds, strict=True) if good]
    if not placed:
        condition = "" if options.where is None else " that meets the condition"
        raise ParameterError(f"{shown(snapshot.path)}: holds no document{condition}")
    named = [
        WebDocument(
            document_identity(entry.document, settings.rate),
            entry.document.name,
            entry.document.frames,
        )
        for entry in placed
    ]
    chosen = zip(named, placed, strict=True)
    return sorted(chosen, key=lambda entry: entry[0].identity)


def _wanted_pairs(placed: Sequence[Placed], options: WebOptions) -> list[Pair]:
    """List the pairs of documents to compare, each document with itself too."""
    numbers = range(len(placed))
    if options.group_by is None:
        if options.name_pattern is not None:
            raise ParameterError("--name-pattern takes facts for --group-by; give that too")
        return list(combinations_with_replacement(numbers, 2))
    groups: dict[str, list[int]] = {}
    keys = set()
    for number, facts in zip(numbers, _facts(placed, options.name_pattern), strict=True):
        keys |= set(facts)
        value = facts.get(options.group_by.lower())
        if value is not None:
            groups.setdefault(str(value), []).append(number)
    if not groups:
        raise ParameterError(
            f"no document has '{shown(options.group_by)}'; there are "
            f"{', '.join(map(shown, sorted(keys)))} (--name-pattern takes more from the names)"
        )
    pairs = (combinations_with_replacement(members, 2) for members in groups.values())
    return sorted(pair for group in pairs for pair in group)


def _facts(placed: Sequence[Placed], pattern: str | None) -> Iterator[Mapping[str, Any]]:
    regex: re.Pattern[str] | None = None if pattern is None else name_regex(pattern)
    for entry in placed:
        facts = document_facts(entry.document, 1.0)
        yield {**facts, **name_facts(regex, entry.document.name)}


def _workers(jobs: int, cells: int) -> int:
    """Say how many processes are worth their start.

    Matrix products on several threads differ in the last bits. Where this process has several,
    all products are left to others that have one.
    """
    try:
        alone = len(os.listdir("/proc/self/task")) == 1
    except OSError:
        alone = False
    return max(1 if alone or not cells else 2, min(jobs, cells // JOB_CELLS + 1))


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let processes that are started here multiply matrices on one thread each."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _compare(
    filled: tuple[list[Unit], list[Unit], list[Pair]], rate: float, rules: PathRules
) -> list[bytes]:
    """Find the paths of a block; runs in any process."""
    return pair_paths(*filled, rate, rules)


def web_info(web: str | Path) -> Record:
    """Say in numbers what a web holds.

    Parameters
    ----------
    web : str or Path

    Returns
    -------
    mapping

    Raises
    ------
    StoreError
        If it is no web, or damaged.
    """
    held = read_web(Path(web))
    numbers = np.flatnonzero(held.pieces[:, 3]).tolist()
    chains, cells, bridges, inner = path_totals(map(held.piece, numbers), Path(web))
    frames = sum(known.frames for known in held.documents)
    pairs = np.unique(held.pieces[:, :2], axis=0)
    lengths = np.array([-(-known.frames // held.stride) for known in held.documents] or [0], float)
    first, second = pairs.T
    grid = int((lengths[first] * lengths[second] / np.where(first == second, 2, 1)).sum())
    size = Path(web).stat().st_size
    return {
        "documents": len(held.documents),
        "pairs": len(pairs),
        "frames": frames,
        "minutes": round(frames / held.rate / 60, 3),
        "rate_hz": held.rate,
        "grid_rate_hz": held.rate / held.stride,
        "grid_cells": grid,
        "chains": chains,
        "bridges": bridges,
        "path_cells": cells + inner,
        "path_share": round((cells + inner) / max(grid, 1), 6),
        "megabytes": round(size / 1e6, 3),
        "bytes_a_path_cell": round(size / max(cells + inner, 1), 3),
        **held.rules,
    }
