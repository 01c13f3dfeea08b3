"""Take documents out of a store."""

from pathlib import Path

from mocapidx.store.write import writing
from mocapidx.tasks.where import meeting

__all__ = ["remove_documents"]


def remove_documents(
    store: str | Path,
    where: str,
    *,
    lock_timeout: float = 0.0,
    use_lock: bool = True,
) -> tuple[str, ...]:
    """Take the documents that meet a condition out of a store, in one commit.

    Their motion files stay, and `index` takes those again that it finds. Their room on disk is
    free after the next merge of segment files.

    Parameters
    ----------
    store : str or Path
    where : str
        The condition, as in `mocapidx.tasks.where`; `list_documents` says who meets it.
    lock_timeout : float
        Seconds to wait for another writer.
    use_lock : bool
        False: write without a lock.

    Returns
    -------
    tuple of str
        Their names, sorted.

    Raises
    ------
    ParameterError
        If the condition can't be understood, or asks for what no document has.
    StoreError, LockedError, WriteError
    """
    with writing(
        Path(store), command="remove", lock_timeout=lock_timeout, use_lock=use_lock
    ) as writer:
        documents = writer.documents()
        met = meeting(documents, where, writer.settings.rate)
        names = [each.name for each, holds in zip(documents, met, strict=True) if holds]
        writer.commit(None, remove=names)
    return tuple(sorted(names))
