"""Replace a file durably: whole and on disk, or as it was before.

The new content goes to a temporary file beside the old one, is synced, renamed over it, and
the folder is synced. A failed sync is never tried again: the kernel may have dropped the pages
that it could not write, so a second one that succeeds would prove nothing.

A writer holds a lock on its temporary file, so that the next writer of the same file can tell
what a killed one left from what a living one is still writing, and takes the former away.
"""

import contextlib
import errno
import fcntl
import os
import resource
import stat
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TypeAlias

from mocapidx.errors import MocapidxError, ParameterError, WriteError

__all__ = [
    "Chunk",
    "durable_replace",
    "has_written",
    "make_folder",
    "remove_abandoned",
    "replace_file",
    "sync_folder",
    "write_error",
]

Chunk: TypeAlias = bytes | bytearray | memoryview

PIECE = 1 << 24
GATHERED = 1 << 20
FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
_put_in_place: list[Path] = []
NO_FOLDER_SYNC = frozenset({errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP})


def durable_replace(
    path: Path,
    chunks: Chunk | Iterable[Chunk],
    *,
    subject: str | None = None,
    unchanged: str | None = None,
) -> None:
    """Give a file new content; after a return it is on disk, after an error it is as before.

    Parameters
    ----------
    path : Path
        The file; need not exist. Where it is a symbolic link, the file it leads to is replaced.
    chunks : bytes or iterable of bytes
        The new content, in order.
    subject : str, optional
        What messages call the thing that is written; default `path`.
    unchanged : str, optional
        How messages say what stayed; default "PATH is unchanged", or that it is not there.

    Raises
    ------
    WriteError
        If it could not be written (full, not permitted, damaged disk), or if the folder could
        not be synced after the rename, which leaves open which of both contents a power cut
        would find.
    ParameterError
        If `path` lies in a folder that does not exist, or is no regular file.
    """
    subject = subject or str(path)
    unchanged = unchanged or f"{path} is {'unchanged' if os.path.lexists(path) else 'not there'}"
    is_whole = isinstance(chunks, Chunk)
    size = memoryview(chunks).nbytes if isinstance(chunks, Chunk) else 0

    def counted(pieces: Iterable[Chunk]) -> Iterator[Chunk]:
        nonlocal size
        for piece in pieces:
            size += memoryview(piece).nbytes
            yield piece

    try:
        replace_file(path, chunks if isinstance(chunks, Chunk) else counted(chunks))
    except OSError as exc:
        raise write_error(
            exc, path, subject=subject, needed=size, is_whole=is_whole, unchanged=unchanged
        ) from exc
    try:
        sync_folder(Path(os.path.realpath(path)).parent)
    except OSError as exc:
        raise WriteError(
            f"{subject}: its folder could not be synced ({_reason(exc)}), so the change may or "
            "may not be saved; running again is safe"
        ) from exc


def replace_file(path: Path, chunks: Chunk | Iterable[Chunk]) -> None:
    """Write, sync and rename, and leave the folder's own sync to the caller.

    Parameters
    ----------
    path : Path
        The file to replace.
    chunks : bytes or iterable of bytes
        Its new content.

    Raises
    ------
    OSError
        Whatever the system says; the temporary file is gone and `path` untouched.
    ParameterError
        If `path` exists and is no regular file.
    """
    target = Path(os.path.realpath(path))
    mode = _mode(target)
    temporary, descriptor = _open_temporary(target)
    try:
        try:
            if mode is not None:
                os.fchmod(descriptor, mode)
            for view in _gathered([chunks] if isinstance(chunks, Chunk) else chunks):
                _write_all(descriptor, view)
            os.fsync(descriptor)
            _put_in_place[:] = [target]  # before it is, or a stop right after it would not know
            os.rename(temporary, target)
        except BaseException:
            with contextlib.suppress(OSError):
                # After the rename another writer may have one of this name.
                if _is_at(descriptor, temporary):
                    os.unlink(temporary)
            raise
    finally:
        os.close(descriptor)


def make_folder(path: Path) -> bool:
    """Make a folder where there is none; after a return it is on disk.

    Parameters
    ----------
    path : Path
        The folder; the one above it must be there.

    Returns
    -------
    bool
        Whether it was not there before.

    Raises
    ------
    WriteError
        If it can't be made.
    ParameterError
        If the folder above isn't there, or a file has this name.
    """
    try:
        path.mkdir()
        try:
            sync_folder(path.parent)
        except BaseException:
            with contextlib.suppress(OSError):
                path.rmdir()
            raise
    except FileExistsError as exc:
        if not path.is_dir():
            raise ParameterError(f"{path}: is a file, expected a folder") from exc
        return False
    except OSError as exc:
        raise write_error(
            exc, path, subject=str(path), needed=None, unchanged="nothing was made"
        ) from exc
    return True


def has_written() -> bool:
    """Tell whether this process has put a file in place, or was about to.

    Returns
    -------
    bool
        For the last words of a command that was stopped.
    """
    return bool(_put_in_place)


def remove_abandoned(path: Path) -> None:
    """Remove a temporary file that nobody is writing any more; any other one stays.

    Parameters
    ----------
    path : Path
        The file; need not exist. Where files can't be locked it stays.
    """
    flags = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    with contextlib.suppress(OSError):
        try:
            descriptor = os.open(path, os.O_RDWR | flags)  # NFS locks nothing else
        except PermissionError:
            descriptor = os.open(path, os.O_RDONLY | flags)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_at(descriptor, path):
                os.unlink(path)
        finally:
            os.close(descriptor)


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable.

    Parameters
    ----------
    folder : Path
        The folder that files were made in, renamed in or removed from.

    Raises
    ------
    OSError
        If the system could not; where a file system has no such operation, nothing happens.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    except OSError as exc:
        if exc.errno not in NO_FOLDER_SYNC:
            raise
    finally:
        os.close(descriptor)


