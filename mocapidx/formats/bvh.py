"""BVH: a tree of joints and its channels, then one line of numbers a frame.

There is no standard but the files themselves. A joint's rotations are multiplied from left to
right in the order of its channels; whether a position channel adds to the joint's OFFSET or
replaces it, what is up and how long a unit is, the file does not say.
"""

import io
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.numbers import find_tokens, parse_number, parse_numbers
from mocapidx.formats.table import FrameTable
from mocapidx.formats.text import Limits, TextFile, decoded, open_text, place
from mocapidx.kernels.choice import compiled
from mocapidx.model import FloatArray, IndexArray, Recording, Skeleton
from mocapidx.printable import shown

__all__ = ["read_bvh"]

CHANNELS: Final = {
    b"xposition": 0, b"yposition": 1, b"zposition": 2,
    b"xrotation": 3, b"yrotation": 4, b"zrotation": 5,
}  # fmt: skip
BLOCK: Final = 1 << 18  # bytes converted at a time: what fits a processor's cache
SHORTEST_FRAME, LONGEST_FRAME = 1e-4, 10.0  # seconds
MOST_DIGITS: Final = 18  # of a number of frames


def read_bvh(path: Path, limits: Limits) -> Recording:
    """Read a BVH file.

    Parameters
    ----------
    path : Path
        The file.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    Recording
        The End Site of joint ``X`` is the node ``X/End``; `unit` is None. A frame time that is
        a rounded 1/n is taken as exactly that, since 0.0333333 s stands for 30 Hz.

    Raises
    ------
    FormatError
        If the file is no BVH file, is cut off or exceeds a limit, or if two joints have the
        same name.
    """
    with open_text(path, limits) as file:
        return _Bvh(path, file, limits).recording()


@dataclass
class _Node:
    name: str
    parent: int
    line: int
    offset: tuple[float, ...] | None = None
    channels: tuple[int, ...] | None = None


