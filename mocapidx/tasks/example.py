"""A motion that is pointed at: a file or a document of a store, or a part of it."""

import os.path
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.featureset import FeatureSet
from mocapidx.features.gaps import Unspecified, unspecified_within
from mocapidx.features.unspecified import feature_words
from mocapidx.model import FloatArray, WordArray
from mocapidx.printable import meant, shown
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.skeleton.resample import resample_motion
from mocapidx.store.manifest import Placed
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.read import ReadOptions, read_take
from mocapidx.tasks.segment_sources import untrusted_mask
from mocapidx.tasks.stored import stored_poses
from mocapidx.tasks.unspecified import unspecified_in

__all__ = [
    "Example",
    "Frames",
    "find_example",
    "forget_joints",
    "frames_of_document",
    "frames_of_file",
    "parse_example",
    "part_of",
]

SECONDS: Final = r"([0-9]{1,9}(?:\.[0-9]*)?|\.[0-9]+)?"
PART: Final = re.compile(f"{SECONDS}:{SECONDS}")
NUMBER: Final = re.compile(r"[-+0-9.,e]+")


@dataclass(frozen=True, slots=True)
class Example:
    """A motion file or a document of the store, or a part of it.

    Parameters
    ----------
    path : Path
    start, end : float or None
        In seconds; None: from the beginning, to the end.
    """

    path: Path
    start: float | None = None
    end: float | None = None

    @property
    def label(self) -> str:
        """The name that its hits get."""
        return self.path.stem


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """A motion as it is compared.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        Untrusted features are 0.
    untrusted : int
        Mask of the features that the skeleton can't tell.
    poses : ndarray of float64, shape (T, 24, 3), or None
        In metres; joints that the skeleton lacks are NaN. None: the store keeps none.
    unspecified : tuple of (int, int, int)
        Stretches in which further features can't be told.
    """

    words: WordArray
    untrusted: int
    poses: FloatArray | None
    unspecified: Unspecified = ()

    def untrusted_in(self, start: int, end: int) -> int:
        """Return the mask of the features that can't be told throughout a stretch."""
        return self.untrusted | unspecified_within(self.unspecified, start, end)


def parse_example(text: str) -> Example:
    """Understand ``FILE`` or ``FILE@START:END``, times in seconds, either may be left out.

    Raises
    ------
    ParameterError
        If a time is no number, or the end is not after the start.
    """
    name, at, times = text.rpartition("@")
    if not at or os.path.exists(text):
        return Example(Path(text))
    match = PART.fullmatch(times)
    if match is None:
        if ":" in times or NUMBER.fullmatch(times):
            raise ParameterError(
                f"{shown(name)}: a part of it is @START:END in seconds, such as @1.5:3, "
                f"not '@{shown(times, 40)}'"
            )
        return Example(Path(text))
    start, end = (float(time) if time else None for time in match.groups())
    if end is not None and end <= (start or 0.0):
        raise ParameterError(f"{shown(text)}: END must be later than START")
    return Example(Path(name), start, end)


def find_example(example: str | Path | Example, store: Snapshot) -> tuple[Example, Placed | None]:
    """Tell whether an example is a file or a document of a store; a file comes first.

    Parameters
    ----------
    example : str, Path or Example
        As text: ``FILE`` or ``FILE@START:END``; a document is named in place of FILE.
    store : Snapshot

    Returns
    -------
    example : Example
    placed : Placed or None
        The document; None for a file.

    Raises
    ------
    FormatError
        If it is neither.
    ParameterError
        If the part can't be understood.
    """
    by_name = {placed.document.name: placed for placed in store.documents()}
    if not isinstance(example, Example):
        whole = Example(Path(example))
        example = whole if str(example) in by_name else parse_example(str(example))
    if os.path.exists(example.path):
        return example, None
    name = str(example.path)
    if name not in by_name:
        raise FormatError(
            f"{shown(name)}: no such file, and no document of {shown(store.path)}"
            f"{meant(name, by_name)}"
        )
    return example, by_name[name]


def part_of(example: Example, frames: int, rate: float) -> tuple[int, int]:
    """Give the frames of the part that is asked for.

    Parameters
    ----------
    example : Example
    frames : int
        Of the whole motion.
    rate : float
        In Hz.

    Returns
    -------
    start, end : int
        Half-open, at least one frame.

    Raises
    ------
    ParameterError
        If no frame lies in the part.
    """
    start = round((example.start or 0.0) * rate)
    end = frames if example.end is None else min(frames, round(example.end * rate))
    if start < end:
        return start, end
    name = shown(str(example.path))
    if start < frames:
        raise ParameterError(
            f"{name}: no frame lies from {example.start or 0.0:g} s to {example.end:g} s; "
            f"there is one every {1 / rate:.3g} s"
        )
    raise ParameterError(
        f"{name}: lasts {frames / rate:.2f} s, the part starts at {example.start or 0.0:.2f} s"
    )


def frames_of_file(
    path: Path, feature_set: FeatureSet, rate: float, options: ReadOptions
) -> Frames:
    """Read a motion file.

    Parameters
    ----------
    path : Path
    feature_set : FeatureSet
    rate : float
        To compare at, in Hz.
    options : ReadOptions
        How the file is understood.

    Returns
    -------
    Frames

    Raises
    ------
    FormatError
        If the file can't be used.
    """
    motion = resample_motion(read_take(path, options).motion, rate)
    told = feature_words(motion, feature_set)
    poses = forget_joints(motion.positions.astype(np.float64), motion.made)
    return Frames(told.words, told.untrusted, poses, told.unspecified)


def frames_of_document(store: Snapshot, placed: Placed) -> Frames:
    """Read a document of a store.

    Parameters
    ----------
    store : Snapshot
    placed : Placed
        One of its documents.

    Returns
    -------
    Frames

    Raises
    ------
    StoreError
        If the store is damaged.
    """
    document, start = placed.document, placed.frame_offset
    words = store.array(placed.file, FRAME_WORDS.path, start, start + document.frames)
    poses: FloatArray | None = None
    if store.manifest.settings.poses:
        poses = forget_joints(
            stored_poses(store, placed).astype(np.float64), document.rig.get("made", ())
        )
    return Frames(
        words.astype(np.uint64), untrusted_mask(document), poses, unspecified_in(document)
    )


def forget_joints(positions: FloatArray, made: object) -> FloatArray:
    """Forget the joints that a joint map made up.

    Parameters
    ----------
    positions : ndarray of float, shape (T, 24, 3)
        In metres; changed in place.
    made : object
        Names of joints; anything else than a list or a tuple: none.

    Returns
    -------
    ndarray
        `positions`, with NaN for those joints.
    """
    names = made if isinstance(made, (list, tuple)) else ()
    positions[:, [joint in names for joint in CANONICAL_JOINTS]] = np.nan
    return positions
