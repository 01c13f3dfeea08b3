"""Print the table of speeds: ``make bench``.

Every ratio is of things measured in turn in this run, since machines differ and drift. Motion
comes from the folder named by MOCAP_DATA (``../shared/data`` by default: folders of AMC clips
and BVH), else from the project's own fixtures. Sections may be named to run these alone.
"""

import argparse
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from bench import (
    alignment,
    indexing,
    large,
    matching,
    oneshot,
    picture,
    poses,
    queries,
    reading,
    scaling,
    startup,
    webs,
)
from bench.corpus import find_bench
from bench.table import HEADER, Row, line
from mocapidx.kernels.choice import kernels_in_use

SECTIONS: dict[str, Callable[..., Iterator[Row]]] = {
    "reading": reading.measure,
    "poses": poses.measure,
    "indexing": indexing.measure,
    "startup": startup.measure,
    "queries": queries.measure,
    "matching": matching.measure,
    "annotation": matching.measure_annotation,
    "oneshot": oneshot.measure,
    "alignment": alignment.measure,
    "webs": webs.measure,
    "archive": large.measure,
    "scaling": scaling.measure,
}


def main() -> None:
    """Measure and print a section at a time; write the whole at the end."""
    given = arguments()
    names = given.sections or list(SECTIONS)
    hours = given.hours if given.hours is not None else (10.0 if given.quick else 1000.0)
    with tempfile.TemporaryDirectory(prefix="mocapidx-bench-", dir=given.work) as work:
        bench = find_bench(Path(work), given.quick, hours)
        rows: dict[str, list[Row]] = {}
        lines = [title(bench.name, given.quick), "", HEADER]
        print("\n".join(lines), flush=True)
        for name in names:
            rows[name] = []
            for row in SECTIONS[name](bench):
                rows[name].append(row)
                lines.append(line(row))
                print(lines[-1], flush=True)
    if given.output is not None:
        given.output.mkdir(parents=True, exist_ok=True)
        (given.output / "results.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
        picture.draw(rows, given.output / "results.png")


def arguments() -> argparse.Namespace:
    """Understand the command line."""
    parser = argparse.ArgumentParser(prog="python -m bench.run", description=__doc__)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(SECTIONS))
    parser.add_argument("--quick", action="store_true", help="less work, under two minutes")
    parser.add_argument("--hours", type=float, help="of the archive; default 1000, quick 10")
    parser.add_argument("--work", type=Path, help="where there is room; default the system's")
    parser.add_argument("--output", type=Path, help="folder for results.md and results.png")
    given = parser.parse_args()
    unknown: Sequence[str] = sorted(set(given.sections) - set(SECTIONS))
    if unknown:
        parser.error(f"no section '{unknown[0]}'; there are {', '.join(SECTIONS)}")
    return given


def title(motion: str, quick: bool) -> str:
    """Say what was measured on."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return (
        f"Python {platform.python_version()}, NumPy {np.__version__}, {sys.platform} on "
        f"{platform.machine()}, {cores} cores, kernels: {kernels_in_use()}, {motion} motion"
        + (", quick" if quick else "")
        + (f"; {os.getloadavg()[0]:.1f} processes ran before" if hasattr(os, "getloadavg") else "")
    )


if __name__ == "__main__":
    main()