@dataclass
class _Bvh:
    """One file while it is read: `at` is the place of the next line, `line` the lines before."""

    path: Path
    file: TextFile
    limits: Limits
    data: bytes = b""  # whole lines
    at: int = 0
    line: int = 0
    nodes: list[_Node] = field(default_factory=list)

    def recording(self) -> Recording:
        rig = self._rig()
        frames, rate = self._read_motion_header()
        values = self._read_rows(np.where(rig.kinds >= 3, np.pi / 180, 1.0))
        if len(values) != frames:
            hint = "; is the file cut off?" if len(values) < frames else ""
            raise self._error(f"says {frames} frames, has {len(values)}{hint}", line=None)
        return Recording(rig.skeleton, rig.nodes, rig.kinds, values, rate=rate, unit=None)

    def _rig(self) -> "_Rig":
        """Read the hierarchy; takes of one actor often have the same, letter by letter."""
        self._has_more()
        end = self.data.find(b"\n", self.data.find(b"MOTION")) + 1
        hierarchy = self.data[:end]
        try:
            rig = _rig_of(hierarchy, self.limits)
        except FormatError:  # which doesn't know what file it is about
            return self.read_hierarchy()
        self.at, self.line = end, hierarchy.count(b"\n")
        return rig

    def _error(self, message: str, line: int | None = 0) -> FormatError:
        return FormatError(f"{place(self.path, self.line if line == 0 else line)}: {message}")

    def _next_line(self) -> bytes | None:
        """Return the next line that is not blank, without its outer blanks; None at the end."""
        while self._has_more():
            end = self.data.find(b"\n", self.at)
            end = len(self.data) if end < 0 else end
            line = self.data[self.at : end].strip()
            self.at = end + 1
            self.line += 1
            if line:
                return line
        return None

    def _has_more(self) -> bool:
        """Whether there are lines after this place; the next block is read if need be."""
        if self.at >= len(self.data):
            self.data, self.at = self.file.read(BLOCK), 0
        return self.at < len(self.data)

    def _statements(self) -> Iterator[bytes]:
        """Yield the lines of the hierarchy; a brace is a statement of its own."""
        while (line := self._next_line()) is not None:
            if b"{" not in line and b"}" not in line:
                yield line
                continue
            for part in re.split(rb"([{}])", line):
                if part.strip():
                    yield part.strip()

    def read_hierarchy(self) -> "_Rig":
        """Read up to the line of MOTION."""
        self._read_nodes()
        columns = [(i, k) for i, n in enumerate(self.nodes) for k in n.channels or ()]
        nodes, kinds = np.array(columns, dtype=np.int64).reshape(-1, 2).T
        skeleton = Skeleton(
            names=tuple(n.name for n in self.nodes),
            parents=np.array([n.parent for n in self.nodes], dtype=np.int64),
            offsets=np.array([n.offset for n in self.nodes], dtype=np.float64),
            turned_by="parent",
        )
        return _Rig(skeleton, np.ascontiguousarray(nodes), np.ascontiguousarray(kinds))

    def _read_nodes(self) -> None:
        first = self._next_line()
        if first is None or first.upper() != b"HIERARCHY":
            raise self._error("not a BVH file: line 1 is not HIERARCHY", line=None)
        open_nodes: list[int] = []  # from the root to the node whose braces are open
        heading = -1  # a node whose brace must come next
        names: dict[str, int] = {}
        for statement in self._statements():
            word, *rest = statement.split(None, 1)
            word = word.upper()
            if (word == b"{") != (heading >= 0):
                raise self._error(
                    f"expected '{{', found {_quoted(statement)}"
                    if heading >= 0
                    else "'{' without a joint before it"
                )
            if word == b"{":
                open_nodes.append(heading)
                self.limits.check_levels(len(open_nodes), self.path, self.line)
                heading = -1
            elif word == b"}":
                if not open_nodes:
                    raise self._error("'}' without a '{' before it")
                self._check_node(self.nodes[open_nodes.pop()])
            elif word == b"MOTION":
                if open_nodes:
                    name = shown(self.nodes[open_nodes[-1]].name)
                    raise self._error(f"MOTION before the '}}' of joint '{name}'")
                if not self.nodes:
                    raise self._error("MOTION before any joint")
                return
            elif word in (b"ROOT", b"JOINT", b"END"):
                heading = self._add_node(word, b"".join(rest), open_nodes, names)
            elif word in (b"OFFSET", b"CHANNELS") and open_nodes:
                self._describe(self.nodes[open_nodes[-1]], word, b"".join(rest).split())
            else:
                raise self._error(f"expected a joint, found {_quoted(statement)}")
        raise self._error("ends before MOTION; is the file cut off?", line=None)

    def _add_node(
        self, word: bytes, rest: bytes, open_nodes: list[int], names: dict[str, int]
    ) -> int:
        parent = open_nodes[-1] if open_nodes else -1
        if word == b"ROOT" and self.nodes:
            raise self._error("a second ROOT; one skeleton a file is read")
        if word != b"ROOT" and parent < 0:
            raise self._error(f"{_quoted(word)} outside the braces of the ROOT")
        if parent >= 0 and self.nodes[parent].name.endswith("/End"):
            raise self._error(f"End Site of '{shown(self.nodes[parent].name[:-4])}' has children")
        name = f"{self.nodes[parent].name}/End" if word == b"END" else decoded(rest)
        if not name:
            raise self._error("a joint without a name")
        if name in names:
            raise self._error(f"joint '{shown(name)}' stands twice, first in line {names[name]}")
        names[name] = self.line
        self.nodes.append(_Node(name, parent, self.line))
        self.limits.check_joints(len(self.nodes), self.path, self.line)
        return len(self.nodes) - 1

    def _describe(self, node: _Node, word: bytes, values: list[bytes]) -> None:
        if word == b"OFFSET":
            if node.offset is not None:
                raise self._error(f"joint '{shown(node.name)}' has two OFFSETs")
            numbers = tuple(parse_number(v) for v in values[:3])
            if len(values) != 3 or any(map(math.isnan, numbers)):
                raise self._error(
                    f"OFFSET of '{shown(node.name)}' is {_quoted(b' '.join(values[:4]))}, "
                    "expected three numbers"
                )
            node.offset = numbers
            return
        if node.channels is not None:
            raise self._error(f"joint '{shown(node.name)}' has two lists of CHANNELS")
        if node.name.endswith("/End"):
            raise self._error(f"the End Site '{shown(node.name)}' has CHANNELS")
        count, names = (values[0], [v.lower() for v in values[1:8]]) if values else (b"", [])
        if count not in (b"1", b"2", b"3", b"4", b"5", b"6"):
            raise self._error(
                f"joint '{shown(node.name)}' has {_quoted(count)} channels, expected 1 to 6"
            )
        if len(values) - 1 != int(count):
            raise self._error(
                f"joint '{shown(node.name)}' says {int(count)} channels, names {len(values) - 1}"
            )
        for i, name in enumerate(names):
            if name not in CHANNELS:
                raise self._error(f"joint '{shown(node.name)}': unknown channel {_quoted(name)}")
            if name in names[:i]:
                raise self._error(f"joint '{shown(node.name)}': channel {_quoted(name)} twice")
        node.channels = tuple(CHANNELS[n] for n in names)

    def _check_node(self, node: _Node) -> None:
        if node.offset is None:
            raise self._error(f"joint '{shown(node.name)}' has no OFFSET", node.line)
        if node.channels is None and not node.name.endswith("/End"):
            raise self._error(f"joint '{shown(node.name)}' has no CHANNELS", node.line)

    def _read_motion_header(self) -> tuple[int, float]:
        frames = re.fullmatch(rb"(?i)frames\s*:\s*(\S+)", self._next_line() or b"")
        if frames is None:
            raise self._error("expected 'Frames: N' after MOTION")
        number = frames[1]
        if not re.fullmatch(rb"\+?[0-9]{1,%d}" % MOST_DIGITS, number):
            raise self._error(f"says {_quoted(number)} frames, expected a number of frames")
        time = re.fullmatch(rb"(?i)frame\s*time\s*:\s*(\S+)", self._next_line() or b"")
        if time is None:
            raise self._error("expected 'Frame Time: S' after Frames")
        seconds = parse_number(time[1])
        if not SHORTEST_FRAME <= seconds <= LONGEST_FRAME:
            raise self._error(
                f"frame time is {_quoted(time[1])}, it must be between 1/10000 s and 10 s"
            )
        if int(number) == 0:
            raise self._error("says 0 frames; there is no motion in the file", line=self.line - 1)
        return int(number), _rate(time[1], seconds)

    def _read_rows(self, scales: FloatArray) -> FloatArray:
        """Read the rows of numbers; the memory follows the file, not what it says of itself."""
        table = FrameTable(np.arange(len(scales)), scales)
        kernel, blocks = compiled("text"), 0
        while self._has_more():
            if kernel is not None:
                self.at, lines = table.scan(kernel.read_rows, self.data, self.at)
                self.line += lines
            if self.at < len(self.data):  # there is no kernel, or it has met what is no row
                rest = self.data[self.at :]
                table.extend(self._rows_of(rest, len(scales)))
                self.at = len(self.data)
                self.line += rest.count(b"\n")
            self.limits.check_frames(table.frames, self.path)
            if not blocks:
                table.expect(len(self.data), self.file.size)
            blocks += 1
        return table.finish()

    def _rows_of(self, block: bytes, width: int) -> FloatArray:
        tokens = find_tokens(block)
        breaks = np.flatnonzero(tokens.text == ord("\n"))
        upto = np.append(np.searchsorted(tokens.starts, breaks), len(tokens.starts))
        counts = np.diff(upto, prepend=0)
        wrong = np.flatnonzero((counts != width) & (counts != 0))
        whole = int(upto[wrong[0]] - counts[wrong[0]]) if len(wrong) else len(tokens.starts)
        values, bad = parse_numbers(tokens.text, tokens.starts[:whole], tokens.ends[:whole])
        if len(bad):
            row = int(np.searchsorted(upto, bad[0], side="right"))
            column = int(bad[0] - upto[row] + counts[row]) + 1
            raise self._error(
                f"value {column} is {_quoted(tokens.word(int(bad[0])))}, expected a number",
                line=self.line + row + 1,
            )
        if len(wrong):
            raise self._error(
                f"a frame has {counts[wrong[0]]} values, the channels need {width}",
                line=self.line + int(wrong[0]) + 1,
            )
        return values.reshape(-1, width)


@dataclass(frozen=True, slots=True)
class _Rig:
    """A skeleton, and the node and the kind of each channel."""

    skeleton: Skeleton
    nodes: IndexArray
    kinds: IndexArray


@lru_cache(maxsize=16)
def _rig_of(hierarchy: bytes, limits: Limits) -> _Rig:
    """Read a hierarchy that ends with the line of MOTION; FormatError if it doesn't."""
    bvh = _Bvh(Path(), TextFile(Path(), io.BytesIO(), 0), limits, hierarchy)
    rig = bvh.read_hierarchy()
    if bvh.at != len(hierarchy):
        raise FormatError("MOTION stands earlier")
    return rig


def _rate(text: bytes, seconds: float) -> float:
    """Return the frames a second; a whole number where the frame time is its rounded inverse."""
    whole = round(1 / seconds)
    mantissa = re.split(rb"[eE]", text)
    decimals = len(mantissa[0].partition(b".")[2]) - (float(mantissa[1]) if mantissa[1:] else 0)
    if whole and abs(1 / whole - seconds) <= 0.5 * 10.0**-decimals:
        return float(whole)
    return 1 / seconds


def _quoted(word: bytes) -> str:
    return f"'{shown(decoded(word), 40)}'"
