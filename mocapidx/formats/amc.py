"""AMC: the motion of an Acclaim file pair, one line a bone and frame.

Every frame lists the same bones, nearly always in the same order. Blocks of frames that do are
read as one table; whatever differs is read line by line, which also finds what is wrong.
"""

import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.asf import Acclaim, read_asf
from mocapidx.formats.numbers import Tokens, find_tokens, parse_number, parse_numbers, words_of
from mocapidx.formats.text import Limits, decoded, place, read_text
from mocapidx.model import FloatArray, IndexArray, Recording
from mocapidx.printable import shown

__all__ = ["find_skeleton", "read_amc"]

BLOCK: Final = 1 << 18  # bytes converted at a time: what fits a processor's cache
LONGEST_NUMBER: Final = 64
KEPT_LETTERS: Final = np.array([(1 << 8 * n) - 1 for n in range(9)], dtype=np.uint64)
LARGE: Final = 1 << 24  # a block that is not cut into frames is no table
FRAME_LINE: Final = re.compile(rb"\n[ \t]*[0-9]{1,15}[ \t\r]*(?=\n)")
FRAME_NUMBER: Final = re.compile(rb"[0-9]{1,15}")
SLOWEST, FASTEST = 0.1, 10_000.0  # Hz


def find_skeleton(path: Path) -> Path:
    """Find the ASF that belongs to an AMC.

    Parameters
    ----------
    path : Path
        The AMC file.

    Returns
    -------
    Path
        The ASF whose stem begins the AMC's name (the longest such), or else the only ASF, in
        the AMC's folder or the one above.

    Raises
    ------
    FormatError
        If there is none, or several of which none fits.
    """
    folders = list(dict.fromkeys((path.parent, path.absolute().parent.parent)))
    found = [_skeletons_in(folder) for folder in folders]
    for skeletons in found:
        named = [s for s in skeletons if _begins(s.stem, path.name)]
        if named:
            return max(named, key=lambda s: len(s.stem))
    for skeletons in found:
        if len(skeletons) == 1:
            return skeletons[0]
    if not os.path.lexists(path):
        raise FormatError(f"{place(path)}: no such file")
    count = sum(map(len, found))
    raise FormatError(
        f"{place(path)}: expects SKELETON.asf in its folder or the one above, found "
        f"{f'{count} of which none begins its name' if count else 'none'}; name it with --skeleton"
    )


def _skeletons_in(folder: Path) -> list[Path]:
    try:
        return sorted(p for p in folder.iterdir() if p.suffix.lower() == ".asf")
    except OSError:
        return []


def _begins(stem: str, name: str) -> bool:
    """Whether `stem` begins `name`; ``1`` does not begin ``13_29``."""
    rest = name[len(stem) :]
    return name.startswith(stem) and not (stem[-1:].isdigit() and rest[:1].isdigit())


def read_amc(path: Path, skeleton_path: Path | None, limits: Limits) -> Recording:
    """Read an AMC file and its ASF.

    Parameters
    ----------
    path : Path
        The AMC file.
    skeleton_path : Path or None
        The ASF file; None: as `find_skeleton` finds it.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    Recording
        `rate` is None unless the file has a header ``:SAMPLES-PER-SECOND``.

    Raises
    ------
    FormatError
        If a file is of another format, is cut off or exceeds a limit, or if the two do not
        belong together.
    """
    data = read_text(path, limits)
    acclaim = read_asf(skeleton_path or find_skeleton(path), limits)
    header = _read_header(path, data, acclaim.degrees)
    table = _table(path, data, header, acclaim)
    values = table.read(data, header, limits)
    nodes, kinds, order = _channels(acclaim, table)
    values = np.take(values, order, axis=1)
    if header.degrees:
        values *= np.where(kinds >= 3, np.pi / 180, 1.0)
    return Recording(acclaim.skeleton, nodes, kinds, values, header.rate, acclaim.unit)


@dataclass(frozen=True, slots=True)
class _Header:
    degrees: bool
    rate: float | None
    end: int  # in bytes
    lines: int


