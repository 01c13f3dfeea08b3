"""One writer at a time: an advisory lock on the store's LOCK file.

The kernel drops the lock with the process that holds it, however it ends, so a dead holder
never blocks. The text in the file is for people and decides nothing.
"""

import contextlib
import errno
import fcntl
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from mocapidx.durable import write_error
from mocapidx.errors import LockedError
from mocapidx.store import schema

__all__ = ["locked"]

POLL: Final = 0.05
BUSY: Final = frozenset({errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES})
TEXT_LIMIT: Final = 200


@contextlib.contextmanager
def locked(
    store: Path, *, command: str, timeout: float = 0.0, use_lock: bool = True
) -> Iterator[None]:
    """Hold the lock of a store's writer.

    Parameters
    ----------
    store : Path
        Folder of the store; must exist.
    command : str
        Who asks, for the message that others get.
    timeout : float
        How long to wait for another writer, in seconds.
    use_lock : bool
        False goes without, at the caller's risk.

    Yields
    ------
    None
        While the lock is held. Child processes that are started anew don't inherit it.

    Raises
    ------
    LockedError
        If another process holds it, or the file system has no locks.
    WriteError
        If the LOCK file can't be written.
    """
    if not use_lock:
        yield
        return
    descriptor = _acquire(store, time.monotonic() + timeout)
    try:
        _sign(descriptor, f"`{command}` (pid {os.getpid()} on {socket.gethostname()}, since ")
        yield
    finally:
        _sign(descriptor, None)
        os.close(descriptor)


def _acquire(store: Path, deadline: float) -> int:
    path = store / schema.LOCK
    while True:
        try:
            descriptor = _opened(path)
        except OSError as exc:
            raise write_error(
                exc, path, subject=str(store), needed=None, unchanged="store unchanged"
            ) from exc
        try:
            _wait(descriptor, store, deadline)
            # A writer that gives up making a store takes its LOCK away with it.
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(descriptor), os.stat(path)):
                    return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _opened(path: Path) -> int:
    flags = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | flags, 0o666)
    except PermissionError:
        # In a folder that several people write to it may be another's, and locks ask for no more.
        return os.open(path, os.O_RDONLY | flags)


def _wait(descriptor: int, store: Path, deadline: float) -> None:
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except OSError as exc:
            if exc.errno == errno.EBADF:  # NFS locks only what may be written
                raise LockedError(
                    f"{store / schema.LOCK}: is somebody else's and may not be written, which "
                    "locks need on this file system; let the owner give others that right"
                ) from exc
            if exc.errno not in BUSY:
                raise LockedError(
                    f"{store}: this file system can't lock files "
                    f"({(exc.strerror or '').lower()}); --no-lock goes without, at your own risk "
                    "if two commands write at a time"
                ) from exc
            if time.monotonic() >= deadline:
                raise LockedError(
                    f"{store} is being written by {_holder(descriptor)}; wait with --lock-timeout"
                ) from exc
        time.sleep(POLL)


def _sign(descriptor: int, text: str | None) -> None:
    # A full disk must not stop a command that may have nothing to write.
    with contextlib.suppress(OSError):
        os.ftruncate(descriptor, 0)
        if text is not None:
            os.pwrite(descriptor, f"{text}{time.strftime('%H:%M')})\n".encode(), 0)


def _holder(descriptor: int) -> str:
    with contextlib.suppress(OSError):
        text = os.pread(descriptor, TEXT_LIMIT, 0).decode(errors="replace").strip()
        if text:
            return "".join(sign if sign.isprintable() else "?" for sign in text)
    return "another command"
