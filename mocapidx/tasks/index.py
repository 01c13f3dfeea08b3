"""Bring a store up to date with the motion files below some folders; merge its files."""

import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import FormatError, Interrupted
from mocapidx.features.featureset import FeatureSet, load_feature_set
from mocapidx.printable import count, shown
from mocapidx.store.files import DamagedError
from mocapidx.store.manifest import Document, StoreSettings
from mocapidx.store.read import read_manifest
from mocapidx.store.schema import MANIFEST
from mocapidx.store.write import Batch, Writer, check_writable, writing
from mocapidx.tasks.batch import make_batch
from mocapidx.tasks.compact import merge_files, small_files
from mocapidx.tasks.parallel import MapFunction, mapping
from mocapidx.tasks.prepare import (
    Item,
    Outcome,
    Prepared,
    Refused,
    Unchanged,
    is_unchanged,
    prepare_item,
)
from mocapidx.tasks.prune import gone_documents
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.tasks.sources import Source, find_sources
from mocapidx.tasks.where import name_facts, name_regex

__all__ = ["IndexOptions", "IndexProgress", "IndexSummary", "index_files"]

MOST_SEGMENT_FILES: Final = 20
"""Opening 200 takes 75 ms, so small ones are merged beyond this."""

BATCH_BYTES: Final = 128 << 20
"""What waits in memory to be committed together, and the size up to which files are merged."""

FEATURE_SET: Final = "f39"
"""Of a new store, as its rate."""

RATE: Final = 30.0

JOBS_PER_WORKER: Final = 8
"""Starting a worker takes as long as reading a few files."""


@dataclass(frozen=True, slots=True)
class IndexOptions:
    """How motion files become documents of a store.

    Parameters
    ----------
    feature_set : str, optional
        Name of a shipped feature set or path of a TOML file; by default the store's, f39 in a
        new one.
    rate : float, optional
        Frames a second, in Hz; by default the store's, 30 in a new one.
    poses : bool
        Keep the joint positions in the store.
    prune : bool
        Drop documents whose file is gone, where the folder they came from still exists.
    skip_bad : bool
        Go on after a file that can't be used.
    read : ReadOptions
        How motion files are understood.
    root : Path, optional
        Names are relative to this folder.
    name_pattern : str, optional
        Takes facts from names: a regular expression with named groups.
    jobs : int
        Worker processes.
    lock_timeout : float
        Seconds to wait for another writer.
    use_lock : bool
        False: write without a lock, at the owner's risk.
    batch_bytes : int
        Bytes of words and poses that are committed together.
    """

    feature_set: str | None = None
    rate: float | None = None
    poses: bool = True
    prune: bool = False
    skip_bad: bool = False
    read: ReadOptions = field(default_factory=ReadOptions)
    root: Path | None = None
    name_pattern: str | None = None
    jobs: int = 1
    lock_timeout: float = 0.0
    use_lock: bool = True
    batch_bytes: int = BATCH_BYTES


@dataclass(frozen=True, slots=True)
class IndexProgress:
    """How far indexing has come: files done of all to be read, and the frames in them."""

    done: int
    total: int
    frames: int


@dataclass(slots=True)
class IndexSummary:
    """What one run of `index_files` did.

    Parameters
    ----------
    added, changed, unchanged, removed : int
        Documents.
    kept : mapping of Path to int
        Folders that are empty or can't be listed, and how many documents were not pruned for it.
    passed_over : int
        Files of unknown kinds found in folders.
    refused : list of Refused
        Folders that could not be listed, then files that could not be used, in order.
    assumed_rate : list of str
        Documents of which nothing says the source rate.
    oddities : list of str
        What looks wrong about skeletons, with the document's name before it.
    doubled : list of (str, str)
        Names of documents that are one file.
    not_merged : str
        Why small segment files were not merged, if they were to be; else empty.
    gaps_filled, gaps_left : int
        Gaps of points in the files read.
    frames : int
        Frames read, at the store's rate.
    rate : float
        That rate, in Hz.
    seconds : float
    """

    added: int = 0
    changed: int = 0
    unchanged: int = 0
    removed: int = 0
    kept: Mapping[Path, int] = field(default_factory=dict)
    passed_over: int = 0
    refused: list[Refused] = field(default_factory=list)
    assumed_rate: list[str] = field(default_factory=list)
    oddities: list[str] = field(default_factory=list)
    doubled: list[tuple[str, str]] = field(default_factory=list)
    not_merged: str = ""
    gaps_filled: int = 0
    gaps_left: int = 0
    frames: int = 0
    rate: float = RATE
    seconds: float = 0.0


