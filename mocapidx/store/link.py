"""Take over a file of another store: by a link where the file system allows, else by a copy."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from mocapidx.durable import replace_file
from mocapidx.errors import StoreError
from mocapidx.store.files import open_regular
from mocapidx.store.manifest import FileRecord, file_digest

__all__ = ["NO_LINKS", "link_or_copy"]

NO_LINKS: Final = frozenset(
    {errno.EXDEV, errno.EPERM, errno.EACCES, errno.EMLINK, errno.ENOTSUP, errno.EOPNOTSUPP}
)
"""What is said where there can be no link: other file systems, none that has links, too many."""

PIECE: Final = 1 << 22


def link_or_copy(source: Path, target: Path, record: FileRecord) -> bool:
    """Give an immutable file a second name; the caller syncs the folder.

    Parameters
    ----------
    source : Path
    target : Path
        Must not exist.
    record : FileRecord
        Size and digest of the file, which a copy is checked against.

    Returns
    -------
    bool
        Whether it is a link.

    Raises
    ------
    StoreError
        If the file isn't there, or what was copied is not what the record says.
    OSError
        If it can't be written.
    """
    try:
        os.link(source, target, follow_symlinks=False)
    except FileNotFoundError as exc:
        raise StoreError(f"{source}: is missing; run 'mocapidx verify' on its store") from exc
    except OSError as exc:
        if exc.errno not in NO_LINKS:
            raise
        replace_file(target, _checked(source, record))
        return False
    return True


def _checked(source: Path, record: FileRecord) -> Iterator[bytes]:
    """Read a file piece by piece; the last one comes only if the whole is right."""
    digest, size = file_digest(b""), 0
    with open(open_regular(source), "rb") as file:
        while piece := file.read(PIECE):
            digest.update(piece)
            size += len(piece)
            yield piece
    if (size, digest.hexdigest()) != (record.size, record.digest):
        raise StoreError(f"{source}: is damaged; run 'mocapidx verify --repair' on its store")
