"""Motions to be compared frame by frame: feature words and poses, from files or a store."""

from dataclasses import dataclass

from mocapidx.features.featureset import FeatureSet
from mocapidx.model import FloatArray, WordArray
from mocapidx.store.read import Snapshot
from mocapidx.tasks.example import (
    Example,
    Frames,
    find_example,
    frames_of_document,
    frames_of_file,
    part_of,
)
from mocapidx.tasks.read import ReadOptions

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
    frames = frames_of_file(example.path, feature_set, rate, read)
    return _cut(example.path.name, example, frames, rate)


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
    example, placed = find_example(text, store)
    rate = store.manifest.settings.rate
    if placed is None:
        return stretch_of_file(example, feature_set, rate, read)
    return _cut(placed.document.name, example, frames_of_document(store, placed), rate)


def _cut(name: str, example: Example, frames: Frames, rate: float) -> Stretch:
    # Cut after extraction: velocities and hysteresis then know what came before.
    start, end = part_of(example, len(frames.words), rate)
    poses = None if frames.poses is None else frames.poses[start:end]
    return Stretch(name, start, frames.words[start:end], frames.untrusted_in(start, end), poses)
