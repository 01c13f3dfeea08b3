"""Verify a store, down to every inverted list; repair what can be rebuilt."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.features.featureset import PARTS, FeatureSet
from mocapidx.index.build import build_runs
from mocapidx.index.postings import encode_index
from mocapidx.store.aside import lost_sources
from mocapidx.store.files import DamagedError
from mocapidx.store.manifest import Document, SegmentFile
from mocapidx.store.read import Snapshot, read_manifest
from mocapidx.store.schema import SEGMENTS, SIGMA
from mocapidx.store.sigma import drop_sigma, sigma_fault
from mocapidx.store.verify import Problem, check_blocks, check_digests, check_schemas
from mocapidx.store.write import writing
from mocapidx.tasks.compact import merged_batch
from mocapidx.tasks.segment_sources import store_feature_set

__all__ = ["VerifyReport", "verify_store"]

ATTEMPTS: Final = 5


@dataclass(frozen=True, slots=True)
class VerifyReport:
    """What `verify_store` found and did.

    Parameters
    ----------
    documents, files, size : int
        Live documents, segment files and bytes that were looked at.
    problems : tuple of str
        One line each, with the file; empty for a sound store.
    rebuilt : tuple of Path
        Index files that were built again from their HDF5 file.
    set_aside : tuple of Path
        Damaged files, under their new names.
    at_stake : int
        Live documents in the damaged files, which a repair takes out of the store.
    lost : tuple of Path
        Motion files whose documents were in damaged files, of this repair or an earlier one, and
        are in the store no more: to be indexed again.
    """

    documents: int
    files: int
    size: int
    problems: tuple[str, ...]
    rebuilt: tuple[Path, ...] = ()
    set_aside: tuple[Path, ...] = ()
    at_stake: int = 0
    lost: tuple[Path, ...] = ()


def verify_store(
    path: str | Path,
    *,
    quick: bool = False,
    repair: bool = False,
    lock_timeout: float = 0.0,
    use_lock: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> VerifyReport:
    """Look for damage in a store.

    Parameters
    ----------
    path : str or Path
        Folder of the store.
    quick : bool
        Compare sizes and digests of whole files only. Otherwise also every dataset's blocks
        and metadata, the HDF5 files with the closed schema (by HDF5 itself, in a child process
        with limits), the runs with the feature words and every inverted list with the runs.
    repair : bool
        Build damaged indexes again, set segment files aside whose HDF5 file is damaged, and
        remove damaged measurements, which are made again when needed.
    lock_timeout : float
        How long a repair waits for another writer, in seconds.
    use_lock : bool
        False repairs without a lock, at the caller's risk.
    progress : callable, optional
        Called with the steps done and their number.

    Returns
    -------
    VerifyReport
        A damaged segment file is a problem in it, no error.

    Raises
    ------
    StoreError
        If there is no store or its manifest is damaged.
    LockedError, WriteError
        If a repair can't write.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 5.1, for what the lists hold.
    """
    path = Path(path)
    report = progress or (lambda done, total: None)
    if repair:
        return _repair(path, quick, lock_timeout, use_lock, report)
    for attempt in range(1, ATTEMPTS + 1):
        with Snapshot(path, read_manifest(path)) as snapshot:
            problems = _problems(snapshot, quick, report)
            # A merge beside us may have taken files away; then they are no problem.
            if not problems or attempt == ATTEMPTS or read_manifest(path) == snapshot.manifest:
                break
    return _summary(snapshot, problems, [entry.document for entry in snapshot.documents()])


def _repair(
    path: Path, quick: bool, lock_timeout: float, use_lock: bool, report: Callable[[int, int], None]
) -> VerifyReport:
    with writing(path, command="verify", lock_timeout=lock_timeout, use_lock=use_lock) as writer:
        before = writer.snapshot
        problems = _problems(before, quick, report)
        broken = {problem.number for problem in problems if not problem.only_index}
        stale = {problem.number for problem in problems} - broken
        damaged = [file for file in before.files if file.number in broken]
        set_aside = writer.set_aside(damaged) if damaged else []
        rebuilt = []
        for file in before.files:
            if file.number in stale:
                batch = merged_batch(before, [file], store_feature_set(before, checked=True))
                after = writer.replace(batch, [file])
                rebuilt.append(path / SEGMENTS / after.files[-1].names[1])
        held = writer.documents()
    dropped = [each for file in damaged for each in file.documents if each.live]
    summary = _summary(before, problems, held, dropped, tuple(rebuilt), tuple(set_aside))
    if sigma_fault(path) is not None:
        drop_sigma(path)
    return summary


def _summary(
    snapshot: Snapshot,
    problems: list[Problem],
    held: Sequence[Document],
    dropped: Sequence[Document] = (),
    rebuilt: tuple[Path, ...] = (),
    set_aside: tuple[Path, ...] = (),
) -> VerifyReport:
    sigma = sigma_fault(snapshot.path)
    lines = [f"{snapshot.path / 'segments' / found.name}: {found.what}" for found in problems]
    if sigma is not None:
        lines.append(f"{snapshot.path / SIGMA}: {sigma}; it is measured again when needed")
    broken = {problem.number for problem in problems if not problem.only_index}
    return VerifyReport(
        documents=len(snapshot.documents()),
        files=len(snapshot.files),
        size=sum(file.h5.size + file.idx.size for file in snapshot.files),
        problems=tuple(lines),
        rebuilt=rebuilt,
        set_aside=set_aside,
        at_stake=sum(entry.file.number in broken for entry in snapshot.documents()),
        lost=lost_sources(snapshot.path, held, dropped),
    )


def _problems(snapshot: Snapshot, quick: bool, report: Callable[[int, int], None]) -> list[Problem]:
    total = len(snapshot.files)
    found: list[Problem] = []
    for done, file in enumerate(snapshot.files):
        report(done, 2 * total)
        found += check_digests(snapshot.path, [file])
    if not quick:
        found += check_schemas(snapshot.path, _sound(snapshot.files, found))
        feature_set = store_feature_set(snapshot, checked=True)
        for done, file in enumerate(_sound(snapshot.files, found), start=total):
            report(done, 2 * total)
            found += _contents(snapshot, file, feature_set, {problem.name for problem in found})
    report(2 * total, 2 * total)
    return found


def _sound(files: Sequence[SegmentFile], found: Sequence[Problem]) -> list[SegmentFile]:
    """Choose the files of which no HDF5 file is known to be damaged."""
    broken = {problem.number for problem in found if not problem.only_index}
    return [file for file in files if file.number not in broken]


def _contents(
    snapshot: Snapshot, file: SegmentFile, feature_set: FeatureSet, known: Collection[str]
) -> list[Problem]:
    """Look into a segment file whose HDF5 file is the one that was written."""
    found = [problem for problem in check_blocks(snapshot, file) if problem.name not in known]
    if _sound([file], found):
        check_index = not found and file.names[1] not in known
        found += _relations(snapshot, file, feature_set, check_index)
    return found


def _relations(
    snapshot: Snapshot, file: SegmentFile, feature_set: FeatureSet, check_index: bool
) -> Iterator[Problem]:
    """Build runs and lists again from the feature words and compare."""
    h5_name, idx_name = file.names
    try:
        words = snapshot.array(file, "frames/words")
        bounds = pairwise(accumulate((entry.frames for entry in file.documents), initial=0))
        documents = [words[start:stop] for start, stop in bounds]
        runs = {part: build_runs(documents, feature_set.part_mask(part)) for part in PARTS}
        for part, expected in runs.items():
            for name, values in (("starts", expected.starts), ("words", expected.words)):
                if not np.array_equal(snapshot.array(file, f"runs/{part}/{name}"), values):
                    what = f"runs/{part}/{name} does not follow from frames/words"
                    yield Problem(file.number, h5_name, what)
        if check_index:
            index, _ = encode_index({part: expected.words for part, expected in runs.items()})
            if index != snapshot.index_bytes(file, 0, file.idx.size):
                yield Problem(file.number, idx_name, "its lists are not those of the runs")
    except DamagedError as exc:
        yield Problem(file.number, exc.name, exc.what)
