"""The frames of an AMC: many at once, or line by line.

Every frame lists the same bones, nearly always in the same order. Blocks of frames that do are
read as one table, in C or with NumPy; whatever differs is read line by line, which also finds
what is wrong. All that a table may be, the line reader takes too, and gives the same values.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.numbers import Tokens, find_tokens, parse_number, parse_numbers, words_of
from mocapidx.formats.table import FrameTable
from mocapidx.formats.text import Limits, TextFile, decoded, place
from mocapidx.kernels.choice import compiled
from mocapidx.model import FloatArray, IndexArray
from mocapidx.printable import shown

__all__ = ["BLANKS", "FRAME_NUMBER", "Layout", "numbered_words", "quoted", "read_frames"]

KEPT_LETTERS: Final = np.array([(1 << 8 * n) - 1 for n in range(9)], dtype=np.uint64)
LARGE: Final = 1 << 24  # a block that is not cut into frames is no table
FRAME_NUMBER: Final = re.compile(rb"[0-9]{1,15}")
BLANKS: Final = bytes(range(33))


@dataclass(frozen=True, slots=True)
class Layout:
    """The layout of a frame: its bones as the first frame orders them.

    Parameters
    ----------
    path : Path
        The AMC file.
    skeleton : Path
        The ASF file.
    names : tuple of bytes
        One a bone.
    nodes : tuple of int
        The node of each bone.
    counts : tuple of int
        The number of values of each bone.
    """

    path: Path
    skeleton: Path
    names: tuple[bytes, ...]
    nodes: tuple[int, ...]
    counts: tuple[int, ...]

    @property
    def width(self) -> int:
        """Words a frame."""
        return 1 + len(self.counts) + sum(self.counts)

    @property
    def line_columns(self) -> IndexArray:
        """Which of a frame's words begin a line: its number, and the bones."""
        return np.cumsum([0, 1, *(1 + n for n in self.counts[:-1])])


def read_frames(
    file: TextFile,
    text: bytes,
    line: int,
    layout: Layout,
    table: FrameTable,
    limits: Limits,
    block: int,
) -> None:
    """Read all frames of a file.

    Parameters
    ----------
    file : TextFile
        What comes after `text`.
    text : bytes
        Whole lines, of which the first is the number of a frame.
    line : int
        Lines of the file before `text`.
    layout : Layout
        What a frame has.
    table : FrameTable
        Gets the frames.
    limits : Limits
        Only `max_frames` counts here.
    block : int
        Bytes to read at a time.

    Raises
    ------
    FormatError
        If a frame has not what the layout says.
    """
    _, (word,) = next(numbered_words(text, line + 1))
    first = int(word)
    kernel = compiled("text")
    lengths = ([len(name) for name in layout.names], layout.counts)
    bounds = [np.cumsum([0, *each]) for each in lengths]
    done = 0
    for i, frames in enumerate(_whole_frames(file, text, block)):
        if i == 1:
            table.expect(done, file.size)
        done += len(frames)
        number = first + table.frames
        if kernel is None:
            at, lines = _read_with_numpy(frames, number, layout, table)
        else:
            names = b"".join(layout.names)
            at, lines = table.scan(kernel.read_frames, frames, 0, number, names, *bounds)
        line += lines
        if at < len(frames):
            rest = frames[at:]
            table.extend(_read_lines(rest, first + table.frames, line, layout))
            line += rest.count(b"\n")
        limits.check_frames(table.frames, layout.path)


def _whole_frames(file: TextFile, text: bytes, block: int) -> Iterator[bytes]:
    """Yield the text in pieces that end where a frame does."""
    searched = 0
    while more := file.read(max(block, searched)):
        end = _last_frame(text, searched)
        searched = len(text) - end
        if end:
            yield text[:end]
        text = text[end:] + more
    yield text


def _last_frame(text: bytes, after: int) -> int:
    """Return where the last number of a frame stands, if not before `after`; else 0."""
    end = len(text)
    while end > after:
        begin = text.rfind(b"\n", after, end - 1) + 1 or after
        if FRAME_NUMBER.fullmatch(text[begin:end].strip()):
            return begin
        end = begin
    return 0


def _read_with_numpy(text: bytes, first: int, layout: Layout, table: FrameTable) -> tuple[int, int]:
    """Add frames to a table; return how many bytes and lines: all, or none if any is irregular."""
    if len(text) >= LARGE:
        return 0, 0
    tokens = find_tokens(text)
    odd = (tokens.text < ord(" ")) & ((tokens.text < ord("\t")) | (tokens.text > ord("\r")))
    count = len(tokens.starts)
    if odd.any() or not count or count % layout.width or not _has_lines(tokens, layout):
        return 0, 0
    starts, ends = (a.reshape(-1, layout.width) for a in (tokens.starts, tokens.ends))
    lines = layout.line_columns
    if not (
        _has_numbers(tokens, starts[:, 0], ends[:, 0], first)
        and _has_names(tokens, starts[:, lines[1:]], ends[:, lines[1:]], layout.names)
    ):
        return 0, 0
    is_value = np.ones(layout.width, dtype=bool)
    is_value[lines] = False
    numbers, bad = parse_numbers(
        tokens.text, starts[:, is_value].ravel(), ends[:, is_value].ravel()
    )
    if len(bad):
        return 0, 0
    table.extend(numbers.reshape(len(starts), -1))
    return len(text), text.count(b"\n")


