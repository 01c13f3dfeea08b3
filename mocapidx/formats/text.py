"""Files read safely: what is no plain file is refused, and nothing unbounded is read."""

import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.printable import shown

__all__ = ["Limits", "decoded", "place", "read_binary", "read_text"]

LONGEST_LINE: Final = 16 * 1024 * 1024
CHUNK: Final = 4 * 1024 * 1024
KINDS: Final = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


@dataclass(frozen=True, slots=True)
class Limits:
    """How much of one file is taken in before it is refused.

    Parameters
    ----------
    max_file : int
        Bytes; ``--max-file``.
    max_frames : int
        Frames of one take; ``--max-frames``.
    max_joints : int
        Nodes of one skeleton, End Sites too; ``--max-joints``.
    max_levels : int
        Depth of one skeleton.
    """

    max_file: int = 2 * 1024**3
    max_frames: int = 1_000_000
    max_joints: int = 4_096
    max_levels: int = 512

    def check_frames(self, frames: int, path: Path) -> None:
        """Raise FormatError if there are too many frames."""
        if frames > self.max_frames:
            raise FormatError(
                f"{place(path)}: more than {self.max_frames:,} frames; "
                "--max-frames lifts this limit"
            )

    def check_joints(self, joints: int, path: Path, line: int | None) -> None:
        """Raise FormatError if a skeleton has too many nodes."""
        if joints > self.max_joints:
            raise FormatError(
                f"{place(path, line)}: more than {self.max_joints:,} joints; "
                "--max-joints lifts this limit"
            )

    def check_levels(self, levels: int, path: Path, line: int) -> None:
        """Raise FormatError if a skeleton is nested too deeply."""
        if levels > self.max_levels:
            raise FormatError(f"{place(path, line)}: more than {self.max_levels} levels of joints")


def place(path: Path, line: int | None = None) -> str:
    """Return ``path`` or ``path:line`` (from 1) as messages begin."""
    return shown(path, None) if line is None else f"{shown(path, None)}:{line}"


def decoded(name: bytes) -> str:
    """Return a name as text; bytes that are no UTF-8 become lone surrogates."""
    return name.decode("utf-8", "surrogateescape")


def read_text(path: Path, limits: Limits) -> bytes:
    """Read a text file whole, in one form whatever system wrote it.

    Parameters
    ----------
    path : Path
        A plain file, or a symbolic link to one.
    limits : Limits
        Only `max_file` counts here.

    Returns
    -------
    bytes
        Lines end in LF or CRLF; a byte-order mark is gone, and UTF-16 that had one is UTF-8.

    Raises
    ------
    FormatError
        If there is no such file, if it is no plain file (found out before it is opened: a
        named pipe would block for ever), too large, has a line of more than 16 MiB, or is
        changed by somebody else meanwhile.
    """
    return _with_plain_line_ends(_as_utf8(path, _read_whole(path, limits, _read_lines)))


def read_binary(path: Path, limits: Limits) -> bytes:
    """Read a file of bytes whole.

    Parameters
    ----------
    path : Path
        A plain file, or a symbolic link to one.
    limits : Limits
        Only `max_file` counts here.

    Returns
    -------
    bytes

    Raises
    ------
    FormatError
        As `read_text`; lines are no matter.
    """
    return _read_whole(path, limits, lambda _, file, size: file.read(size + 1))


def _read_whole(path: Path, limits: Limits, read: Callable[[Path, BinaryIO, int], bytes]) -> bytes:
    try:
        before = _plain_file(path, os.stat(path), limits)
        # O_NONBLOCK: should a pipe have taken the file's place since, opening must not block
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            _plain_file(path, os.fstat(file.fileno()), limits)
            data = read(path, file, before.st_size)
            after = os.fstat(file.fileno())
    except (OSError, ValueError) as exc:  # ValueError: a NUL in the name
        raise FormatError(f"{place(path)}: {_reason(path, exc)}") from exc
    if (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns):
        raise FormatError(f"{place(path)}: changed while it was read; try again when it is whole")
    return data


def _plain_file(path: Path, status: os.stat_result, limits: Limits) -> os.stat_result:
    for is_kind, kind in KINDS:
        if is_kind(status.st_mode):
            raise FormatError(f"{place(path)}: is {kind}, expected a motion file")
    if status.st_size > limits.max_file:
        raise FormatError(
            f"{place(path)}: has {status.st_size:,} bytes, more than {limits.max_file:,}; "
            "--max-file lifts this limit"
        )
    return status


def _read_lines(path: Path, file: BinaryIO, size: int) -> bytes:
    """Read at most `size` bytes and give up in the middle of a line that is too long."""
    chunks: list[bytes] = []
    got = open_line = 0
    while got <= size and (chunk := file.read(CHUNK)):
        chunks.append(chunk)
        got += len(chunk)
        first = min((i for i in (chunk.find(b"\n"), chunk.find(b"\r")) if i >= 0), default=None)
        if open_line + (len(chunk) if first is None else first) > LONGEST_LINE:
            lines = sum(c.count(b"\n") for c in chunks[:-1]) + 1
            raise FormatError(f"{place(path, lines)}: line longer than 16 MiB; not a motion file")
        if first is None:
            open_line += len(chunk)
        else:
            open_line = len(chunk) - 1 - max(chunk.rfind(b"\n"), chunk.rfind(b"\r"))
    return b"".join(chunks)


def _as_utf8(path: Path, data: bytes) -> bytes:
    if data.startswith(b"\xef\xbb\xbf"):
        return data[3:]
    if not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data
    try:
        return data.decode("utf-16").encode("utf-8")
    except UnicodeError as exc:
        raise FormatError(f"{place(path)}: begins like UTF-16 text, but is none") from exc


def _with_plain_line_ends(data: bytes) -> bytes:
    """Make every lone CR an LF; the CR of a CRLF is blank enough as it is."""
    if b"\r" not in data or not _has_lone_cr(data):
        return data
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _has_lone_cr(data: bytes) -> bool:
    text = np.frombuffer(data, dtype=np.uint8)
    for at in range(0, len(text), CHUNK):
        after = np.flatnonzero(text[at : at + CHUNK] == ord("\r")) + (at + 1)
        if len(after) and (after[-1] == len(text) or (text[after] != ord("\n")).any()):
            return True
    return False


def _reason(path: Path, exc: OSError | ValueError) -> str:
    if isinstance(exc, FileNotFoundError):
        if path.is_symlink():
            return "is a symbolic link to a file that is not there"
        return "no such file"
    return f"can't be read: {getattr(exc, 'strerror', None) or exc}"
