"""Joint positions of a store as the features see them: values, and how far they are from flipping.

Positions in a store have no zero pose, so body lengths are medians over what is read.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.features.extract import feature_margins, feature_values
from mocapidx.features.featureset import FeatureSet
from mocapidx.features.words import unpack_words
from mocapidx.model import BoolArray, FloatArray, Motion, WordArray
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.store.manifest import Placed
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.stored import pose_rows
from mocapidx.tasks.unspecified import untrusted_between
from mocapidx.templates.oneshot import OneShot, flipping_distances
from mocapidx.templates.sigma import Sample

__all__ = ["read_sample", "read_shot"]

AROUND: Final = 1.0
"""Seconds read before and after a stretch, for velocities and body lengths."""


@dataclass(frozen=True, slots=True, eq=False)
class _Stretch:
    """What is read of a stretch: its words, its features, and the motion around it."""

    words: WordArray
    bits: BoolArray
    motion: Motion
    inner: slice
    unknown: BoolArray


def read_shot(
    snapshot: Snapshot, placed: Placed, start: int, end: int, feature_set: FeatureSet
) -> OneShot:
    """Read a stretch of a document as an example.

    Parameters
    ----------
    snapshot : Snapshot
        Of a store with poses.
    placed : Placed
        The document.
    start, end : int
        In frames of the document, half open.
    feature_set : FeatureSet
        The store's.

    Returns
    -------
    OneShot
        Features as they are stored; distances unknown for those that the document can't tell.
    """
    read = _read(snapshot, placed, start, end, feature_set)
    return OneShot(read.bits, _distances(read, feature_set))


def read_sample(
    snapshot: Snapshot, placed: Placed, start: int, end: int, feature_set: FeatureSet
) -> Sample:
    """Read a stretch of a document to measure how people differ.

    Parameters
    ----------
    snapshot, placed, start, end, feature_set
        As for `read_shot`.

    Returns
    -------
    Sample
    """
    read = _read(snapshot, placed, start, end, feature_set)
    values = feature_values(read.motion, feature_set, read.motion.rate)[read.inner]
    values[:, read.unknown] = np.nan
    untrusted = untrusted_between(placed.document, start, end)
    return Sample(read.words, values, _distances(read, feature_set), untrusted)


def _read(
    snapshot: Snapshot, placed: Placed, start: int, end: int, feature_set: FeatureSet
) -> _Stretch:
    rate = snapshot.manifest.settings.rate
    around = round(AROUND * rate)
    first, last = max(0, start - around), min(placed.document.frames, end + around)
    offset = placed.frame_offset
    words = snapshot.array(placed.file, FRAME_WORDS.path, offset + start, offset + end)
    poses = pose_rows(snapshot, placed.file, offset + first, offset + last)
    features = len(feature_set.features)
    untrusted = untrusted_between(placed.document, start, end)
    return _Stretch(
        words.astype(np.uint64),
        unpack_words(words.astype(np.uint64), features),
        Motion(CANONICAL_JOINTS, poses, rate),
        slice(start - first, end - first),
        np.array([bool(untrusted >> bit & 1) for bit in range(features)]),
    )


def _distances(read: _Stretch, feature_set: FeatureSet) -> FloatArray:
    margins = feature_margins(read.motion, feature_set, read.motion.rate)
    strong, weak = margins.strong[read.inner], margins.weak[read.inner]
    distances = flipping_distances(read.bits, strong, weak)
    distances[:, read.unknown] = np.nan
    return distances
