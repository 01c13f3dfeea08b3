"""Join stores that independent jobs built, without reading a motion file again."""

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from mocapidx.errors import ParameterError, StoreError
from mocapidx.printable import shown
from mocapidx.store.manifest import Document, SegmentFile
from mocapidx.store.read import Snapshot, open_store
from mocapidx.store.write import check_writable, writing
from mocapidx.tasks.safe_names import check_outside_stores

__all__ = ["Merged", "merge_stores"]


@dataclass(frozen=True, slots=True)
class Merged:
    """What a merge did.

    Parameters
    ----------
    documents : int
        Documents of the result.
    added : int
        Documents that came from the stores.
    files : int
        Segment files of the result.
    """

    documents: int
    added: int
    files: int


def merge_stores(
    stores: Sequence[Path],
    output: Path,
    *,
    lock_timeout: float = 0.0,
    use_lock: bool = True,
) -> Merged:
    """Add the segment files of some stores to another one, by links where possible.

    The stores stay as they are, and the result does not depend on them any more: a linked file
    lives as long as one of its names. A document that two of them hold alike, from the same
    source, is taken once; merging again adds nothing.

    Parameters
    ----------
    stores : sequence of Path
        At least one; all of the same feature set, rate and kind (with or without poses).
    output : Path
        A store, made if there is none.
    lock_timeout : float
        How long to wait for another writer to `output`, in seconds.
    use_lock : bool
        False goes without a lock, at the caller's risk.

    Returns
    -------
    Merged

    Raises
    ------
    ParameterError
        If the stores are not of one kind, or two of them have different documents of one name.
    StoreError, LockedError, WriteError
    """
    if any(path.resolve() == output.resolve() for path in stores):
        raise ParameterError(f"{shown(output)}: is one of the stores to merge; give another one")
    check_outside_stores(Path(os.path.realpath(output)).parent)
    check_writable(output)
    with ExitStack() as open_stores:
        opened = [open_stores.enter_context(open_store(path)) for path in stores]
        settings = opened[0].manifest.settings
        for other in opened[1:]:
            _check_settings(opened[0], other)
        with writing(
            output,
            command="merge",
            lock_timeout=lock_timeout,
            use_lock=use_lock,
            create=settings,
        ) as writer:
            if writer.settings != settings:
                _check_settings(opened[0], writer.snapshot)
            held = {document.name: (output, document) for document in writer.documents()}
            before = len(held)
            adopted = [
                (snapshot.path, chosen)
                for snapshot in opened
                for file in snapshot.files
                if (chosen := _unheld(file, snapshot.path, held)) is not None
            ]
            after = writer.adopt(adopted)
    return Merged(len(held), len(held) - before, len(after.files))


def _check_settings(one: Snapshot, other: Snapshot) -> None:
    ours, theirs = one.manifest.settings, other.manifest.settings
    where = f"{shown(other.path)}: differs from {shown(one.path)}"
    if ours.feature_set_digest != theirs.feature_set_digest:
        raise StoreError(
            f"{where}: its feature set is {shown(theirs.feature_set_name)} (digest "
            f"{theirs.feature_set_digest[:12]}), not {shown(ours.feature_set_name)} (digest "
            f"{ours.feature_set_digest[:12]}); 'mocapidx reindex' makes a store of another set"
        )
    if ours.rate != theirs.rate:
        raise ParameterError(
            f"{where}: it holds frames at {theirs.rate:g} Hz, not {ours.rate:g}; index its files "
            f"into a new store with --rate {ours.rate:g}"
        )
    if ours.poses != theirs.poses:
        raise ParameterError(
            f"{where}: only one of them keeps poses; 'mocapidx reindex --no-poses' makes a store "
            "without"
        )


def _unheld(
    file: SegmentFile, store: Path, held: dict[str, tuple[Path, Document]]
) -> SegmentFile | None:
    """Bury what is held already; None if nothing is left."""
    documents = []
    for document in file.documents:
        known = held.get(document.name)
        if not document.live:
            documents.append(document)
        elif known is None:
            held[document.name] = store, document
            documents.append(document)
        elif known[1].digest == document.digest:
            documents.append(replace(document, live=False))
        else:
            raise ParameterError(
                f"{shown(store)} and {shown(known[0])} hold different documents named "
                f"'{shown(document.name)}'; index one of them with another --root"
            )
    return replace(file, documents=tuple(documents)) if any(d.live for d in documents) else None
