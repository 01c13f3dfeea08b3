"""What flows between the parts: plain frozen records, no behaviour beyond checks."""

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.markup import facts_html, point_figures_html, table_html

__all__ = [
    "BoolArray",
    "FloatArray",
    "Hit",
    "HitList",
    "IndexArray",
    "Motion",
    "PointRecording",
    "Recording",
    "Skeleton",
    "Up",
    "WordArray",
]

BoolArray: TypeAlias = NDArray[np.bool_]
FloatArray: TypeAlias = NDArray[np.floating]
IndexArray: TypeAlias = NDArray[np.int64]
WordArray: TypeAlias = NDArray[np.uint64]
FIGURES: Final = 6
"""Poses of a motion that a notebook shows."""
MOST_ROWS: Final = 20
"""Hits that a notebook shows."""

Up: TypeAlias = Literal["x", "y", "z", "-x", "-y", "-z"]


@dataclass(frozen=True, slots=True)
class Skeleton:
    """A skeleton as its file has it: a tree of nodes, in the units of the file.

    Parameters
    ----------
    names : tuple of str
        One name a node, all different; a parent stands before its children. The End Site
        of a BVH node ``X`` is the node ``X/End``.
    parents : ndarray of int64, shape (N,)
        Index of each node's parent, -1 for the root, which is node 0.
    offsets : ndarray of float64, shape (N, 3)
        From the parent's point to the node's own, in file units.
    turned_by : {"parent", "own"}
        Whose rotation turns a node's offset: the parent's (BVH: the node is a joint) or its
        own (Acclaim: the node is the far end of a bone).
    axes : ndarray of float64, shape (N, 3, 3), optional
        The frame in which each node's rotation is given (Acclaim's ``axis``); None: identity.
    """

    names: tuple[str, ...]
    parents: IndexArray
    offsets: FloatArray
    turned_by: Literal["parent", "own"]
    axes: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class Recording:
    """A motion file as it stands: a skeleton and its channels over time.

    Parameters
    ----------
    skeleton : Skeleton
        The tree that the channels move.
    channel_nodes : ndarray of int64, shape (C,)
        The node of each channel.
    channel_kinds : ndarray of int64, shape (C,)
        0, 1, 2: translation along x, y, z; 3, 4, 5: rotation about x, y, z. The rotation
        matrices of one node are multiplied from left to right in the order of the channels.
    values : ndarray of float64, shape (T, C)
        Translations in file units, rotations in radians.
    rate : float or None
        Frames a second as far as the file itself says, else None.
    unit : float or None
        Metres in one file unit as far as the file itself says, else None.
    up : {"x", "y", "z", "-x", "-y", "-z"} or None
        The axis that points up as far as the format itself says, else None.
    notes : tuple of str
        For people: what was assumed to read it.
    """

    skeleton: Skeleton
    channel_nodes: IndexArray
    channel_kinds: IndexArray
    values: FloatArray
    rate: float | None
    unit: float | None
    up: Up | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PointRecording:
    """Points over time as their file has them: markers on a body, or its joints.

    Parameters
    ----------
    names : tuple of str
        One a point, all different; a subject's name may stand before, with a colon.
    positions : ndarray of float64, shape (T, P, 3)
        In file units and axes; NaN where a point was not seen.
    rate : float or None
        Frames a second as far as the file itself says, else None.
    unit : float or None
        Metres in one file unit as far as the file itself says, else None.
    up : {"x", "y", "z", "-x", "-y", "-z"} or None
        The axis that points up as far as the file itself says, else None.
    remarks : tuple of str
        For people: what looks wrong about the file.
    """

    names: tuple[str, ...]
    positions: FloatArray
    rate: float | None
    unit: float | None
    up: Up | None = None
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Motion:
    """Joint positions over time: metres, Y up, right-handed.

    Parameters
    ----------
    joints : tuple of str
        Canonical joint names, all different.
    positions : ndarray of float, shape (T, J, 3)
        In metres; a joint that the rig lacks is NaN throughout.
    rate : float
        Frames a second, in Hz.
    rest : ndarray of float, shape (J, 3), optional
        The zero pose in metres, where the format has one (Acclaim).
    made : tuple of str
        Joints that the file lacks and that a joint map made up from others; features over
        them are not trusted.

    Raises
    ------
    ParameterError
        If the shapes do not agree, a name stands twice or the rate is not a positive number.
    """

    joints: tuple[str, ...]
    positions: FloatArray
    rate: float
    rest: FloatArray | None = None
    made: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        joints = len(self.joints)
        if self.positions.ndim != 3 or self.positions.shape[1:] != (joints, 3):
            raise ParameterError(
                f"positions must have the shape (T, {joints}, 3), got {self.positions.shape}"
            )
        if len(set(self.joints)) != joints:
            raise ParameterError("a joint name stands twice")
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise ParameterError(f"rate must be a positive number of Hz, got {self.rate}")
        if self.rest is not None and self.rest.shape != (joints, 3):
            raise ParameterError(f"rest must have the shape ({joints}, 3), got {self.rest.shape}")

    def _repr_html_(self) -> str:
        """Show the motion in a notebook: what is known of it, and a few of its poses."""
        frames = len(self.positions)
        lacking = [
            name
            for name, whole in zip(self.joints, self.positions.swapaxes(0, 1), strict=True)
            if not np.isfinite(whole).any()
        ]
        facts = {
            "length": f"{frames} frames at {self.rate:g} Hz, {frames / self.rate:.2f} s",
            "joints": len(self.joints) - len(lacking),
            "lacking": ", ".join(lacking) or "none",
            "made": ", ".join(self.made) or "none",
        }
        html = facts_html("Motion", facts)
        if not frames or len(lacking) == len(self.joints):
            return html
        chosen = np.unique(np.linspace(0, frames - 1, FIGURES).astype(np.int64))
        times = ", ".join(f"{frame / self.rate:.2f} s" for frame in chosen)
        return html + point_figures_html(self.positions[chosen], self.joints, f"poses at {times}")


@dataclass(frozen=True, slots=True)
class Hit:
    """A stretch of a document that answers a query.

    Parameters
    ----------
    document : str
        Name of the document in its store.
    start_frame, end_frame : int
        At the store's rate, from 0, end exclusive.
    start_time, end_time : float
        The same in seconds.
    source_start_frame, source_end_frame : int
        The same in frames of the original file, end exclusive.
    cost : float
        Smaller is better; 0 where the query has no ranking.
    label : str
        Class or query name.
    """

    document: str
    start_frame: int
    end_frame: int
    start_time: float
    end_time: float
    source_start_frame: int
    source_end_frame: int
    cost: float
    label: str


class HitList(tuple[Hit, ...]):
    """Hits, best first; a tuple that shows itself as a table in a notebook."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        rows = [
            (rank, hit.document, hit.start_time, hit.end_time, hit.cost, hit.label)
            for rank, hit in enumerate(self[:MOST_ROWS], start=1)
        ]
        more = len(self) - len(rows)
        below = f"and {more} more" if more else "" if rows else "no hits"
        return table_html(("", "document", "start s", "end s", "cost", "label"), rows, below)
