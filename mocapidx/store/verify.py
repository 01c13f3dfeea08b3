"""Look for damage in a store: sizes, digests, the closed HDF5 schema.

What the parts say of each other (runs of words, lists of runs) is checked by
`mocapidx.tasks.verify`, which knows how to build them.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mocapidx.errors import MocapidxError
from mocapidx.store import schema
from mocapidx.store.encoding import meta_json
from mocapidx.store.files import DamagedError, open_segment, read_exactly, unreadable
from mocapidx.store.manifest import FileRecord, SegmentFile, file_digest
from mocapidx.store.read import Snapshot

__all__ = ["Problem", "check_blocks", "check_digests", "check_schemas"]

PIECE: Final = 1 << 24
TIMEOUT: Final = 600.0  # by the clock, for a child that may have 20 s of a processor
TOGETHER: Final = 100  # files that a child is asked about


@dataclass(frozen=True, slots=True)
class Problem:
    """Damage in one file of a store.

    Parameters
    ----------
    number : int
        Of the segment file.
    name : str
        Of the file in the folder of segments.
    what : str
        What is wrong.
    """

    number: int
    name: str
    what: str

    @property
    def only_index(self) -> bool:
        """Whether only the index is concerned, which can be rebuilt from the HDF5 file."""
        return self.name.endswith(".idx")


def check_digests(path: Path, files: Iterable[SegmentFile]) -> Iterator[Problem]:
    """Compare every file with its size and digest in the manifest.

    Parameters
    ----------
    path : Path
        Folder of the store.
    files : iterable of SegmentFile
        Which to check.

    Yields
    ------
    Problem
        At most one a file.

    Raises
    ------
    StoreError
        If the system refuses to read a file that is there.
    """
    for file in files:
        for name, record in zip(file.names, (file.h5, file.idx), strict=True):
            what = _digest_fault(path, name, record)
            if what:
                yield Problem(file.number, name, what)


def check_blocks(snapshot: Snapshot, file: SegmentFile) -> Iterator[Problem]:
    """Compare the blocks of each dataset, the metadata and the head of the index.

    Parameters
    ----------
    snapshot : Snapshot
        Of the store.
    file : SegmentFile
        One of its files.

    Yields
    ------
    Problem
        At most one a dataset.
    """
    for path, dataset in sorted(file.datasets.items()):
        rows = max(1, PIECE // schema.column(path).row_bytes)
        try:
            for start in range(0, dataset.shape[0], rows):
                snapshot.array(file, path, start, min(start + rows, dataset.shape[0]))
        except DamagedError as exc:
            yield Problem(file.number, exc.name, exc.what)
    try:
        meta = snapshot.array(file, schema.META.path).tobytes()
        if meta != meta_json(file.documents, snapshot.manifest.settings):
            yield Problem(file.number, file.names[0], "its metadata contradicts the manifest")
        snapshot.index_head(file)
    except DamagedError as exc:
        yield Problem(file.number, exc.name, exc.what)


def check_schemas(path: Path, files: Iterable[SegmentFile]) -> Iterator[Problem]:
    """Open every HDF5 file with HDF5, in a child with limits, and compare it with the format.

    Parameters
    ----------
    path : Path
        Folder of the store.
    files : iterable of SegmentFile
        Which to check; they should have passed `check_digests`.

    Yields
    ------
    Problem
        At most one a file; a child that crashes, hangs or runs out of memory is one.

    Raises
    ------
    MocapidxError
        If the child can't start, is killed or gets no time: that says nothing about the files.
    """
    waiting = list(files)
    while waiting:
        asked = waiting[:TOGETHER]
        answers, fate = _ask_child(path, asked)
        for file, answer in zip(asked, answers, strict=False):
            if answer is not None:
                yield Problem(file.number, file.names[0], answer)
        waiting = waiting[len(answers) :]
        if len(answers) < len(asked):
            file = waiting.pop(0)
            yield Problem(file.number, file.names[0], f"HDF5 breaks on it ({fate})")


def _ask_child(path: Path, files: Sequence[SegmentFile]) -> tuple[list[str | None], str]:
    """Give the child's answers as far as it came, and how it ended."""
    question = [
        [
            str(path / schema.SEGMENTS / file.names[0]),
            {name: [dataset.shape, dataset.offset] for name, dataset in file.datasets.items()},
        ]
        for file in files
    ]
    child = [sys.executable, "-P", "-m", "mocapidx.store.closed"]
    # Threads of a linear algebra library would only use up the child's address space.
    settings = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "HDF5_USE_FILE_LOCKING": "FALSE"}
    try:
        done = subprocess.run(
            child,
            input=json.dumps(question).encode("ascii"),
            capture_output=True,
            env=settings,
            timeout=TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired as exc:
        raise _unchecked(path, "gave no answer") from exc
    ready, *answers = done.stdout.split(b"\n")[:-1] or [b"not"]
    if ready:
        raise _unchecked(path, f"could not start (exit status {done.returncode})")
    if done.returncode == -signal.SIGKILL:  # its own limits send other signals
        raise _unchecked(path, "was killed, perhaps for want of memory")
    return [json.loads(line) for line in answers], f"exit status {done.returncode}"


def _unchecked(path: Path, what: str) -> MocapidxError:
    return MocapidxError(
        f"{path}: the process that opens HDF5 files {what}; nothing is known about them and "
        "nothing was changed; run again where there is more memory and time, or with --quick"
    )


def _digest_fault(path: Path, name: str, record: FileRecord) -> str | None:
    digest = file_digest()
    try:
        descriptor = open_segment(path, name, record)
        try:
            for start in range(0, record.size, PIECE):
                digest.update(read_exactly(descriptor, start, min(PIECE, record.size - start)))
        finally:
            os.close(descriptor)
    except DamagedError as exc:
        return exc.what
    except (OSError, EOFError) as exc:
        fault = unreadable(path, name, exc)
        if isinstance(fault, DamagedError):
            return fault.what
        raise fault from exc
    return None if digest.hexdigest() == record.digest else "it does not match its digest"
