"""The motion that is measured on, and how much of it."""

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mocapidx.tasks.index import IndexOptions, index_files

__all__ = ["PROGRAM", "Bench", "find_bench"]

FIXTURES = Path("build/fixtures")
PROGRAM = str(Path(sys.executable).parent / "mocapidx")


@dataclass(frozen=True)
class Bench:
    """Where the motion lies, where there is room, and how long everything may take.

    Parameters
    ----------
    name : str
        ``recorded`` or ``generated``.
    amc, bvh : Path
        The largest file of each kind.
    clips : Path
        A folder of AMC clips, a folder a class.
    folders : tuple of Path
        Folders of motion that the words of the archive come from.
    work : Path
        An empty folder.
    quick : bool
        Less work and fewer rounds.
    hours : float
        Of the archive.
    """

    name: str
    amc: Path
    bvh: Path
    clips: Path
    folders: tuple[Path, ...]
    work: Path
    quick: bool
    hours: float

    @property
    def rounds(self) -> int:
        """Rounds of the medians."""
        return 3 if self.quick else 5

    @property
    def times(self) -> tuple[int, ...]:
        """How many times the work growth is measured on."""
        return (1, 4, 16) if self.quick else (1, 4, 16, 64)

    @property
    def minutes(self) -> int:
        """Minutes of feature words to match and to query."""
        return 30 if self.quick else 210

    def clip_store(self) -> Path:
        """Give a store of the clips, with poses; made once."""
        return self._store("clips.store", (self.clips,), poses=True)

    def pool_store(self) -> Path:
        """Give a store of all motion, without poses; made once."""
        return self._store("pool.store", self.folders, poses=False)

    def _store(self, name: str, folders: tuple[Path, ...], poses: bool) -> Path:
        store = self.work / name
        if not store.exists():
            index_files(folders, store, IndexOptions(poses=poses, skip_bad=True))
        return store


def find_bench(work: Path, quick: bool, hours: float) -> Bench:
    """Take real motion where the folder named by MOCAP_DATA has some, else what is generated."""
    data = Path(os.environ.get("MOCAP_DATA", "../shared/data"))
    folders = tuple(data / name for name in ("hdm05", "cmu", "exercises", "bandai"))
    if not folders[0].is_dir():
        clips = FIXTURES / "clips"
        amc, bvh = (largest(FIXTURES.rglob(f"*.{kind}")) for kind in ("amc", "bvh"))
        return Bench("generated", amc, bvh, clips, (FIXTURES / "clips",), work, quick, hours)
    here = tuple(folder for folder in folders if folder.is_dir())
    amc = largest(path for folder in here for path in folder.rglob("*.amc"))
    bvh = largest(path for folder in here for path in folder.rglob("*.bvh"))
    return Bench("recorded", amc, bvh, folders[0], here, work, quick, hours)


def largest(paths: Iterator[Path]) -> Path:
    """Give the largest of some files."""
    return max(sorted(paths), key=lambda path: path.stat().st_size)