def _has_lines(tokens: Tokens, layout: Layout) -> bool:
    """Whether a line begins at every frame number and every bone, and nowhere else."""
    frames = np.arange(0, len(tokens.starts), layout.width)[:, None]
    begun = (frames + layout.line_columns).ravel()[1:]
    ends = tokens.text[: tokens.ends[-1]] == ord("\n")
    blank_lines = np.count_nonzero(ends[tokens.starts[0] :]) - len(begun)
    if not blank_lines and ends[tokens.starts[begun] - 1].all():
        return True
    found = np.searchsorted(tokens.starts, np.flatnonzero(ends))
    return np.array_equal(np.unique(found[found > 0]), begun)


def _has_numbers(tokens: Tokens, starts: IndexArray, ends: IndexArray, first: int) -> bool:
    """Whether these words are the numbers from `first` on, without zeros before them."""
    expected = [b"%d" % i for i in range(first, first + len(starts))]
    lengths = np.array([len(word) for word in expected])
    if (ends - starts != lengths).any():
        return False
    before = np.cumsum(lengths) - lengths
    letters = np.repeat(starts - before, lengths) + np.arange(lengths.sum())
    return bool(tokens.text[letters].tobytes() == b"".join(expected))


def _has_names(
    tokens: Tokens, starts: IndexArray, ends: IndexArray, names: tuple[bytes, ...]
) -> bool:
    lengths = np.array([len(name) for name in names])
    if (ends - starts != lengths).any():
        return False
    words = words_of(tokens.text)
    longest = lengths.max()
    padded = b"".join(name.ljust(longest + 8, b"\0") for name in names)
    pieces = np.frombuffer(padded, dtype=np.uint8).reshape(len(names), -1)
    for at in range(0, longest, 8):  # eight letters of all names at once
        piece = np.ascontiguousarray(pieces[:, at : at + 8]).view("<u8")[:, 0]
        letters = KEPT_LETTERS[np.clip(lengths - at, 0, 8)]
        found = words[np.minimum(starts + at, len(words) - 1)]
        if ((found & letters) != piece).any():
            return False
    return True


def _read_lines(text: bytes, first: int, line: int, layout: Layout) -> FloatArray:
    """Read frames line by line; bones may come in any order."""
    begins = dict(zip(layout.names, np.cumsum((0, *layout.counts)).tolist(), strict=False))
    counts = dict(zip(layout.names, layout.counts, strict=True))
    rows: list[list[float]] = []
    seen: set[bytes] = set()
    last = line
    for number, words in numbered_words(text, line + 1):
        last, before = number, last
        if len(words) == 1 and FRAME_NUMBER.fullmatch(words[0]):
            if rows:
                _check_whole(layout, seen, before, first + len(rows) - 1)
            if int(words[0]) != first + len(rows):
                found = f"frame {int(words[0])}, expected {first + len(rows)}"
                raise _error(layout, number, found)
            rows.append([0.0] * sum(layout.counts))
            seen = set()
            continue
        bone, frame = words[0], first + len(rows) - 1
        if bone not in counts:
            raise _error(layout, number, f"frame {frame}: {_unknown(layout, bone)}")
        if bone in seen:
            raise _error(layout, number, f"frame {frame} has bone {quoted(bone)} twice")
        seen.add(bone)
        if len(words) - 1 != counts[bone]:
            raise _error(layout, number, _wrong_count(layout, frame, bone, len(words) - 1))
        for i, word in enumerate(words[1:]):
            value = parse_number(word)
            if math.isnan(value):
                raise _error(
                    layout,
                    number,
                    f"frame {frame}: value {i + 1} of {quoted(bone)} is {quoted(word)}, "
                    "expected a number",
                )
            rows[-1][begins[bone] + i] = value
    _check_whole(layout, seen, last, first + len(rows) - 1)
    return np.array(rows)


def _check_whole(layout: Layout, seen: set[bytes], line: int, frame: int) -> None:
    missing = [name for name in layout.names if name not in seen]
    if missing:
        raise _error(layout, line, f"frame {frame} ends without bone {quoted(missing[0])}")


def _wrong_count(layout: Layout, frame: int, bone: bytes, count: int) -> str:
    needed = layout.counts[layout.names.index(bone)]
    return (
        f"frame {frame} has {count} values for {quoted(bone)}, "
        f"{shown(layout.skeleton.name)} gives it {needed} degrees of freedom"
    )


def _unknown(layout: Layout, bone: bytes) -> str:
    return (
        f"bone {quoted(bone)} is not one that {shown(layout.skeleton.name)} moves; "
        "name the right skeleton with --skeleton"
    )


def _error(layout: Layout, line: int, message: str) -> FormatError:
    return FormatError(f"{place(layout.path, line)}: {message}")


def numbered_words(
    text: bytes, first: int, most: int | None = None
) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the number and the words of each line that is neither blank nor a comment.

    Parameters
    ----------
    text : bytes
        Whole lines.
    first : int
        The number of the first one.
    most : int, optional
        Lines to yield at most.
    """
    at, number = 0, first - 1
    given = 0
    while at < len(text) and (most is None or given < most):
        end = text.find(b"\n", at)
        end = len(text) if end < 0 else end
        words = text[at:end].strip(BLANKS).split()
        at = end + 1
        number += 1
        if words and not words[0].startswith(b"#"):
            given += 1
            yield number, words


def quoted(word: bytes) -> str:
    """Return a word as messages show it."""
    return f"'{shown(decoded(word), 40)}'"
