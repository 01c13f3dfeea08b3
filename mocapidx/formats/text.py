"""Files read safely: what is no plain file is refused, and nothing unbounded is read."""

import codecs
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.printable import shown

__all__ = ["Limits", "TextFile", "decoded", "open_text", "place", "read_binary", "read_text"]

LONGEST_LINE: Final = 16 * 1024 * 1024
CHUNK: Final = 4 * 1024 * 1024
PIECE: Final = 16 * 1024  # bytes looked at together: what arrays over them cost is not felt
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
    with open_text(path, limits) as file:
        return b"".join(iter(file.read, b""))


@contextmanager
def open_text(path: Path, limits: Limits) -> Iterator["TextFile"]:
    """Open a text file that is read block by block.

    Parameters
    ----------
    path : Path
        A plain file, or a symbolic link to one.
    limits : Limits
        Only `max_file` counts here.

    Yields
    ------
    TextFile

    Raises
    ------
    FormatError
        As `read_text`; that the file is changed meanwhile goes before all that is found in it.
    """
    with _opened(path, limits) as (file, size):
        yield TextFile(path, file, size)


class TextFile:
    """A text file while it is read, in one form whatever system wrote it; see `open_text`."""

    def __init__(self, path: Path, file: BinaryIO, size: int) -> None:
        self._path, self._file, self.size = path, file, size
        self._left = size + 1  # a byte more shows that the file grows
        self._begun = self._ended = False
        self._decoder: codecs.IncrementalDecoder | None = None
        self._open_line = b""

    def read(self, size: int | None = None) -> bytes:
        """Return the next whole lines, about `size` bytes of them; nothing at the end."""
        size = size or CHUNK
        pieces, self._open_line = [self._open_line] if self._open_line else [], b""
        length = sum(map(len, pieces))  # of the line that is open
        while not self._ended:
            chunk = self._chunk(size)
            found = [i for i in (chunk.find(b"\n"), chunk.find(b"\r")) if i >= 0]
            if length + min(found, default=len(chunk)) > LONGEST_LINE:
                line = self._lines_before(self._file.tell() - len(chunk)) + 1
                raise FormatError(
                    f"{place(self._path, line)}: line longer than 16 MiB; not a motion file"
                )
            # a CR at the very end may be half of a CRLF
            end = max(chunk.rfind(b"\n"), chunk.rfind(b"\r", 0, -1)) + 1
            if end and not self._ended:
                pieces.append(chunk[:end])
                self._open_line = chunk[end:]
                break
            pieces.append(chunk)
            length += len(chunk)
        return _with_plain_line_ends(b"".join(pieces))

    def _chunk(self, size: int) -> bytes:
        """Return the next bytes of the file, as UTF-8 if it is UTF-16."""
        size = min(size, self._left)
        data = _read_bytes(self._path, self._file, size)
        self._left -= len(data)
        self._ended = len(data) < size or not self._left
        if not self._begun:
            self._begun = True
            if data.startswith((b"\xff\xfe", b"\xfe\xff")):
                self._decoder = codecs.getincrementaldecoder("utf-16")()
            data = data.removeprefix(b"\xef\xbb\xbf")
        if self._decoder is None:
            return data
        try:
            return self._decoder.decode(data, self._ended).encode()
        except UnicodeError as exc:
            raise FormatError(f"{place(self._path)}: begins like UTF-16 text, but is none") from exc

    def _lines_before(self, end: int) -> int:
        """Count the lines that end before a place in the file, in bytes."""
        self._file.seek(0)
        count = 0
        while end > 0 and (data := _read_bytes(self._path, self._file, min(CHUNK, end))):
            end -= len(data)
            count += data.count(b"\n")
        return count


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
    with _opened(path, limits) as (file, size):
        return _read_bytes(path, file, size + 1)


@contextmanager
def _opened(path: Path, limits: Limits) -> Iterator[tuple[BinaryIO, int]]:
    """Open a plain file and give its size in bytes; it must stay as it is meanwhile."""
    try:
        before = _plain_file(path, os.stat(path), limits)
        # O_NONBLOCK: should a pipe have taken the file's place since, opening must not block
        file = open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb")  # noqa: SIM115
    except (OSError, ValueError) as exc:  # ValueError: a NUL in the name
        raise FormatError(f"{place(path)}: {_reason(path, exc)}") from exc
    with file:
        _plain_file(path, os.fstat(file.fileno()), limits)
        try:
            yield file, before.st_size
        except FormatError:
            _check_unchanged(path, before, file)
            raise
        _check_unchanged(path, before, file)


def _check_unchanged(path: Path, before: os.stat_result, file: BinaryIO) -> None:
    after = os.fstat(file.fileno())
    if (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns):
        raise FormatError(f"{place(path)}: changed while it was read; try again when it is whole")


def _read_bytes(path: Path, file: BinaryIO, size: int) -> bytes:
    try:
        return file.read(size)
    except OSError as exc:
        raise FormatError(f"{place(path)}: {_reason(path, exc)}") from exc


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


def _with_plain_line_ends(data: bytes) -> bytes:
    """Make every lone CR an LF; the CR of a CRLF is blank enough as it is."""
    if b"\r" not in data or not _has_lone_cr(data):
        return data
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _has_lone_cr(data: bytes) -> bool:
    text = np.frombuffer(data, dtype=np.uint8)
    returns, news = text[:-1], text[1:]
    for at in range(0, len(returns), PIECE):
        piece = slice(at, at + PIECE)
        if ((returns[piece] == ord("\r")) > (news[piece] == ord("\n"))).any():
            return True
    return data.endswith(b"\r")


def _reason(path: Path, exc: OSError | ValueError) -> str:
    if isinstance(exc, FileNotFoundError):
        if path.is_symlink():
            return "is a symbolic link to a file that is not there"
        return "no such file"
    return f"can't be read: {getattr(exc, 'strerror', None) or exc}"
