"""Whole processes: help and completion against a bare click, a query against a bare read."""

import os
import statistics
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from bench.corpus import PROGRAM, Bench
from bench.measure import run_process
from bench.table import Row

__all__ = ["measure"]

BARE_CLICK = (sys.executable, "-c", "import click")

BARE_QUERY = """
import sys, pathlib
import click, numpy, pyroaring
for path in sys.argv[1:]:
    pathlib.Path(path).read_bytes()
"""

COMPLETION = {
    "_MOCAPIDX_COMPLETE": "bash_complete",
    "COMP_WORDS": "mocapidx query --sel",
    "COMP_CWORD": "2",
}


def measure(bench: Bench) -> Iterator[Row]:
    """Time ``--help``, completion and a small query."""
    for what, command, environment in (
        ("mocapidx --help", (PROGRAM, "--help"), {}),
        ("mocapidx query --help", (PROGRAM, "query", "--help"), {}),
        ("completion", (PROGRAM,), COMPLETION),
    ):
        ours, bare = side_by_side(bench, command, BARE_CLICK, environment)
        yield Row(what, ours, limit="import click", least=bare, wanted="at most 2 times the limit")
    store = bench.clip_store()
    example = sorted(bench.clips.rglob("*.amc"))[0]
    read = [store / "MANIFEST", *sorted((store / "segments").iterdir()), example]
    query = (PROGRAM, "query", store, "--example", example, "--select", "F17,F18,F20,F21")
    ours, bare = side_by_side(bench, query, (sys.executable, "-c", BARE_QUERY, *read), {})
    yield Row(
        "a query on a small store",
        ours,
        limit="import click, NumPy, pyroaring; read as much",
        least=bare,
        wanted="at most 1.3 times the limit",
    )


def side_by_side(
    bench: Bench,
    command: Sequence[str | Path],
    bare: Sequence[str | Path],
    environment: Mapping[str, str],
) -> tuple[float, float]:
    """Run two commands in turn; the median seconds of each."""
    # What the program sets for itself; the bare process must start as few threads.
    environment = {
        "OPENBLAS_NUM_THREADS": os.environ.get("OPENBLAS_NUM_THREADS", "1"),
        **environment,
    }
    rounds = 9 if bench.quick else 21
    pairs = [
        (run_process(command, environment=environment), run_process(bare, environment=environment))
        for _ in range(rounds + 1)
    ][1:]
    ours, theirs = zip(*pairs, strict=True)
    return statistics.median(o.seconds for o in ours), statistics.median(t.seconds for t in theirs)
