"""Open and read the files of a store, and say what is wrong with one."""

import contextlib
import errno
import os
import stat
from pathlib import Path
from typing import Final

from mocapidx.errors import StoreError
from mocapidx.store import schema
from mocapidx.store.manifest import FileRecord

__all__ = [
    "DamagedError",
    "check_segments_folder",
    "open_regular",
    "open_segment",
    "read_exactly",
    "reason",
    "unreadable",
]


NO_FILE: Final = frozenset(
    {errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.EINVAL, errno.EISDIR, errno.ENXIO}
)


class DamagedError(StoreError):
    """A segment file is not what the manifest says.

    Parameters
    ----------
    store : Path
        Folder of the store.
    name : str
        Of the file in the folder of segments.
    what : str
        What was found.
    """

    def __init__(self, store: Path, name: str, what: str) -> None:
        super().__init__(
            f"{store / schema.SEGMENTS / name}: damaged ({what}); "
            f"run 'mocapidx verify {store} --repair'"
        )
        self.store = store
        self.name = name
        self.what = what

    def __reduce__(self) -> tuple[type["DamagedError"], tuple[Path, str, str]]:
        """Survive the way back from a worker process."""
        return DamagedError, (self.store, self.name, self.what)


def open_segment(store: Path, name: str, record: FileRecord) -> int:
    """Open a file of the segments folder, whose name no manifest chooses.

    Parameters
    ----------
    store : Path
        Folder of the store.
    name : str
        Of the file.
    record : FileRecord
        What it should be.

    Returns
    -------
    int
        Descriptor, open for reading.

    Raises
    ------
    StoreError
        If it is no regular file or has another size.
    OSError
        If it can't be opened.
    """
    if not schema.SEGMENT_NAME.fullmatch(name):
        raise DamagedError(store, name, "no name of a segment file")
    check_segments_folder(store)
    descriptor = open_regular(store / schema.SEGMENTS / name)
    size = os.fstat(descriptor).st_size
    if size != record.size:
        os.close(descriptor)
        raise DamagedError(store, name, f"{size} bytes, expected {record.size}")
    return descriptor


def check_segments_folder(store: Path) -> None:
    """Refuse a folder of segments that is a link to somewhere else.

    Parameters
    ----------
    store : Path
        Folder of the store.

    Raises
    ------
    StoreError
        Before anything there is read, made or removed.
    """
    folder = store / schema.SEGMENTS
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISDIR(os.lstat(folder).st_mode):
            raise StoreError(
                f"{folder}: is a symbolic link or a file; a store's own folder must be here"
            )


def open_regular(path: Path) -> int:
    """Open a regular file for reading; follows no link and waits on no pipe.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    int
        Descriptor.

    Raises
    ------
    OSError
        If the system refuses, or the file is a link, a device or the like.
    """
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    descriptor = os.open(path, flags)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    return descriptor


def read_exactly(descriptor: int, offset: int, size: int) -> bytes:
    """Read a range of a file.

    Parameters
    ----------
    descriptor : int
        Open for reading.
    offset, size : int
        In bytes.

    Returns
    -------
    bytes
        Exactly `size` of them.

    Raises
    ------
    EOFError
        If the file ends before.
    OSError
        If the system can't read it.
    """
    pieces: list[bytes] = []
    while size:
        piece = os.pread(descriptor, size, offset)
        if not piece:
            raise EOFError("the file is cut off")
        pieces.append(piece)
        offset, size = offset + len(piece), size - len(piece)
    return pieces[0] if len(pieces) == 1 else b"".join(pieces)


def unreadable(store: Path, name: str, error: OSError | EOFError) -> StoreError:
    """Tell damage from what only keeps us from reading.

    Parameters
    ----------
    store : Path
        Folder of the store.
    name : str
        Of the file in the folder of segments.
    error : OSError or EOFError
        What was raised.

    Returns
    -------
    DamagedError
        Where the file is gone, cut off or another thing than a file: a repair may take it out.
    StoreError
        Where the system refuses to read it, now or to us: of its content nothing is known.
    """
    if isinstance(error, EOFError) or error.errno in NO_FILE:
        return DamagedError(store, name, reason(error))
    return StoreError(
        f"{store / schema.SEGMENTS / name}: can't be read ({reason(error)}); see to its "
        "permissions or its disk"
    )


def reason(error: OSError | EOFError) -> str:
    """Say in a few words why reading failed.

    Parameters
    ----------
    error : OSError or EOFError
        What was raised.

    Returns
    -------
    str
        In lower case.
    """
    text = error.strerror if isinstance(error, OSError) else str(error)
    return (text or type(error).__name__).lower()
