"""ASF: the skeleton of an Acclaim file pair, bone by bone.

A bone is known by its far end: the node of a bone is where it ends. Its rotation is given in a
frame of its own, `axis`, and turns the bone itself.
"""

import io
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.numbers import parse_number
from mocapidx.formats.text import Limits, decoded, place, read_text
from mocapidx.model import FloatArray, Skeleton
from mocapidx.printable import shown
from mocapidx.units import INCH

__all__ = ["Acclaim", "read_asf"]

DEGREES_OF_FREEDOM: Final = {b"tx": 0, b"ty": 1, b"tz": 2, b"rx": 3, b"ry": 4, b"rz": 5}
AXES: Final = {b"X": 3, b"Y": 4, b"Z": 5}
SECTIONS: Final = (b":units", b":root", b":bonedata", b":hierarchy")


@dataclass(frozen=True, slots=True)
class Acclaim:
    """What an ASF says: the skeleton, and how the rows of an AMC are to be read.

    Parameters
    ----------
    path : Path
        The file.
    skeleton : Skeleton
        Node 0 is the root, every other node the far end of a bone.
    columns : tuple of tuple of int
        For each node its channel kinds (as in `Recording`) in the order of an AMC row; empty
        for bones that an AMC does not list.
    turns : tuple of tuple of int
        For each node the kinds of rotation in the order of its axis: the first is applied
        first.
    unit : float
        Metres in one unit of length.
    degrees : bool
        Whether the angles of an AMC without a word on it are degrees.
    """

    path: Path
    skeleton: Skeleton
    columns: tuple[tuple[int, ...], ...]
    turns: tuple[tuple[int, ...], ...]
    unit: float
    degrees: bool


def read_asf(path: Path, limits: Limits) -> Acclaim:
    """Read an ASF file.

    Parameters
    ----------
    path : Path
        The file.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    Acclaim
        The skeleton and the layout of its AMC rows.

    Raises
    ------
    FormatError
        If the file is no ASF file, or its bones are no tree with one root.
    """
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return _Asf(path, limits).read(read_text(path, limits))  # which says why
    return _read_asf(path, limits, (status.st_ino, status.st_size, status.st_mtime_ns))


@lru_cache(maxsize=8)
def _read_asf(path: Path, limits: Limits, state: tuple[int, int, int]) -> Acclaim:
    """Read a file once for all the takes of one actor; `state` changes when the file does."""
    return _Asf(path, limits).read(read_text(path, limits))


@dataclass
class _Bone:
    name: str
    line: int
    values: dict[bytes, list[bytes]] = field(default_factory=dict)
    lines: dict[bytes, int] = field(default_factory=dict)