def _read_header(path: Path, data: bytes, degrees: bool) -> _Header:
    rate = None
    at = number = 0
    while at < len(data):
        end = data.find(b"\n", at)
        words = data[at : end if end >= 0 else len(data)].split()
        if words and FRAME_NUMBER.fullmatch(words[0]) and len(words) == 1:
            return _Header(degrees, rate, at, number)
        at = end + 1 if end >= 0 else len(data)
        number += 1
        if not words or words[0].startswith(b"#"):
            continue
        key = words[0].upper()
        if not key.startswith(b":"):
            raise FormatError(
                f"{place(path, number)}: not an AMC file: expected a frame number, "
                f"found {_quoted(words[0])}"
            )
        if key in (b":DEGREES", b":RADIANS"):
            degrees = key == b":DEGREES"
        elif key == b":SAMPLES-PER-SECOND":
            rate = parse_number(words[1]) if len(words) == 2 else math.nan
            if not SLOWEST <= rate <= FASTEST:
                raise FormatError(
                    f"{place(path, number)}: {_quoted(b' '.join(words))}: "
                    "expected samples a second between 0.1 and 10000"
                )
    raise FormatError(f"{place(path)}: not an AMC file: it has no frames")


@dataclass(frozen=True, slots=True)
class _Table:
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

    def read(self, data: bytes, header: _Header, limits: Limits) -> FloatArray:
        """Return all frames, shape (T, values a frame), in the order of the layout."""
        blocks: list[FloatArray] = []
        at, frames = header.end, 0
        counted, line = at, header.lines
        first = int(data[at : at + LONGEST_NUMBER].split(None, 1)[0])
        while at < len(data):
            end = self._end_of_frames(data, at)
            block = data[at:end]
            rows = self._read_regular(block, first + frames) if len(block) < LARGE else None
            if rows is None:
                line += data.count(b"\n", counted, at)
                counted = at
                rows = self._read_lines(block, first + frames, line)
            blocks.append(rows)
            frames += len(rows)
            limits.check_frames(frames, self.path)
            at = end
        return np.concatenate(blocks)

    def _end_of_frames(self, data: bytes, at: int) -> int:
        """Return where a block of whole frames ends that begins at `at`."""
        if at + BLOCK >= len(data):
            return len(data)
        # the number of a frame stands in the line above its first bone
        bone = data.rfind(b"\n" + self.names[0], at, at + BLOCK)
        number = data.rfind(b"\n", at, bone) if bone > 0 else -1
        if number > at and FRAME_NUMBER.fullmatch(data[number + 1 : bone].strip()):
            return number + 1
        following = FRAME_LINE.search(data, at + BLOCK)  # bones in another order
        return following.start() + 1 if following else len(data)

    def _read_regular(self, block: bytes, first: int) -> FloatArray | None:
        """Read frames that all have the layout; None if any has not."""
        tokens = find_tokens(block)
        width = 1 + len(self.counts) + sum(self.counts)
        if len(tokens.starts) % width:
            return None
        starts, ends = (a.reshape(-1, width) for a in (tokens.starts, tokens.ends))
        columns = np.cumsum([1, *(1 + n for n in self.counts[:-1])])
        if not self._has_names(tokens, starts[:, columns], ends[:, columns]):
            return None
        is_value = np.ones(width, dtype=bool)
        is_value[columns] = False
        numbers, bad = parse_numbers(
            tokens.text, starts[:, is_value].ravel(), ends[:, is_value].ravel()
        )
        numbers = numbers.reshape(len(starts), -1)
        if len(bad) or (numbers[:, 0] != np.arange(first, first + len(numbers))).any():
            return None
        return numbers[:, 1:]

    def _has_names(self, tokens: Tokens, starts: IndexArray, ends: IndexArray) -> bool:
        lengths = np.array([len(name) for name in self.names])
        if (ends - starts != lengths).any():
            return False
        words = words_of(tokens.text)
        longest = lengths.max()
        padded = b"".join(name.ljust(longest + 8, b"\0") for name in self.names)
        pieces = np.frombuffer(padded, dtype=np.uint8).reshape(len(self.names), -1)
        for at in range(0, longest, 8):  # eight letters of all names at once
            piece = np.ascontiguousarray(pieces[:, at : at + 8]).view("<u8")[:, 0]
            letters = KEPT_LETTERS[np.clip(lengths - at, 0, 8)]
            found = words[np.minimum(starts + at, len(words) - 1)]
            if ((found & letters) != piece).any():
                return False
        return True

    def _read_lines(self, block: bytes, first: int, line: int) -> FloatArray:
        """Read frames line by line; bones may come in any order."""
        begins = dict(zip(self.names, np.cumsum((0, *self.counts)).tolist(), strict=False))
        counts = dict(zip(self.names, self.counts, strict=True))
        rows: list[list[float]] = []
        seen: set[bytes] = set()
        number = line
        for number, words in _numbered_words(block, line + 1):
            if len(words) == 1 and FRAME_NUMBER.fullmatch(words[0]):
                if rows:
                    self._check_whole(seen, number, first + len(rows) - 1)
                if int(words[0]) != first + len(rows):
                    raise self._error(
                        number, f"frame {int(words[0])}, expected {first + len(rows)}"
                    )
                rows.append([0.0] * sum(self.counts))
                seen = set()
                continue
            bone, frame = words[0], first + len(rows) - 1
            if bone not in counts:
                raise self._error(number, f"frame {frame}: {self._unknown(bone)}")
            if bone in seen:
                raise self._error(number, f"frame {frame} has bone {_quoted(bone)} twice")
            seen.add(bone)
            if len(words) - 1 != counts[bone]:
                raise self._error(number, self._wrong_count(frame, bone, len(words) - 1))
            for i, word in enumerate(words[1:]):
                value = parse_number(word)
                if math.isnan(value):
                    raise self._error(
                        number,
                        f"frame {frame}: value {i + 1} of {_quoted(bone)} is {_quoted(word)}, "
                        "expected a number",
                    )
                rows[-1][begins[bone] + i] = value
        self._check_whole(seen, number, first + len(rows) - 1)
        return np.array(rows)

    def _check_whole(self, seen: set[bytes], line: int, frame: int) -> None:
        missing = [name for name in self.names if name not in seen]
        if missing:
            raise self._error(line, f"frame {frame} ends without bone {_quoted(missing[0])}")

    def _wrong_count(self, frame: int, bone: bytes, count: int) -> str:
        needed = self.counts[self.names.index(bone)]
        return (
            f"frame {frame} has {count} values for {_quoted(bone)}, "
            f"{shown(self.skeleton.name)} gives it {needed} degrees of freedom"
        )

    def _unknown(self, bone: bytes) -> str:
        return (
            f"bone {_quoted(bone)} is not one that {shown(self.skeleton.name)} moves; "
            "name the right skeleton with --skeleton"
        )

    def _error(self, line: int, message: str) -> FormatError:
        return FormatError(f"{place(self.path, line)}: {message}")


