"""Print the table of speeds: ``make bench``.

Every figure is a ratio of two things measured in turn in this run, since machines differ and
drift. Motion comes from the folder named by MOCAP_DATA (an ``hdm05`` folder of AMC clips, a
``bandai`` folder of BVH), else from the project's own fixtures.
"""

import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bench import alignment, indexing, queries, reading, startup, templates

FIXTURES = Path("build/fixtures")


@dataclass(frozen=True)
class Corpus:
    """Where the motion for measurements lies."""

    amc: Path
    bvh: Path
    clips: Path
    many: Path
    name: str


def main() -> None:
    """Measure and print, a section at a time; names of sections may be given."""
    corpus = find_corpus()
    print(f"motion: {corpus.name}; {os.cpu_count()} cores\n")
    print("| what | ours | the peer | ratio |\n| --- | --- | --- | --- |")
    sections = {
        "reading": reading.measure,
        "indexing": indexing.measure,
        "startup": startup.measure,
        "queries": queries.measure,
        "templates": templates.measure,
        "alignment": alignment.measure,
    }
    with tempfile.TemporaryDirectory(prefix="mocapidx-bench-") as work:
        for name in sys.argv[1:] or sections:
            for row in sections[name](corpus, Path(work)):
                print("| " + " | ".join(row) + " |", flush=True)


def find_corpus() -> Corpus:
    """Take real motion where there is some, else what the project generates."""
    data = Path(os.environ.get("MOCAP_DATA", "../shared/data"))
    if (data / "hdm05").is_dir():
        return Corpus(
            largest(data.rglob("*.amc")),
            largest((data / "bandai").rglob("*.bvh")),
            data / "hdm05",
            data / "bandai",
            "recorded",
        )
    clips = FIXTURES / "clips"
    return Corpus(
        largest(FIXTURES.rglob("*.amc")),
        largest(FIXTURES.rglob("*.bvh")),
        clips,
        clips,
        "generated",
    )


def largest(paths: Iterator[Path]) -> Path:
    """Give the largest of some files."""
    return max(sorted(paths), key=lambda path: path.stat().st_size)


if __name__ == "__main__":
    main()
