"""BVH text of a skeleton and its channels: what `read_bvh` reads, the other way round."""

import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.formats.decimals import decimal, decimal_rows, degrees
from mocapidx.model import FloatArray, Recording, Skeleton

__all__ = ["bvh_text"]

CHANNEL_NAMES: Final = (
    "Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation",
)  # fmt: skip
STILL: Final = (5, 3, 4)  # of joints without channels: readers want some
UNFIT: Final = re.compile(r"[\x00-\x1f\x7f{}]")  # what would end the name or its line


def bvh_text(recording: Recording, rate: float | None = None) -> bytes:
    """Write a recording as BVH.

    Parameters
    ----------
    recording : Recording
        Nodes are joints (``turned_by`` is "parent"), without frames of their own. A leaf
        ``X/End`` without channels, below ``X``, becomes an End Site.
    rate : float, optional
        Frames a second, in Hz; by default the recording's own.

    Returns
    -------
    bytes
        The text. Translations and offsets read back as the same numbers, angles as `degrees`
        says. Joints stand depth first, the channels of each in the order that they have in the
        recording; a joint without channels gets three that stay 0.

    Raises
    ------
    ParameterError
        If the skeleton is Acclaim's, a number is not finite, or no rate is known.
    """
    skeleton = recording.skeleton
    if skeleton.turned_by != "parent" or skeleton.axes is not None:
        raise ParameterError("a BVH has joints, not the bones of an ASF; convert the rig first")
    rate = recording.rate if rate is None else rate
    if rate is None or not (np.isfinite(rate) and rate > 0):
        raise ParameterError(f"a BVH needs a rate in Hz, got {rate}")
    if not (np.isfinite(recording.values).all() and np.isfinite(skeleton.offsets).all()):
        raise ParameterError("a BVH can't hold NaN or infinity; fill the gaps first")
    columns = _columns(recording)
    nodes = _depth_first(skeleton)
    hierarchy = _hierarchy(recording, nodes, columns)
    values = _values(recording, [c for node, _ in nodes for c in columns[node]])
    head = [*hierarchy, "MOTION", f"Frames: {len(values)}", f"Frame Time: {_frame_time(rate)}"]
    lines = [*head, *map(" ".join, decimal_rows(values)), ""]
    return "\n".join(lines).encode("utf-8", "surrogateescape")


def _columns(recording: Recording) -> list[list[int]]:
    """Return the columns of each node; -1 - kind stands for a channel that stays 0."""
    columns: list[list[int]] = [[] for _ in recording.skeleton.names]
    for column, node in enumerate(recording.channel_nodes.tolist()):
        columns[node].append(column)
    for node in range(len(columns)):
        if not columns[node] and not _is_end(recording, node):
            columns[node] = [-1 - kind for kind in STILL]
    return columns


def _is_end(recording: Recording, node: int) -> bool:
    names, parents = recording.skeleton.names, recording.skeleton.parents
    return (
        bool(parents[node] >= 0)
        and names[node] == f"{names[parents[node]]}/End"
        and not (parents == node).any()
        and not (recording.channel_nodes == node).any()
    )


def _depth_first(skeleton: Skeleton) -> list[tuple[int, int]]:
    """Return all nodes and their depths, children below their parent in their order."""
    children: dict[int, list[int]] = {}
    for node, parent in enumerate(skeleton.parents.tolist()):
        children.setdefault(parent, []).append(node)
    order, waiting = [], [(0, 0)]
    while waiting:
        node, depth = waiting.pop()
        order.append((node, depth))
        waiting += [(child, depth + 1) for child in reversed(children.get(node, ()))]
    return order


def _hierarchy(
    recording: Recording, nodes: Sequence[tuple[int, int]], columns: Sequence[Sequence[int]]
) -> list[str]:
    names = _names(recording.skeleton.names)
    lines, before = ["HIERARCHY"], -1
    for node, depth in nodes:
        lines += ["\t" * level + "}" for level in range(before, depth - 1, -1)]
        indent, before = "\t" * depth, depth
        heading = f"{'JOINT' if depth else 'ROOT'} {names[node]}" if columns[node] else "End Site"
        offset = " ".join(map(decimal, recording.skeleton.offsets[node].tolist()))
        lines += [f"{indent}{heading}", f"{indent}{{", f"{indent}\tOFFSET {offset}"]
        if columns[node]:
            kinds = [recording.channel_kinds[c] if c >= 0 else -1 - c for c in columns[node]]
            channels = " ".join(CHANNEL_NAMES[kind] for kind in kinds)
            lines.append(f"{indent}\tCHANNELS {len(kinds)} {channels}")
    return lines + ["\t" * level + "}" for level in range(before, -1, -1)]


def _names(names: Sequence[str]) -> list[str]:
    """Make names that a BVH can hold, all different; those of BVH files stay as they are."""
    taken: set[str] = set()
    fit = []
    for name in names:
        plain = UNFIT.sub("_", name).strip() or "joint"
        plain = f"{plain[:-4]}_End" if plain.endswith("/End") else plain
        unique, number = plain, 2
        while unique in taken:
            unique, number = f"{plain}_{number}", number + 1
        taken.add(unique)
        fit.append(unique)
    return fit


def _values(recording: Recording, columns: Sequence[int]) -> FloatArray:
    order = np.array(columns, dtype=np.int64)
    moved = np.flatnonzero(order >= 0)
    values = np.zeros((len(recording.values), len(order)))
    values[:, moved] = recording.values[:, order[moved]]
    turning = moved[recording.channel_kinds[order[moved]] >= 3]
    values[:, turning] = degrees(values[:, turning])
    return values


def _frame_time(rate: float) -> str:
    """Write the seconds of a frame such that they read back as the rate."""
    time = 1 / rate
    for candidate in (time, np.nextafter(time, 0), np.nextafter(time, 1)):
        if 1 / candidate == rate:
            return decimal(candidate)
    return decimal(time)
