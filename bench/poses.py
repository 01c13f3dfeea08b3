"""Forward kinematics and feature values: from channels to feature words."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from bench.corpus import Bench
from bench.measure import grow, interleaved, kernels
from bench.peers import kinematics_with_rotation
from bench.table import Row
from mocapidx.features.extract import extract_features
from mocapidx.features.featureset import load_feature_set
from mocapidx.features.words import pack_words
from mocapidx.formats.registry import read_recording
from mocapidx.model import Motion, Recording
from mocapidx.skeleton.kinematics import node_positions
from mocapidx.tasks.read import read_motion

__all__ = ["measure"]

FRAMES = 3000


def measure(bench: Bench) -> Iterator[Row]:
    """Time the kinematics of all nodes of a BVH, and the features of an AMC."""
    recording = read_recording(bench.bvh)
    if not isinstance(recording, Recording):
        raise TypeError("the largest BVH holds points")
    yield from kinematics(bench, only_turning(recording))
    yield from features(bench)


def kinematics(bench: Bench, recording: Recording) -> Iterator[Row]:
    """Place all nodes; the least is one product of matrices a node and frame, made at one go."""
    recording = of_length(recording, FRAMES)
    parents, offsets, orders, angles = for_rotation(recording)
    nodes = range(len(parents))
    placed = node_positions(recording, nodes, "add")
    peer = kinematics_with_rotation(parents, offsets, orders, angles).transpose(1, 0, 2)
    if not np.allclose(placed - placed[:, :1], peer, atol=1e-6):
        raise ValueError("the two forward kinematics do not agree")
    matrices = np.random.default_rng(1).random((len(parents), FRAMES, 3, 3))

    def ours(kernel: str, given: Recording = recording) -> Callable[[], object]:
        def place() -> object:
            with kernels(kernel):
                return node_positions(given, nodes, "add")

        return place

    seconds = interleaved(
        {
            "c": ours("c"),
            "numpy": ours("numpy"),
            "scipy": lambda: kinematics_with_rotation(parents, offsets, orders, angles),
            "product": lambda: np.matmul(matrices, matrices),
        },
        bench.rounds,
    )
    growth = grow(lambda n: ours("c", of_length(recording, n * FRAMES // 4)), bench.times)
    for kernel in ("c", "numpy"):
        cell = seconds[kernel] / len(parents) / FRAMES
        yield Row(
            f"kinematics, {len(parents)} nodes, {FRAMES} frames, {kernel}: "
            f"{cell * 1e9:.0f} ns a node and frame",
            seconds[kernel],
            "scipy Rotation",
            seconds["scipy"],
            "bare product of 3 x 3 matrices",
            seconds["product"],
            growth if kernel == "c" else None,
        )


def features(bench: Bench) -> Iterator[Row]:
    """Make feature words of positions; the least is one scalar product for each feature."""
    feature_set = load_feature_set("f39")
    motion = read_motion(bench.amc)

    def longer(times: int) -> Motion:
        frames = np.resize(np.arange(len(motion.positions)), times * FRAMES)
        return replace(motion, positions=motion.positions[frames], rate=30.0)

    def words(given: Motion) -> Callable[[], object]:
        return lambda: pack_words(extract_features(given, feature_set, 30.0))

    one = longer(1)
    joint, other = (np.ascontiguousarray(one.positions[:, number]) for number in (0, 1))
    seconds = interleaved(
        {
            "ours": words(one),
            "products": lambda: [np.einsum("tx,tx->t", joint, other) for _ in feature_set.features],
        },
        bench.rounds,
    )
    growth = grow(lambda n: words(longer(n)), bench.times)
    yield Row(
        f"39 features, {FRAMES} frames: {seconds['ours'] / FRAMES * 1e6:.1f} µs a frame",
        seconds["ours"],
        limit="one product of two joints for each feature",
        least=seconds["products"],
        growth=growth,
    )


def of_length(recording: Recording, frames: int) -> Recording:
    """Repeat the frames of a recording until there are so many."""
    return replace(
        recording,
        values=recording.values[np.resize(np.arange(len(recording.values)), max(frames, 1))],
    )


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
