"""Motions to be compared frame by frame: feature words and poses, from files or a store."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.features.extract import extract_features, untrusted_features
from mocapidx.features.featureset import FeatureSet
from mocapidx.features.words import pack_words
from mocapidx.model import FloatArray, WordArray
from mocapidx.printable import shown
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.skeleton.resample import resample_motion
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.query_example import Example, parse_example
from mocapidx.tasks.read import ReadOptions, read_take
from mocapidx.tasks.segment_sources import untrusted_mask
from mocapidx.tasks.stored import stored_poses

__all__ = ["Stretch", "stretch_of_file", "stretch_of_store"]


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A motion, or a part of it.

    Parameters
    ----------
    name : str
    start : int
        The frame of the motion that frame 0 here is.
    words : ndarray of uint64, shape (T,)
        Untrusted features are 0.
    untrusted : int
        Mask of the features that the skeleton can't tell.
    poses : ndarray of float64, shape (T, 24, 3), or None
        In metres; joints that the skeleton lacks are NaN. None: the store keeps none.
    """

    name: str
    start: int
    words: WordArray
    untrusted: int
    poses: FloatArray | None


def stretch_of_file(
    example: Example, feature_set: FeatureSet, rate: float, read: ReadOptions
) -> Stretch:
    """Read a motion file, or a part of it.

    Parameters
    ----------
    example : Example
    feature_set : FeatureSet
    rate : float
        In Hz.
    read : ReadOptions
        How the file is understood.

    Returns
    -------
    Stretch

    Raises
    ------
    FormatError
        If the file can't be used.
    ParameterError
        If the part does not lie in it.
    """
    motion = resample_motion(read_take(example.path, read).motion, rate)
    words = pack_words(extract_features(motion, feature_set, rate))
    untrusted = untrusted_features(motion, feature_set)
    poses = _without(motion.positions.astype(np.float64), motion.made)
    name = example.path.name
    return _cut(name, example, words & ~np.uint64(untrusted), untrusted, poses, rate)


def stretch_of_store(
    text: str, store: Snapshot, feature_set: FeatureSet, read: ReadOptions
) -> Stretch:
    """Read a document of a store, or a part of it; a file of that name comes first.

    Parameters
    ----------
    text : str
        ``NAME`` or ``NAME@START:END``, in seconds.
    store : Snapshot
    feature_set : FeatureSet
        The store's.
    read : ReadOptions
        How a file is understood.

    Returns
    -------
    Stretch

    Raises
    ------
    FormatError, ParameterError, StoreError
    """
    places = {placed.document.name: placed for placed in store.documents()}
    rate = store.manifest.settings.rate
    example = Example(Path(text)) if text in places else parse_example(text)
    if example.path.exists():
        return stretch_of_file(example, feature_set, rate, read)
    name = text if text in places else str(example.path)
    if name not in places:
        raise ParameterError(f"{shown(name)}: neither a file nor a document of {shown(store.path)}")
    placed = places[name]
    document, start = placed.document, placed.frame_offset
    stop = start + document.frames
    words = store.array(placed.file, FRAME_WORDS.path, start, stop).astype(np.uint64)
    poses: FloatArray | None = None
    if store.manifest.settings.poses:
        poses = _without(
            stored_poses(store, placed).astype(np.float64), document.rig.get("made", ())
        )
    return _cut(name, example, words, untrusted_mask(document), poses, rate)


def _without(positions: FloatArray, made: object) -> FloatArray:
    """Forget the joints that a joint map made up."""
    names = made if isinstance(made, (list, tuple)) else ()
    positions[:, [joint in names for joint in CANONICAL_JOINTS]] = np.nan
    return positions


def _cut(
    name: str,
    example: Example,
    words: WordArray,
    untrusted: int,
    poses: FloatArray | None,
    rate: float,
) -> Stretch:
    # Cut after extraction: velocities and hysteresis then know what came before.
    start = round((example.start or 0.0) * rate)
    end = len(words) if example.end is None else min(len(words), round(example.end * rate))
    if start >= end:
        raise ParameterError(
            f"{shown(name)}: lasts {len(words) / rate:.2f} s, "
            f"nothing lies from {start / rate:.2f} s to {end / rate:.2f} s"
        )
    cut = None if poses is None else poses[start:end]
    return Stretch(name, start, words[start:end], untrusted, cut)
