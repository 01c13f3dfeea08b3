"""Distance of frames: point clouds of the joints, laid over each other on the floor.

The cloud of a frame holds its joints and those of the frames around it. Two clouds are as far
apart as their points are, root mean square, after one of them was moved over the floor and
turned about the vertical to fit the other best. For that there is a closed form, which comes
down to three matrix products for all frames of two motions at once.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray

__all__ = [
    "METRES_A_STEP",
    "TILE",
    "WINDOW",
    "Clouds",
    "distance_grid",
    "distance_tiles",
    "frame_clouds",
]

WINDOW: Final = 1 / 3
"""Seconds before and after a frame that its cloud reaches."""

TILE: Final = 512
"""Side of a tile in frames. Products of other shapes differ in the last bits, so it is fixed."""

METRES_A_STEP: Final = 1e-4
"""Distances in grids are whole numbers of these, up to 6.5 m: sums of them are exact."""

HEIGHTS: Final = np.array([
    0.95, 0.9, 0.5, 0.1, 0.05, 0.9, 0.5, 0.1, 0.05, 1.05, 1.2, 1.4,
    1.45, 1.55, 1.65, 1.4, 1.4, 1.15, 0.95, 0.9, 1.4, 1.15, 0.95, 0.9,
])  # fmt: skip
"""What is taken off the joints' heights, in metres. Any would do; small rests round less."""


@dataclass(frozen=True, slots=True, eq=False)
class Clouds:
    """The point clouds of some frames, laid out for matrix products.

    Parameters
    ----------
    floor : ndarray of float32, shape (T, 2 P)
        East and then north coordinates of the P points about their mean, times the root of
        the points' weights.
    turned : ndarray of float32, shape (T, 2 P)
        The same, turned by a right angle.
    heights : ndarray of float32, shape (T, P)
        Heights above the joints' usual ones, times the same roots.
    energy : ndarray of float32, shape (T,)
        Sum of the squares of `floor` and `heights`, in square metres.
    """

    floor: NDArray[np.float32]
    turned: NDArray[np.float32]
    heights: NDArray[np.float32]
    energy: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.energy)


def frame_clouds(
    poses: FloatArray,
    joints: BoolArray,
    reach: int,
    frames: slice | NDArray[np.int64] = slice(None),
    *,
    stride: int = 1,
) -> Clouds:
    """Make the point clouds of a motion's frames.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        Positions in metres, Y up.
    joints : ndarray of bool, shape (24,)
        Which of them count: those that both of the motions to be compared have.
    reach : int
        Samples before and after a frame in its cloud. Weights fall evenly from the frame to
        zero just beyond them. At the ends of the motion its first or last frame is repeated.
    frames : slice or ndarray of int64
        Of which frames; default all.
    stride : int
        Frames between two samples of a cloud.

    Returns
    -------
    Clouds

    Raises
    ------
    ParameterError
        If no joint counts.

    References
    ----------
    .. [1] Kovar, Gleicher, Pighin, "Motion Graphs", SIGGRAPH 2002, section 3.1.
    """
    if not joints.any():
        raise ParameterError("the motions have no joint in common")
    centres = np.arange(len(poses))[frames]
    steps = stride * np.arange(-reach, reach + 1)
    weights = (reach + 1.0 - np.abs(steps) / stride) / (reach + 1.0) ** 2
    samples = np.clip(centres[:, None] + steps, 0, len(poses) - 1)
    kept = poses[:, joints]
    middles = kept[..., ::2].astype(np.float64).mean(axis=1)[samples]  # on the floor
    middle = np.einsum("tsa,s->ta", middles, weights).astype(np.float32)
    up = (kept[..., 1] - HEIGHTS[joints]).astype(np.float32)
    roots = np.sqrt(weights / joints.sum()).astype(np.float32)[:, None]
    # Centred before the products: afterwards, single precision loses millimetres.
    east, north = (
        (kept[..., axis].astype(np.float32)[samples] - middle[:, None, None, column]) * roots
        for column, axis in enumerate((0, 2))
    )
    shape = len(centres), -1
    east, north = east.reshape(shape), north.reshape(shape)
    heights = (up[samples] * roots).reshape(shape)
    energy = sum(np.einsum("tp,tp->t", part, part) for part in (east, north, heights))
    return Clouds(
        np.concatenate((east, north), axis=1),
        np.concatenate((-north, east), axis=1),
        heights,
        np.asarray(energy, dtype=np.float32),
    )


def distance_tiles(
    rows: Clouds, columns: Clouds
) -> Iterator[tuple[slice, slice, NDArray[np.float32]]]:
    """Compare all frames of two motions, a tile at a time.

    Parameters
    ----------
    rows, columns : Clouds
        Of the same joints and the same reach.

    Yields
    ------
    rows, columns : slice
        Where the tile lies.
    distances : ndarray of float32, shape (at most TILE, at most TILE)
        In metres, root mean square over the points. They are good to 5 um where they are far
        from zero, and to 1 mm near it.
    """
    for top in range(0, len(rows), TILE):
        tall = slice(top, top + TILE)
        for left in range(0, len(columns), TILE):
            wide = slice(left, left + TILE)
            yield tall, wide, _tile(rows, tall, columns, wide)


def _tile(rows: Clouds, tall: slice, columns: Clouds, wide: slice) -> NDArray[np.float32]:
    along: NDArray[np.float32] = rows.floor[tall] @ columns.floor[wide].T
    across = rows.floor[tall] @ columns.turned[wide].T
    np.multiply(along, along, out=along)
    np.multiply(across, across, out=across)
    np.add(along, across, out=along)
    np.sqrt(along, out=along)
    along += rows.heights[tall] @ columns.heights[wide].T
    along *= np.float32(-2)
    along += rows.energy[tall, None]
    along += columns.energy[wide]
    np.maximum(along, np.float32(0), out=along)
    np.sqrt(along, out=along)
    return along


def distance_grid(
    rows: Clouds, columns: Clouds, *, diagonal: int | None = None
) -> NDArray[np.uint16]:
    """Compare all frames of two motions.

    Parameters
    ----------
    rows, columns : Clouds
        Of the same joints and the same reach.
    diagonal : int, optional
        Where a motion is compared with itself: row ``i`` and column ``i - diagonal`` are the
        same frame, whose distance is exactly 0.

    Returns
    -------
    ndarray of uint16, shape (rows, columns)
        In `METRES_A_STEP`, rounded; 65,535 where it is more.
    """
    grid = np.empty((len(rows), len(columns)), dtype=np.uint16)
    for tall, wide, tile in distance_tiles(rows, columns):
        tile *= np.float32(1 / METRES_A_STEP)
        np.rint(tile, out=tile)
        np.minimum(tile, np.float32(65535), out=tile)
        grid[tall, wide] = tile
    if diagonal is not None:
        same = np.arange(max(diagonal, 0), min(len(rows), len(columns) + diagonal))
        grid[same, same - diagonal] = 0
    return grid
