"""The example of a query without chosen features: its features, and how firmly they hold."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mocapidx.alignment.weighted import LONGEST_PATTERN
from mocapidx.errors import ParameterError
from mocapidx.features.extract import extract_features, feature_margins, untrusted_features
from mocapidx.features.featureset import FeatureSet
from mocapidx.features.words import pack_words
from mocapidx.model import WordArray
from mocapidx.printable import shown
from mocapidx.skeleton.resample import resample_motion
from mocapidx.store.manifest import Placed
from mocapidx.store.read import Snapshot
from mocapidx.tasks.example import Example, find_example, part_of
from mocapidx.tasks.read import ReadOptions, read_take
from mocapidx.tasks.store_poses import read_shot
from mocapidx.tasks.unspecified import untrusted_between
from mocapidx.templates.oneshot import OneShot, flipping_distances

__all__ = ["ExampleShot", "read_example"]


@dataclass(frozen=True, slots=True, eq=False)
class ExampleShot:
    """An example at the rate of a store.

    Parameters
    ----------
    label : str
        The name that its hits get.
    name : str
        The file or document that it comes from, with the part in seconds where it is one.
    words : ndarray of uint64, shape (K,)
        Its feature words; what can't be trusted is 0.
    untrusted : int
        Mask of the features that it can't tell.
    shot : OneShot
    """

    label: str
    name: str
    words: WordArray
    untrusted: int
    shot: OneShot


def read_example(
    snapshot: Snapshot, example: str | Path | Example, feature_set: FeatureSet, options: ReadOptions
) -> ExampleShot:
    """Read an example: a file, or where there is no such file, a document of the store.

    Parameters
    ----------
    snapshot : Snapshot
    example : str, Path or Example
        As text: ``FILE`` or ``FILE@START:END``; a document is named in place of FILE.
    feature_set : FeatureSet
        The store's.
    options : ReadOptions
        How a file is understood.

    Returns
    -------
    ExampleShot

    Raises
    ------
    FormatError
        If the file can't be used.
    ParameterError
        If the part does not lie in it, is too long, or is of a store without poses.
    """
    example, placed = find_example(example, snapshot)
    rate = snapshot.manifest.settings.rate
    if placed is not None:
        start, end = _part(example, placed.document.frames, rate)
        untrusted = untrusted_between(placed.document, start, end)
        shot = _stored(snapshot, placed, start, end, feature_set)
    else:
        shot, untrusted = _from_file(example.path, feature_set, rate, options)
        start, end = _part(example, len(shot.bits), rate)
        # Cut after extraction: velocities and hysteresis then know what came before.
        shot = OneShot(shot.bits[start:end], shot.distances[start:end])
    cut = example.start is not None or example.end is not None
    name = f"{example.path}@{start / rate:g}:{end / rate:g}" if cut else str(example.path)
    words = pack_words(shot.bits) & ~np.uint64(untrusted)
    return ExampleShot(example.label, name, words, untrusted, shot)


def _part(example: Example, frames: int, rate: float) -> tuple[int, int]:
    """Give the first frame and the end of the part that is asked for."""
    start, end = part_of(example, frames, rate)
    if end - start > LONGEST_PATTERN:
        raise ParameterError(
            f"{shown(str(example.path))}: the example has {end - start} frames, at most "
            f"{LONGEST_PATTERN} are compared; give the part that matters as FILE@START:END"
        )
    return start, end


def _stored(
    snapshot: Snapshot, placed: Placed, start: int, end: int, feature_set: FeatureSet
) -> OneShot:
    if not snapshot.manifest.settings.poses:
        raise ParameterError(
            f"{shown(placed.document.name)}: the store keeps no poses to weigh its features by; "
            "give the motion file"
        )
    return read_shot(snapshot, placed, start, end, feature_set)


def _from_file(
    path: Path, feature_set: FeatureSet, rate: float, options: ReadOptions
) -> tuple[OneShot, int]:
    motion = resample_motion(read_take(path, options).motion, rate)
    bits = extract_features(motion, feature_set, rate)
    margins = feature_margins(motion, feature_set, rate)
    distances = flipping_distances(bits, margins.strong, margins.weak)
    untrusted = untrusted_features(motion, feature_set)
    distances[:, [bit for bit in range(bits.shape[1]) if untrusted >> bit & 1]] = np.nan
    return OneShot(bits, distances), untrusted