@dataclass
class _Asf:
    path: Path
    limits: Limits
    degrees: bool = True
    unit: float = INCH  # `length 1.0`
    root: _Bone = field(default_factory=lambda: _Bone("root", 0))
    bones: dict[str, _Bone] = field(default_factory=dict)
    parents: dict[str, tuple[str, int]] = field(default_factory=dict)

    def read(self, data: bytes) -> Acclaim:
        seen: dict[bytes, int] = {}
        section, bone = b"", None
        for number, words in _lines(data):
            if words[0].startswith(b":"):
                section = words[0].lower()
                self._check_section(number, section, seen, bone)
                seen[section] = number
            elif section == b":units":
                self._read_unit(number, words)
            elif section == b":root":
                self._describe(self.root, number, words)
            elif section == b":bonedata":
                bone = self._read_bone(bone, number, words)
            elif section == b":hierarchy":
                self._read_children(number, words)
            elif not seen:
                break
        self._check_sections(seen, bone)
        return self._acclaim(self._order(seen[b":hierarchy"]))

    def _error(self, line: int | None, message: str) -> FormatError:
        return FormatError(f"{place(self.path, line)}: {message}")

    def _check_section(
        self, line: int, section: bytes, seen: dict[bytes, int], bone: _Bone | None
    ) -> None:
        if bone is not None:
            raise self._error(bone.line, f"bone '{shown(bone.name)}' has no end")
        if section in SECTIONS and section in seen:
            raise self._error(line, f"a second {decoded(section)}, first in line {seen[section]}")
        if section == b":hierarchy" and b":bonedata" not in seen:
            raise self._error(None, "the section :bonedata is missing before :hierarchy")

    def _check_sections(self, seen: dict[bytes, int], bone: _Bone | None) -> None:
        if not seen:
            raise self._error(None, "not an ASF file: it has no sections such as :bonedata")
        for section in SECTIONS[1:]:
            if section not in seen:
                raise self._error(None, f"the section {decoded(section)} is missing")
        if bone is not None:
            raise self._error(bone.line, f"bone '{shown(bone.name)}' has no end")

    def _read_unit(self, line: int, words: list[bytes]) -> None:
        if words[0] == b"length":
            length = parse_number(words[1]) if len(words) == 2 else math.nan
            if not 1e-6 <= length <= 1e6:
                raise self._error(line, f"the unit {_quoted(words)} is no sensible length")
            self.unit = INCH / length
        elif words[0] == b"angle":
            if len(words) != 2 or words[1][:3] not in (b"deg", b"rad"):
                raise self._error(line, f"the unit {_quoted(words)} is neither deg nor rad")
            self.degrees = words[1].startswith(b"deg")

    def _describe(self, bone: _Bone, line: int, words: list[bytes]) -> None:
        key = words[0].lower()
        if key in (b"order", b"axis", b"position", b"orientation",
                   b"direction", b"length", b"dof"):  # fmt: skip
            if key in bone.values:
                raise self._error(line, f"bone '{shown(bone.name)}' has a second {decoded(key)}")
            bone.values[key] = words[1:]
            bone.lines[key] = line

    def _read_bone(self, bone: _Bone | None, line: int, words: list[bytes]) -> _Bone | None:
        key = words[0].lower()
        if key == b"begin":
            if bone is not None:
                raise self._error(line, f"begin before the end of bone '{shown(bone.name)}'")
            return _Bone("", line)
        if bone is None:
            raise self._error(line, f"expected begin, found {_quoted(words)}")
        if key == b"end":
            self._finish(bone)
            return None
        if key == b"name":
            if bone.name or len(words) != 2:
                raise self._error(line, f"expected one name a bone, found {_quoted(words)}")
            bone.name = decoded(words[1])
        else:
            self._describe(bone, line, words)
        return bone

    def _finish(self, bone: _Bone) -> None:
        name = shown(bone.name)
        if not bone.name:
            raise self._error(bone.line, "a bone without a name")
        if bone.name == "root":
            raise self._error(bone.line, "a bone is called root: that is the name of :root")
        if bone.name in self.bones:
            first = self.bones[bone.name].line
            raise self._error(bone.line, f"bone '{name}' stands twice, first in line {first}")
        for key in (b"direction", b"length"):
            if key not in bone.values:
                raise self._error(bone.line, f"bone '{name}' has no {decoded(key)}")
        self.bones[bone.name] = bone
        self.limits.check_joints(len(self.bones) + 1, self.path, bone.line)

    def _read_children(self, line: int, words: list[bytes]) -> None:
        if words[0] in (b"begin", b"end") and len(words) == 1:
            return
        parent, *children = map(decoded, words)
        for name in (parent, *children):
            if name not in self.bones and name != "root":
                raise self._error(line, f"unknown bone '{shown(name)}' in the hierarchy")
        for child in children:
            if child == parent:
                raise self._error(line, f"bone '{shown(child)}' is its own parent")
            if child == "root":
                raise self._error(line, f"root has the parent '{shown(parent)}'")
            if child in self.parents:
                other, first = self.parents[child]
                raise self._error(
                    line,
                    f"bone '{shown(child)}' has a second parent '{shown(parent)}', "
                    f"first '{shown(other)}' in line {first}",
                )
            self.parents[child] = (parent, line)

    def _order(self, line: int) -> list[str]:
        """Return all names, parents first; what the root does not reach is an error."""
        children: dict[str, list[str]] = {}
        for child, (parent, _) in self.parents.items():
            children.setdefault(parent, []).append(child)
        order, level, depth = ["root"], ["root"], 0
        while level:
            self.limits.check_levels(depth, self.path, line)
            level = [child for name in level for child in children.get(name, ())]
            order += level
            depth += 1
        lost = self.bones.keys() - set(order)
        for name in self.bones:
            if name in lost and name not in self.parents:
                raise self._error(
                    self.bones[name].line, f"bone '{shown(name)}' has no parent in :hierarchy"
                )
        for name in self.bones:
            if name in lost:
                at = self.parents[name][1]
                raise self._error(at, f"bone '{shown(name)}' is its own ancestor")
        return order

    def _acclaim(self, order: list[str]) -> Acclaim:
        bones = [self.root, *(self.bones[name] for name in order[1:])]
        index = {name: i for i, name in enumerate(order)}
        turns = [self._turns(bone) for bone in bones]
        frames = [self._frame(b, t) for b, t in zip(bones, turns, strict=True)]
        skeleton = Skeleton(
            names=tuple(order),
            parents=np.array([-1, *(index[self.parents[n][0]] for n in order[1:])], np.int64),
            offsets=np.array([self._offset(bone) for bone in bones]),
            turned_by="own",
            axes=np.array(frames),
        )
        columns = tuple(self._columns(bone) for bone in bones)
        return Acclaim(self.path, skeleton, columns, tuple(turns), self.unit, self.degrees)

    def _numbers(self, bone: _Bone, key: bytes, count: int, default: float) -> list[float]:
        words = bone.values.get(key)
        if words is None:
            return [default] * count
        numbers = [parse_number(w) for w in words[:count]]
        if len(numbers) != count or any(map(math.isnan, numbers)):
            raise self._error(
                bone.lines[key],
                f"{decoded(key)} of bone '{shown(bone.name)}' is {_quoted(words)}, "
                f"expected {count} number{'s' * (count > 1)}",
            )
        return numbers

    def _offset(self, bone: _Bone) -> FloatArray:
        if bone is self.root:
            return np.array(self._numbers(bone, b"position", 3, 0.0))
        length = self._numbers(bone, b"length", 1, 0.0)[0]
        if length < 0:
            raise self._error(
                bone.lines[b"length"], f"bone '{shown(bone.name)}' has the length {length:g}"
            )
        with np.errstate(over="ignore"):
            offset = np.array(self._numbers(bone, b"direction", 3, 0.0)) * length
        if not np.isfinite(offset).all():
            raise self._error(bone.line, f"bone '{shown(bone.name)}' is endless")
        return offset

    def _turns(self, bone: _Bone) -> tuple[int, ...]:
        words = bone.values.get(b"axis", [b"XYZ"])
        letters = (words[-1] if words else b"").upper()
        if sorted(letters) != sorted(b"XYZ"):
            raise self._error(
                bone.lines[b"axis"],
                f"axis of bone '{shown(bone.name)}' is {_quoted(words)}, expected an order as XYZ",
            )
        return tuple(AXES[bytes([c])] for c in letters)

    def _frame(self, bone: _Bone, turns: tuple[int, ...]) -> FloatArray:
        key = b"orientation" if bone is self.root else b"axis"
        angles = np.array(self._numbers(bone, key, 3, 0.0))
        if self.degrees:
            angles = np.deg2rad(angles)
        frame = np.eye(3)
        # the three angles stand in the order of the letters: 'axis 10 20 30 ZYX' turns
        # about z by 10 first
        for kind, angle in zip(turns, angles.tolist(), strict=True):
            frame = _turn(kind - 3, angle) @ frame
        return frame

    def _columns(self, bone: _Bone) -> tuple[int, ...]:
        key = b"order" if bone is self.root else b"dof"
        words = bone.values.get(key, [b"tx", b"ty", b"tz", b"rx", b"ry", b"rz"]
                                if bone is self.root else [])  # fmt: skip
        kinds = [DEGREES_OF_FREEDOM.get(word.lower(), -1) for word in words]
        if -1 in kinds or len(set(kinds)) < len(kinds):
            raise self._error(
                bone.lines[key],
                f"{decoded(key)} of bone '{shown(bone.name)}' is {_quoted(words)}, "
                "expected different ones of tx ty tz rx ry rz",
            )
        return tuple(kinds)


def _lines(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Yield number (from 1) and words of each line that is neither blank nor a comment."""
    for number, line in enumerate(io.BytesIO(data), start=1):
        words = line.split()
        if words and not words[0].startswith(b"#"):
            yield number, words


def _turn(axis: int, angle: float) -> FloatArray:
    """Return the matrix that turns about axis 0, 1, 2 by an angle in radians."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = math.cos(angle)
    turn[j, i] = math.sin(angle)
    turn[i, j] = -turn[j, i]
    return turn


def _quoted(words: list[bytes]) -> str:
    return f"'{shown(decoded(b' '.join(words[:12])), 60)}'"
