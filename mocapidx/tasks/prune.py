"""Which documents are to be dropped because their motion file is gone."""

import os
from collections import Counter
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from mocapidx.store.manifest import Document

__all__ = ["gone_documents"]


def gone_documents(known: Mapping[str, Document]) -> tuple[list[str], Counter[Path]]:
    """Name the documents whose file is gone, but for those of disks that may just be away.

    A disk that isn't mounted leaves no folder, or one with nothing in it.

    Parameters
    ----------
    known : mapping of str to Document
        The documents of a store, by their names.

    Returns
    -------
    gone : list of str
        Names of the documents whose file is gone from a folder that is there.
    kept : Counter of Path
        Folders that are there and empty, or can't be listed, and how many documents come from
        below each.
    """
    gone, kept = [], Counter[Path]()
    is_full = lru_cache(None)(_is_full)
    for name, document in known.items():
        if os.path.isdir(document.root) and not os.path.lexists(document.source):
            folder = document.source.parent
            while not os.path.isdir(folder):
                folder = folder.parent
            if is_full(folder):
                gone.append(name)
            else:
                kept[folder] += 1
    return gone, kept


def _is_full(folder: Path) -> bool:
    """Whether a folder can be listed and has anything in it."""
    try:
        with os.scandir(folder) as entries:
            return next(entries, None) is not None
    except OSError:
        return False