def _table(path: Path, data: bytes, header: _Header, acclaim: Acclaim) -> _Table:
    """Return the layout: the bones of the skeleton in the order of the first frame."""
    moved = {n: i for i, n in enumerate(acclaim.skeleton.names) if acclaim.columns[i]}
    order: dict[bytes, int] = {}
    for _, words in _numbered_words(data[header.end :], header.lines + 1, most=len(moved) + 1):
        if decoded(words[0]) in moved:
            order.setdefault(words[0], moved[decoded(words[0])])
    rest = {n.encode("utf-8", "surrogateescape"): i for n, i in moved.items()}
    order |= {n: i for n, i in rest.items() if n not in order}
    counts = tuple(len(acclaim.columns[i]) for i in order.values())
    return _Table(path, acclaim.path, tuple(order), tuple(order.values()), counts)


def _channels(acclaim: Acclaim, table: _Table) -> tuple[IndexArray, IndexArray, list[int]]:
    """Return node, kind and column of each channel; the rotation applied last comes first."""
    begins = dict(zip(table.nodes, np.cumsum((0, *table.counts)).tolist(), strict=False))
    nodes, kinds, order = [], [], []
    for node in sorted(table.nodes):
        columns = acclaim.columns[node]
        wanted = (0, 1, 2, *reversed(acclaim.turns[node]))
        for kind in (k for k in wanted if k in columns):
            nodes.append(node)
            kinds.append(kind)
            order.append(begins[node] + columns.index(kind))
    return np.array(nodes, dtype=np.int64), np.array(kinds, dtype=np.int64), order


def _numbered_words(
    data: bytes, first: int, most: int | None = None
) -> Iterator[tuple[int, list[bytes]]]:
    """Yield number and words of each line that is neither blank nor a comment."""
    at, number = 0, first - 1
    given = 0
    while at < len(data) and (most is None or given < most):
        end = data.find(b"\n", at)
        end = len(data) if end < 0 else end
        words = data[at:end].split()
        at = end + 1
        number += 1
        if words and not words[0].startswith(b"#"):
            given += 1
            yield number, words


def _quoted(word: bytes) -> str:
    return f"'{shown(decoded(word), 40)}'"