def index_files(
    inputs: Sequence[str | Path],
    store: str | Path,
    options: IndexOptions | None = None,
    *,
    progress: Callable[[IndexProgress], None] | None = None,
    map_fn: MapFunction | None = None,
) -> IndexSummary:
    """Read what is new or changed below `inputs` into a store; leave the rest alone.

    A file is unchanged if its size and time of change are those of the last run, or else if
    its bytes are. Documents are committed in batches; what was committed stays, however the
    run ends, and the next run goes on from there.

    Parameters
    ----------
    inputs : sequence of str or Path
        Motion files and folders.
    store : str or Path
        Made if it does not exist.
    options : IndexOptions, optional
    progress : callable, optional
        Called after each document.
    map_fn : callable, optional
        Runs the reading, with the shape of ``map``; by default ``options.jobs`` processes.

    Returns
    -------
    IndexSummary

    Raises
    ------
    FormatError
        If a file can't be used and ``skip_bad`` is off; earlier batches stay.
    ParameterError, StoreError, LockedError, WriteError
    """
    options, store = options or IndexOptions(), Path(store)
    started = time.perf_counter()
    settings = _settings(store, options)
    if options.name_pattern is not None:
        name_regex(options.name_pattern)
    check_writable(store)
    closed: list[str] = []
    sources, passed_over = find_sources(
        [Path(given) for given in inputs], options.root, closed if options.skip_bad else None
    )
    summary = IndexSummary(passed_over=passed_over)
    summary.refused += [Refused(message, message) for message in closed]
    with writing(
        store,
        command="index",
        lock_timeout=options.lock_timeout,
        use_lock=options.use_lock,
        create=settings,
    ) as writer:
        feature_set = store_feature_set(writer.snapshot, checked=True)
        known = {entry.document.name: entry.document for entry in writer.snapshot.documents()}
        items = _items(sources, known, options)
        summary.rate, summary.doubled = writer.settings.rate, _doubled(sources, known)
        summary.unchanged = len(sources) - len(items)
        workers = 1 if map_fn else min(options.jobs, len(items) // JOBS_PER_WORKER + 1)
        try:
            with nullcontext(map_fn) if map_fn else mapping(workers) as apply:
                rate, poses = writer.settings.rate, writer.settings.poses
                outcomes = apply(
                    partial(prepare_item, options.read, feature_set, rate, poses), items
                )
                for done in _index(outcomes, known, writer, options, feature_set, summary):
                    if progress is not None:
                        progress(IndexProgress(done, len(items), summary.frames))
            if options.prune:
                gone, summary.kept = gone_documents(known)
                writer.commit(None, remove=gone)
                summary.removed = len(gone)
            small = small_files(writer.snapshot.files, options.batch_bytes)
            if len(writer.snapshot.files) > MOST_SEGMENT_FILES and len(small) > 1:
                try:
                    merge_files(writer, small, feature_set)
                except DamagedError as exc:  # what this run was to do is done
                    summary.not_merged = str(exc)
        except Interrupted as exc:
            documents = count(summary.added + summary.changed, "document")
            raise Interrupted(
                exc.signal_number, f"stopped after {documents}; run again to continue"
            ) from exc
    summary.seconds = time.perf_counter() - started
    return summary


def _settings(store: Path, options: IndexOptions) -> StoreSettings:
    """Leave to a store that is there what the options leave open."""
    present = read_manifest(store).settings if os.path.lexists(store / MANIFEST) else None
    usual = present.rate if present else RATE
    rate = usual if options.rate is None else options.rate
    if present and options.feature_set is None:
        return replace(present, rate=rate, poses=present.poses and options.poses)
    feature_set = load_feature_set(options.feature_set or FEATURE_SET)
    return StoreSettings(
        rate, feature_set.name, feature_set.digest, feature_set.text, options.poses
    )


def _doubled(sources: Sequence[Source], known: Mapping[str, Document]) -> list[tuple[str, str]]:
    """Find files that have been, or are to be, documents under two names."""
    names = {str(document.source): name for name, document in known.items()}
    pairs = []
    for source in sources:
        other = names.setdefault(str(source.path), source.name)
        if other != source.name:
            pairs.append((other, source.name))
    return pairs


def _items(
    sources: Sequence[Source], known: Mapping[str, Document], options: IndexOptions
) -> list[Item]:
    """Return what is to be read: sources, what the store knows of them, facts from their names."""
    items: list[Item] = []
    regex = None if options.name_pattern is None else name_regex(options.name_pattern)
    for source in sources:
        document, facts = known.get(source.name), name_facts(regex, source.name)
        if document is None or not is_unchanged(source, document, options.read, facts):
            items.append(Item(source, document, facts))
    return items


@dataclass
class _OpenBatch:
    """Documents that wait to be committed together."""

    prepared: list[Prepared] = field(default_factory=list)
    size: int = 0

    def add(self, prepared: Prepared) -> None:
        self.prepared.append(prepared)
        self.size += prepared.words.nbytes
        self.size += 0 if prepared.poses is None else prepared.poses.nbytes

    def commit(self, writer: Writer, feature_set: FeatureSet) -> None:
        if self.prepared:
            writer.commit(_laid_out(self.prepared, feature_set, writer.settings.poses))
        self.prepared, self.size = [], 0


def _laid_out(prepared: Sequence[Prepared], feature_set: FeatureSet, poses: bool) -> Batch:
    def stream() -> Iterator[NDArray[np.float32]]:
        return (one.poses for one in prepared if one.poses is not None)

    documents = [one.document for one in prepared]
    words = [one.words for one in prepared]
    return make_batch(documents, words, stream if poses else None, feature_set)


def _index(
    outcomes: Iterable[Outcome],
    known: Mapping[str, Document],
    writer: Writer,
    options: IndexOptions,
    feature_set: FeatureSet,
    summary: IndexSummary,
) -> Iterator[int]:
    """Commit what is prepared, batch by batch; yield how many outcomes have been dealt with."""
    batch = _OpenBatch()
    for done, outcome in enumerate(outcomes, start=1):
        if isinstance(outcome, Unchanged):
            summary.unchanged += 1
        elif isinstance(outcome, Refused):
            if not options.skip_bad:
                raise FormatError(f"{outcome.message} (--skip-bad passes over such files)")
            summary.refused.append(outcome)
        else:
            batch.add(outcome)
            summary.frames += outcome.document.frames
            summary.gaps_filled += outcome.gaps.filled
            summary.gaps_left += outcome.gaps.left
            if outcome.assumed_rate:
                summary.assumed_rate.append(outcome.document.name)
            name = shown(outcome.document.name)
            summary.oddities += (f"{name}: {oddity}" for oddity in outcome.oddities)
            if batch.size >= options.batch_bytes:
                _commit(batch, known, writer, feature_set, summary)
        yield done
    _commit(batch, known, writer, feature_set, summary)


def _commit(
    batch: _OpenBatch,
    known: Mapping[str, Document],
    writer: Writer,
    feature_set: FeatureSet,
    summary: IndexSummary,
) -> None:
    names = [prepared.document.name for prepared in batch.prepared]
    batch.commit(writer, feature_set)
    changed = sum(name in known for name in names)
    summary.changed += changed
    summary.added += len(names) - changed
