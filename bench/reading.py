"""Reading and forward kinematics against public parsers and scipy."""

import contextlib
import io
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bvhio
import numpy as np

from bench.measure import paired_ratio
from bench.peers import kinematics_with_rotation, parse_amc_line_by_line
from mocapidx.formats.registry import read_recording
from mocapidx.model import Recording
from mocapidx.skeleton.kinematics import node_positions
from mocapidx.tasks.read import read_motion

Row = tuple[str, str, str, str]


def measure(corpus: Any, work: Path) -> Iterator[Row]:
    """Time reading an AMC, reading a BVH, and forward kinematics of all nodes."""
    ours, theirs, ratio = paired_ratio(
        lambda: read_recording(corpus.amc), lambda: parse_amc_line_by_line(corpus.amc)
    )
    yield row(f"read AMC, {megabytes(corpus.amc):.1f} MB", "line by line", ours, theirs, ratio)

    size = f"{megabytes(corpus.bvh):.1f} MB"
    ours, theirs, ratio = paired_ratio(
        lambda: read_recording(corpus.bvh), lambda: quietly(bvhio.readAsBvh, corpus.bvh), runs=3
    )
    yield row(f"read BVH, {size}: channels", "bvhio.readAsBvh", ours, theirs, ratio)
    ours, theirs, ratio = paired_ratio(
        lambda: read_motion(corpus.bvh), lambda: quietly(bvhio.readAsHierarchy, corpus.bvh), runs=3
    )
    yield row(f"read BVH, {size}: moving joints", "bvhio.readAsHierarchy", ours, theirs, ratio)

    recording = only_turning(read_recording(corpus.bvh))
    parents, offsets, orders, angles = for_rotation(recording)
    nodes = range(len(parents))
    placed = node_positions(recording, nodes, "add")
    placed -= placed[:, :1]
    peer = kinematics_with_rotation(parents, offsets, orders, angles).transpose(1, 0, 2)
    if not np.allclose(placed, peer, atol=1e-6):
        raise ValueError("the two forward kinematics do not agree")
    ours, theirs, ratio = paired_ratio(
        lambda: node_positions(recording, nodes, "add"),
        lambda: kinematics_with_rotation(parents, offsets, orders, angles),
    )
    what = f"forward kinematics, {len(parents)} nodes, {len(recording.values)} frames"
    yield row(what, "scipy Rotation", ours, theirs, ratio)


def quietly(function: Callable[[str], object], path: Path) -> object:
    """Call bvhio, which prints as it goes."""
    with contextlib.redirect_stdout(io.StringIO()):
        return function(str(path))


def for_rotation(
    recording: Recording,
) -> tuple[np.ndarray, np.ndarray, list[str], list[np.ndarray]]:
    """Lay a recording out for scipy: axes as letters, angles a node."""
    skeleton = recording.skeleton
    orders, angles = [], []
    for node in range(len(skeleton.names)):
        turns = (recording.channel_nodes == node) & (recording.channel_kinds >= 3)
        letters = "".join("XYZ"[kind - 3] for kind in recording.channel_kinds[turns])
        values = recording.values[:, turns]
        if not letters:  # an End Site
            letters, values = "X", np.zeros((len(recording.values), 1))
        orders.append(letters)
        angles.append(values)
    return skeleton.parents, skeleton.offsets, orders, angles


def only_turning(recording: Recording) -> Recording:
    """Leave out the channels that move nodes, which the peer knows nothing of."""
    turns = recording.channel_kinds >= 3
    return replace(
        recording,
        channel_nodes=recording.channel_nodes[turns],
        channel_kinds=recording.channel_kinds[turns],
        values=recording.values[:, turns],
    )


def megabytes(path: Path) -> float:
    """Size of a file."""
    return path.stat().st_size / 1e6


def row(what: str, peer: str, ours: float, theirs: float, ratio: float) -> Row:
    """Lay out a row: milliseconds, and how many times faster we are."""
    return what, f"{ours * 1e3:.1f} ms", f"{peer}: {theirs * 1e3:.1f} ms", f"{ratio:.1f} times"
