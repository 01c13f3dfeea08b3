"""Whole processes: the help against a bare click, a query against a bare read of its bytes."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bench.measure import paired_ratio, process_seconds
from bench.reading import Row

PROGRAM = str(Path(sys.executable).parent / "mocapidx")

BARE_QUERY = """
import sys, pathlib
import numpy, h5py, pyroaring
for path in sys.argv[1:]:
    pathlib.Path(path).read_bytes()
"""


def measure(corpus: Any, work: Path) -> Iterator[Row]:
    """Time ``--help`` and a small query."""
    ours, theirs, ratio = paired_ratio(
        process_seconds([PROGRAM, "--help"]),
        process_seconds([sys.executable, "-c", "import click"]),
        runs=9,
    )
    yield (
        "mocapidx --help",
        ms(ours),
        f"import click: {ms(theirs)}",
        f"{1 / ratio:.2f} times as long",
    )

    store = work / "startup.store"
    process_seconds([PROGRAM, "index", str(corpus.clips), "--store", str(store)])()
    example = sorted(corpus.clips.rglob("*.amc"))[0]
    read = [str(path) for path in (store / "MANIFEST", *(store / "segments").iterdir(), example)]
    query = [PROGRAM, "query", str(store), "--example", str(example), "--select", "F17,F18,F20,F21"]
    ours, theirs, ratio = paired_ratio(
        process_seconds(query), process_seconds([sys.executable, "-c", BARE_QUERY, *read]), runs=9
    )
    peer = f"imports and reads: {ms(theirs)}"
    yield "a query on a small store", ms(ours), peer, f"{1 / ratio:.2f} times as long"


def ms(seconds: float) -> str:
    """Milliseconds as text."""
    return f"{seconds * 1e3:.0f} ms"
