"""AMC: the motion of an Acclaim file pair, one line a bone and frame.

What the angles are in, and which bones there are in which order, the ASF and the first lines
tell; `mocapidx.formats.amc_frames` reads the rest.
"""

import math
import os
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.amc_frames import (
    BLANKS,
    FRAME_NUMBER,
    Layout,
    numbered_words,
    quoted,
    read_frames,
)
from mocapidx.formats.asf import Acclaim, read_asf
from mocapidx.formats.numbers import parse_number
from mocapidx.formats.rates import EXPECTED, is_rate
from mocapidx.formats.table import FrameTable
from mocapidx.formats.text import Limits, decoded, open_text, place
from mocapidx.model import IndexArray, Recording

__all__ = ["find_skeleton", "read_amc"]

BLOCK: Final = 1 << 18  # bytes read at a time: what fits a processor's cache
SETTLED: Final = 2_000_000_000  # nanoseconds; some file systems count time in steps of two seconds


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


def _skeletons_in(folder: Path) -> tuple[Path, ...]:
    """Return the ASF files of a folder; of one with many takes it is read once."""
    try:
        changed = os.stat(folder).st_mtime_ns
        # a folder that changes right now may do so once more at what its clock takes for the same
        # moment
        settled = time.time_ns() - changed > SETTLED
        return (_settled_skeletons if settled else _list_skeletons)(folder, changed)
    except OSError:
        return ()


def _list_skeletons(folder: Path, changed: int) -> tuple[Path, ...]:
    names = sorted(name for name in os.listdir(folder) if name.lower().endswith(".asf"))
    return tuple(path for path in map(folder.joinpath, names) if path.suffix.lower() == ".asf")


_settled_skeletons = lru_cache(maxsize=64)(_list_skeletons)


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
    with open_text(path, limits) as file:
        text = file.read(BLOCK)
        acclaim = read_asf(skeleton_path or find_skeleton(path), limits)
        while (header := _read_header(path, text)) is None:
            more = file.read(max(BLOCK, len(text)))
            if not more:
                raise FormatError(f"{place(path)}: not an AMC file: it has no frames")
            text += more
        text = text[header.end :] + file.read(BLOCK)
        layout = _layout(path, text, header, acclaim)
        nodes, kinds, order = _channels(acclaim, layout)
        degrees = acclaim.degrees if header.degrees is None else header.degrees
        scales = np.where((kinds >= 3) & degrees, np.pi / 180, 1.0)
        targets = np.argsort(order)
        table = FrameTable(targets, scales[targets])
        read_frames(file, text, header.lines, layout, table, limits, BLOCK)
    return Recording(acclaim.skeleton, nodes, kinds, table.finish(), header.rate, acclaim.unit)


@dataclass(frozen=True, slots=True)
class _Header:
    degrees: bool | None
    rate: float | None
    end: int  # in bytes
    lines: int


def _read_header(path: Path, data: bytes) -> _Header | None:
    """Read what stands before the first frame; None if there is none."""
    degrees = rate = None
    at = number = 0
    while at < len(data):
        end = data.find(b"\n", at)
        line = data[at : end if end >= 0 else len(data)]
        if FRAME_NUMBER.fullmatch(line.strip(BLANKS)):
            return _Header(degrees, rate, at, number)
        words = line.split()
        at = end + 1 if end >= 0 else len(data)
        number += 1
        if not words or words[0].startswith(b"#"):
            continue
        key = words[0].upper()
        if not key.startswith(b":"):
            raise FormatError(
                f"{place(path, number)}: not an AMC file: expected a frame number, "
                f"found {quoted(words[0])}"
            )
        if key in (b":DEGREES", b":RADIANS"):
            degrees = key == b":DEGREES"
        elif key == b":SAMPLES-PER-SECOND":
            rate = parse_number(words[1]) if len(words) == 2 else math.nan
            if not is_rate(rate):
                raise FormatError(
                    f"{place(path, number)}: {quoted(b' '.join(words))}: "
                    f"expected samples a second {EXPECTED}"
                )
    return None


def _layout(path: Path, text: bytes, header: _Header, acclaim: Acclaim) -> Layout:
    """Return the layout: the bones of the skeleton in the order of the first frame."""
    moved = {n: i for i, n in enumerate(acclaim.skeleton.names) if acclaim.columns[i]}
    if not moved:
        raise FormatError(f"{place(acclaim.path)}: none of its bones can move")
    order: dict[bytes, int] = {}
    for _, words in numbered_words(text, header.lines + 1, most=len(moved) + 1):
        if decoded(words[0]) in moved:
            order.setdefault(words[0], moved[decoded(words[0])])
    rest = {n.encode("utf-8", "surrogateescape"): i for n, i in moved.items()}
    order |= {n: i for n, i in rest.items() if n not in order}
    counts = tuple(len(acclaim.columns[i]) for i in order.values())
    return Layout(path, acclaim.path, tuple(order), tuple(order.values()), counts)


def _channels(acclaim: Acclaim, layout: Layout) -> tuple[IndexArray, IndexArray, list[int]]:
    """Return node, kind and column of each channel; the rotation applied last comes first."""
    begins = dict(zip(layout.nodes, np.cumsum((0, *layout.counts)).tolist(), strict=False))
    nodes, kinds, order = [], [], []
    for node in sorted(layout.nodes):
        columns = acclaim.columns[node]
        wanted = (0, 1, 2, *reversed(acclaim.turns[node]))
        for kind in (k for k in wanted if k in columns):
            nodes.append(node)
            kinds.append(kind)
            order.append(begins[node] + columns.index(kind))
    return np.array(nodes, dtype=np.int64), np.array(kinds, dtype=np.int64), order
