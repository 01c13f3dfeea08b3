"""The poses of a store as motions, as good as those of the source files."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import StoreError
from mocapidx.model import FloatArray, Motion
from mocapidx.printable import shown
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.store.files import DamagedError
from mocapidx.store.manifest import Document, Placed, SegmentFile
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import POSES

__all__ = ["REST", "kept_rest", "pose_rows", "source_skeleton", "stored_motion", "stored_poses"]

FARTHEST: Final = 1e12  # metres
REST: Final = "rest"
"""Key of a document's rig: the zero pose, where the source has one. It measures the body."""


def kept_rest(rest: FloatArray) -> list[list[float] | None]:
    """Lay out a zero pose as JSON keeps it, to the last bit.

    Parameters
    ----------
    rest : ndarray of float, shape (24, 3)
        In metres; NaN for a joint that the rig lacks.

    Returns
    -------
    list
        Three numbers a joint, or None.
    """
    return [row if np.isfinite(row).all() else None for row in rest.tolist()]


def source_skeleton(document: Document) -> tuple[str, list[int]] | None:
    """Give the skeleton file that a document's source was read with.

    Parameters
    ----------
    document : Document

    Returns
    -------
    path : str
    stamp : list of int
        Its size in bytes and time of change in nanoseconds; empty where it was gone by then.
    None
        If the source has no skeleton file.

    Raises
    ------
    StoreError
        If the store has something else there.
    """
    kept = document.rig.get("skeleton")
    if kept is None:
        return None
    whole = isinstance(kept, list) and kept and {*map(type, kept[1:])} <= {int}
    if not whole or not isinstance(kept[0], str) or "\0" in kept[0]:
        raise StoreError(f"{shown(document.name)}: its skeleton is none; index it again")
    return kept[0], kept[1:]


def stored_poses(store: Snapshot, placed: Placed) -> NDArray[np.float32]:
    """Read the joint positions of a document.

    Parameters
    ----------
    store : Snapshot
    placed : Placed
        One of its documents.

    Returns
    -------
    ndarray of float32, shape (T, 24, 3)
        In metres.

    Raises
    ------
    StoreError
        If the store keeps no poses, or is damaged.
    """
    start = placed.frame_offset
    stop = start + placed.document.frames
    return pose_rows(store, placed.file, start, stop)


def pose_rows(store: Snapshot, file: SegmentFile, start: int, stop: int) -> NDArray[np.float32]:
    """Read joint positions of a segment file.

    Parameters
    ----------
    store : Snapshot
    file : SegmentFile
        One of its files.
    start, stop : int
        Half-open range of its frames, from 0.

    Returns
    -------
    ndarray of float32, shape (stop - start, 24, 3)
        In metres; NaN where a joint is lacking.

    Raises
    ------
    StoreError
        If the store keeps no poses, or is damaged.
    """
    poses: NDArray[np.float32] = store.array(file, POSES.path, start, stop)
    # What no writer of ours wrote would overflow in squares.
    bounds = (
        (np.fmax.reduce(poses, axis=None), np.fmin.reduce(poses, axis=None)) if len(poses) else ()
    )
    if any(abs(bound) > FARTHEST for bound in bounds):
        raise DamagedError(store.path, file.names[0], "its poses are none")
    return poses


def stored_motion(store: Snapshot, placed: Placed) -> Motion:
    """Give a document of a store as a motion at the store's rate.

    Parameters
    ----------
    store : Snapshot
    placed : Placed
        One of its documents.

    Returns
    -------
    Motion
        As it was read from the source, but for the rounding of positions to single precision.

    Raises
    ------
    StoreError
        If the store keeps no poses, or is damaged.
    """
    made = placed.document.rig.get("made", ())
    return Motion(
        CANONICAL_JOINTS,
        stored_poses(store, placed),
        store.manifest.settings.rate,
        _rest(placed.document),
        tuple(joint for joint in made if joint in CANONICAL_JOINTS)
        if isinstance(made, list)
        else (),
    )


def _rest(document: Document) -> FloatArray | None:
    kept = document.rig.get(REST)
    if kept is None:
        return None
    try:
        rest = np.array([[np.nan] * 3 if row is None else row for row in kept], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        rest = np.empty(0)
    if rest.shape != (len(CANONICAL_JOINTS), 3) or (np.abs(rest) > FARTHEST).any():
        raise StoreError(f"{shown(document.name)}: its zero pose is none; index it again")
    return rest
