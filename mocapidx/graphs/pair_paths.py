"""The paths between two documents, grid by grid: long documents are cut into sections.

So the memory is bounded, and one long take can keep several processes busy. Sections overlap,
so that alignments up to the overlap are whole in at least one grid; the search drops doubles.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.graphs.frame_distance import METRES_A_STEP, Clouds, distance_grid, frame_clouds
from mocapidx.graphs.paths import GridPaths, PathRules, find_paths
from mocapidx.graphs.search_paths import METRES_A_UNIT
from mocapidx.graphs.web_bytes import encode_paths
from mocapidx.model import BoolArray, FloatArray

__all__ = [
    "GRID_RATE",
    "Section",
    "Unit",
    "grid_stride",
    "in_units",
    "pair_paths",
    "section_margin",
    "sections",
]

GRID_RATE: Final = 30.0
"""Frames a second of grids, in Hz, as near as the rate of the store allows. Minima jitter by a
cell at any rate, so that the rate changes which chains are long enough."""

SECTION: Final = 4096
"""Frames of a grid's side."""

OVERLAP: Final = 600
"""Frames that two sections of a document share: 20 s."""


@dataclass(frozen=True, slots=True)
class Section:
    """Frames of a document, at the rate of grids, end exclusive."""

    document: int
    start: int
    end: int

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.end - self.start


@dataclass(frozen=True, slots=True, eq=False)
class Unit:
    """A section with the poses that are needed to compare it.

    Parameters
    ----------
    section : Section
    poses : ndarray of float32, shape (T, 24, 3)
        At the store's rate: of the section, and as much more as clouds at its borders take.
    first : int
        The frame of `poses` that is the section's first.
    """

    section: Section
    poses: NDArray[np.float32]
    first: int


def grid_stride(rate: float) -> int:
    """Say how many frames of a store go to one frame of a grid.

    Parameters
    ----------
    rate : float
        Of the store, in Hz.

    Returns
    -------
    int
        From 1.
    """
    return max(1, round(rate / GRID_RATE))


def sections(document: int, frames: int) -> list[Section]:
    """Cut a document into sections.

    Parameters
    ----------
    document : int
        Its number.
    frames : int
        At the rate of grids.

    Returns
    -------
    list of Section
        They overlap by `OVERLAP` frames.
    """
    starts = range(0, max(frames - OVERLAP, 1), SECTION - OVERLAP)
    return [Section(document, start, min(start + SECTION, frames)) for start in starts]


def section_margin(rate: float, rules: PathRules) -> int:
    """Say how many frames of a store around a section are needed to compare it.

    Parameters
    ----------
    rate : float
        Of the store, in Hz.
    rules : PathRules

    Returns
    -------
    int
        Before it and after it.
    """
    return _reach(rate, rules) * grid_stride(rate)


def _reach(rate: float, rules: PathRules) -> int:
    return round(rules.window * rate / grid_stride(rate))


def pair_paths(
    rows: Sequence[Unit],
    columns: Sequence[Unit],
    pairs: Sequence[tuple[int, int]],
    rate: float,
    rules: PathRules,
) -> list[bytes]:
    """Find the paths between sections.

    Parameters
    ----------
    rows, columns : sequence of Unit
    pairs : sequence of tuple of int
        Which of the rows to compare with which of the columns.
    rate : float
        Of the store, in Hz.
    rules : PathRules

    Returns
    -------
    list of bytes
        For each pair, as `encode_paths` writes it; empty where there is no path. Rows and
        columns are frames of the documents, at the store's rate.
    """
    known = _KnownClouds(rate, rules)
    found = []
    for row, column in pairs:
        one, other = rows[row], columns[column]
        joints = _whole_joints(one.poses) & _whole_joints(other.poses)
        if not joints.any():
            found.append(b"")
            continue
        clouds = known.of(one, joints), known.of(other, joints)
        diagonal = None
        if one.section.document == other.section.document:
            diagonal = other.section.start - one.section.start
        grid = distance_grid(*clouds, diagonal=diagonal)
        grid_rate = rate / grid_stride(rate)
        paths = in_units(find_paths(grid, grid_rate, rules, diagonal=diagonal))
        origin = one.section.start, other.section.start
        found.append(encode_paths(paths, *origin) if paths.chains else b"")
    return found


class _KnownClouds:
    """The clouds of units, made once for each choice of joints."""

    def __init__(self, rate: float, rules: PathRules) -> None:
        self.stride, self.reach = grid_stride(rate), _reach(rate, rules)
        self.known: dict[tuple[Section, bytes], Clouds] = {}

    def of(self, unit: Unit, joints: BoolArray) -> Clouds:
        key = unit.section, joints.tobytes()
        if key not in self.known:
            frames = unit.first + self.stride * np.arange(unit.section.frames)
            self.known[key] = frame_clouds(
                unit.poses, joints, self.reach, frames, stride=self.stride
            )
        return self.known[key]


def _whole_joints(poses: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(poses).all(axis=(0, 2)))


def in_units(paths: GridPaths) -> GridPaths:
    """Round the distances of paths to what is kept of them.

    Parameters
    ----------
    paths : GridPaths
        In steps of grids.

    Returns
    -------
    GridPaths
        In `METRES_A_UNIT`.
    """
    ratio = round(METRES_A_UNIT / METRES_A_STEP)
    values, inner_values = (
        ((values.astype(np.uint32) + ratio // 2) // ratio).astype(np.uint16)
        for values in (paths.values, paths.inner_values)
    )
    return replace(paths, values=values, inner_values=inner_values)
