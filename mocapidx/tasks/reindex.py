"""Make a store of another feature set from the poses of a store, without any source file."""

import os
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import Interrupted, ParameterError, StoreError
from mocapidx.features.featureset import AnyFeatureSet, FeatureSet, load_feature_set
from mocapidx.features.unspecified import feature_words
from mocapidx.model import WordArray
from mocapidx.printable import shown
from mocapidx.store.manifest import Document, Placed, StoreSettings
from mocapidx.store.read import Snapshot, open_store
from mocapidx.store.write import Writer, check_writable, writing
from mocapidx.tasks.batch import make_batch
from mocapidx.tasks.index import BATCH_BYTES, IndexProgress
from mocapidx.tasks.segment_sources import UNTRUSTED
from mocapidx.tasks.stored import stored_motion
from mocapidx.tasks.unspecified import UNSPECIFIED, keep_unspecified

__all__ = ["ReindexSummary", "reindex_store"]


@dataclass(frozen=True, slots=True)
class ReindexSummary:
    """What one run of `reindex_store` did.

    Parameters
    ----------
    written, unchanged : int
        Documents.
    frames : int
        Frames whose features were computed.
    seconds : float
    """

    written: int
    unchanged: int
    frames: int
    seconds: float


def reindex_store(
    old: str | Path,
    store: str | Path,
    feature_set: AnyFeatureSet,
    *,
    poses: bool = True,
    lock_timeout: float = 0.0,
    use_lock: bool = True,
    batch_bytes: int = BATCH_BYTES,
    progress: Callable[[IndexProgress], None] | None = None,
) -> ReindexSummary:
    """Compute another feature set on the poses of a store, into a store of its own.

    Documents keep their names and sources, so that `index_files` goes on from there: what has
    not changed is not read again. Run again, only what is new or has changed in `old` is done.

    Parameters
    ----------
    old : str or Path
        A store that keeps poses; it is only read.
    store : str or Path
        Made if it does not exist.
    feature_set : str, Path or FeatureSet
        A shipped name, the path of a TOML file, or a set.
    poses : bool
        Keep the poses in the new store too.
    lock_timeout : float
        Seconds to wait for another writer.
    use_lock : bool
        False: write without a lock.
    batch_bytes : int
        Bytes of words and poses that are committed together.
    progress : callable, optional
        Called after each document.

    Returns
    -------
    ReindexSummary

    Raises
    ------
    FeatureSetError
        If there is no such feature set, or it is wrong.
    StoreError
        If `old` keeps no poses or is damaged, or `store` is of yet another set or rate.
    ParameterError, LockedError, WriteError
    """
    started = time.perf_counter()
    old, store = Path(old), Path(store)
    check_writable(store)
    wanted = load_feature_set(feature_set)
    if os.path.realpath(old) == os.path.realpath(store):
        raise ParameterError(f"{shown(store)}: a store has one feature set; give another --store")
    with open_store(old) as snapshot:
        settings = snapshot.manifest.settings
        if not settings.poses:
            raise StoreError(
                f"{shown(old)}: keeps no poses, so features can't be computed again; index the "
                "sources with --feature-set"
            )
        new = StoreSettings(settings.rate, wanted.name, wanted.digest, wanted.text, poses)
        with writing(
            store,
            command="reindex",
            lock_timeout=lock_timeout,
            use_lock=use_lock,
            create=new,
        ) as writer:
            known = {document.name: document for document in writer.documents()}
            entries = snapshot.documents()
            todo = [entry for entry in entries if not _is_same(entry.document, known)]
            frames = 0
            try:
                for done, count in _fill(snapshot, todo, wanted, writer, batch_bytes):
                    frames += count
                    if progress is not None:
                        progress(IndexProgress(done, len(todo), frames))
            except Interrupted as exc:
                raise Interrupted(exc.signal_number, "stopped; run again to continue") from exc
    seconds = time.perf_counter() - started
    return ReindexSummary(len(todo), len(entries) - len(todo), frames, seconds)


def _is_same(document: Document, known: dict[str, Document]) -> bool:
    """Tell whether a document was taken over in an earlier run, and has not changed since."""
    other = known.get(document.name)
    if other is None:
        return False
    rigs = [{**each.rig, UNTRUSTED: "", UNSPECIFIED: ""} for each in (document, other)]
    return rigs[0] == rigs[1] and replace(document, rig={}) == replace(other, rig={})


def _fill(
    old: Snapshot,
    entries: Iterable[Placed],
    feature_set: FeatureSet,
    writer: Writer,
    batch_bytes: int,
) -> Iterator[tuple[int, int]]:
    """Commit documents batch by batch; yield their number so far and the frames of the last."""
    batch: list[tuple[Document, WordArray, NDArray[np.float32]]] = []
    size = 0
    for done, entry in enumerate(entries, start=1):
        motion = stored_motion(old, entry)
        told = feature_words(motion, feature_set)
        words = told.words
        rig = keep_unspecified(
            {**entry.document.rig, UNTRUSTED: f"{told.untrusted:x}"}, told.unspecified
        )
        # A copy, since what was read is a part of a block, which would stay with it.
        positions = np.array(motion.positions, dtype=np.float32)
        batch.append((replace(entry.document, rig=rig), words, positions))
        size += words.nbytes + positions.nbytes
        if size >= batch_bytes:
            _commit(batch, feature_set, writer)
            size = 0
        yield done, len(words)
    _commit(batch, feature_set, writer)


def _commit(
    batch: list[tuple[Document, WordArray, NDArray[np.float32]]],
    feature_set: FeatureSet,
    writer: Writer,
) -> None:
    if not batch:
        return
    documents, words, positions = zip(*batch, strict=True)
    poses = (lambda: positions) if writer.settings.poses else None
    writer.commit(make_batch(documents, words, poses, feature_set))
    batch.clear()