def write_error(
    error: OSError,
    path: Path,
    *,
    subject: str,
    needed: int | None = None,
    is_whole: bool = True,
    unchanged: str,
) -> MocapidxError:
    """Put the system's refusal to write into words.

    Parameters
    ----------
    error : OSError
        What the system said.
    path : Path
        Where it said so.
    subject : str
        What was being written.
    needed : int or None
        Bytes that were to be written, where known.
    is_whole : bool
        Whether these are all, or as many as there were until it failed.
    unchanged : str
        What is as it was before.

    Returns
    -------
    WriteError or ParameterError
        ParameterError where the path itself is wrong.
    """
    if error.errno in FULL:
        much = "about" if is_whole else "at least"
        limits = [f"needed {much} {_amount(needed, up=True)}"] if needed else []
        limits.append(_room(error, path, needed or 0))
        return WriteError(
            f"no space left on {_mount(path)} for {subject}: {', '.join(limits)}; {unchanged}"
        )
    folder = Path(os.path.realpath(path)).parent
    if error.errno in (errno.ENOENT, errno.ENOTDIR) and not folder.is_dir():
        named = folder if path.is_symlink() else path.parent
        return ParameterError(f"{subject}: there is no folder {named}; make it first")
    if error.errno == errno.EISDIR:
        return ParameterError(f"{subject}: is a folder, expected a file")
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return WriteError(f"{subject}: may not be written ({_reason(error)}); {unchanged}")
    if error.errno == errno.EIO:
        return WriteError(
            f"{subject}: input/output error on {_mount(path)} while writing {path.name}; "
            f"{unchanged}; check the disk before running again"
        )
    return WriteError(f"{subject}: could not be written ({_reason(error)}); {unchanged}")


def _mode(target: Path) -> int | None:
    """Permissions to carry over; a device or a pipe must never be renamed over."""
    try:
        status = os.stat(target)
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    if not stat.S_ISREG(status.st_mode):
        raise ParameterError(f"{target}: is no regular file, so it can't be replaced; use '-'")
    return stat.S_IMODE(status.st_mode)


def _open_temporary(target: Path) -> tuple[Path, int]:
    """Make a file beside `target`, under a name that nobody else writes to."""
    # 180 bytes of the name are plenty to recognise it, and no file system minds the rest.
    stem = os.fsdecode(os.fsencode(target.name)[:180])
    places = [target.with_name(f"{stem}.mocapidx{number}.tmp") for number in ("", 2, 3)]
    for place in places:
        remove_abandoned(place)
    for place in places:
        with contextlib.suppress(FileExistsError):
            return place, _create_locked(place)
    last = target.with_name(f"{stem}.{time.time_ns()}.tmp")
    return last, _create_locked(last)


def _create_locked(path: Path) -> int:
    """Make a file and lock it; a stop that comes right after it was made takes it away again."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_NOFOLLOW
    descriptor = -1
    try:
        descriptor = os.open(path, flags, 0o666)
        # Somebody may take it for abandoned before it is locked, and remove it in a moment.
        if not (_lock(descriptor) and _is_at(descriptor, path)):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    except BaseException as exc:
        if descriptor >= 0:
            os.close(descriptor)
        if not isinstance(exc, FileExistsError):
            remove_abandoned(path)
        raise
    return descriptor


def _lock(descriptor: int) -> bool:
    """Lock a temporary file; False if somebody else has. Where there are no locks nobody has."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass  # what a killed writer leaves here stays
    return True


def _is_at(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path, follow_symlinks=False))
    except FileNotFoundError:
        return False


def _gathered(chunks: Iterable[Chunk]) -> Iterator[memoryview]:
    """Join what comes in small pieces, so that each line isn't a call to the system."""
    waiting = bytearray()
    for chunk in chunks:
        view = memoryview(chunk).cast("B")
        if len(waiting) + len(view) > GATHERED:
            yield memoryview(waiting)
            waiting = bytearray()
        if len(view) > GATHERED:
            yield view
        else:
            waiting += view
    yield memoryview(waiting)


def _write_all(descriptor: int, view: memoryview) -> None:
    start = 0
    while start < len(view):
        start += os.write(descriptor, view[start : start + PIECE])


def _room(error: OSError, path: Path, needed: int) -> str:
    if error.errno == errno.EDQUOT:
        return "over the quota"
    if error.errno == errno.EFBIG:
        limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
        value = "" if limit == resource.RLIM_INFINITY else f": {_amount(limit)}"
        return f"over the limit for the size of a file (ulimit -f{value})"
    status = os.statvfs(_mount(path))
    free = status.f_bavail * status.f_frsize
    # Only calls that make a name carry one; where they fail beside free space, names are short.
    if error.filename is not None and free > needed:
        return f"free {_amount(free)}, but no room for one more file (inodes); remove some there"
    return f"free {_amount(free)}"


def _mount(path: Path) -> Path:
    path = Path(os.path.realpath(path))
    while not os.path.ismount(path) and path != path.parent:
        path = path.parent
    return path


def _amount(size: int, *, up: bool = False) -> str:
    """Say how much that is; what is needed is rounded up, what there is down."""
    unit, name = (1000, "kB") if size < 1_000_000 else (1_000_000, "MB")
    return f"{-(-size // unit) if up else size // unit} {name}"


def _reason(error: OSError) -> str:
    return (error.strerror or type(error).__name__).lower()
