"""The paths of a grid as bytes, a little more than one a cell, and back.

Little endian. First 7 uint32: chains, their cells, bridges, their inner cells, wide steps, first
row, first column. Then, deflated, one array after another::

    chains        uint16 row, column and length, uint16 distance of the first cell
    bridge counts uint16, the bridges that leave each chain
    bridges       uint32 chain that it comes to, uint16 numbers of the cells that it leaves and
                  comes to in their chains, uint8 number of inner cells
    steps         2 bits each: 0 (1, 1), 1 (1, 0), 2 (0, 1); those of the chains, then those to
                  the inner cells
    differences   int8, from the distance of the cell before; -128: the next of the wide steps
    wide steps    int32

Rows and columns count from the first row and column; distances are in `METRES_A_UNIT`.
"""

import zlib
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError, StoreError
from mocapidx.graphs.paths import GridPaths
from mocapidx.model import IndexArray

__all__ = ["decode_paths", "encode_paths", "path_counts"]

HEAD: Final = np.dtype("<u4")
CHAIN: Final = np.dtype([("start", "<u2", 2), ("length", "<u2"), ("value", "<u2")])
LEAVING: Final = np.dtype("<u2")
BRIDGE: Final = np.dtype([("chain", "<u4"), ("places", "<u2", 2), ("inner", "u1")])
WIDE: Final = np.dtype("<i4")
ESCAPE: Final = -128
MOST_INNER: Final = 255
FIELDS: Final = 7
DEFLATES_TO: Final = 1040
"""No deflated byte becomes more than these."""


def encode_paths(paths: GridPaths, first_row: int, first_column: int) -> bytes:
    """Write the paths of a grid.

    Parameters
    ----------
    paths : GridPaths
        Rows and columns from 0 to 65,535.
    first_row, first_column : int
        What is to be added to them.

    Returns
    -------
    bytes

    Raises
    ------
    ParameterError
        If a row, a column, a chain or a bridge is too long for the format.
    """
    lengths, inner = np.diff(paths.starts), np.diff(paths.inner_starts)
    if max(lengths.max(initial=0), paths.cells.max(initial=0)) > 65535:
        raise ParameterError("a grid of more than 65,536 frames can't be kept")
    if inner.max(initial=0) > MOST_INNER:
        raise ParameterError(f"a bridge of more than {MOST_INNER} cells can't be kept")
    chains = np.empty(paths.chains, CHAIN)
    chains["start"], chains["length"] = paths.cells[paths.starts[:-1]], lengths
    chains["value"] = paths.values[paths.starts[:-1]]
    bridges = np.empty(paths.bridges, BRIDGE)
    bridges["chain"], bridges["places"] = paths.ends[:, 2], paths.ends[:, [1, 3]]
    bridges["inner"] = inner
    leaving = np.bincount(paths.ends[:, 0], minlength=paths.chains)
    if leaving.max(initial=0) > 65535:
        raise ParameterError("a chain with more than 65,535 bridges can't be kept")
    steps, rises = _all_steps(paths)
    small = np.abs(rises) < -ESCAPE
    narrow = np.where(small, rises, ESCAPE).astype(np.int8)
    wide = rises[~small].astype(WIDE)
    counts = (paths.chains, len(paths.cells), paths.bridges, len(paths.inner_cells), len(wide))
    head = np.array([*counts, first_row, first_column], HEAD)
    parts = (chains, leaving.astype(LEAVING), bridges, _packed(steps), narrow, wide)
    return head.tobytes() + zlib.compress(b"".join(part.tobytes() for part in parts))


def _all_steps(paths: GridPaths) -> tuple[IndexArray, IndexArray]:
    """Give steps and differences of distances, of all cells but the first ones of chains."""
    later = np.ones(len(paths.cells), np.bool_)
    later[paths.starts[:-1]] = False
    moves = np.diff(paths.cells, axis=0, prepend=0)[later]
    rises = np.diff(paths.values.astype(np.int64), prepend=0)[later]
    leaves = paths.starts[paths.ends[:, 0]] + paths.ends[:, 1]
    first = paths.inner_starts[:-1][np.diff(paths.inner_starts) > 0]
    from_cell = leaves[np.diff(paths.inner_starts) > 0]
    inner_moves = np.diff(paths.inner_cells, axis=0, prepend=0)
    inner_moves[first] = paths.inner_cells[first] - paths.cells[from_cell]
    inner_rises = np.diff(paths.inner_values.astype(np.int64), prepend=0)
    inner_rises[first] = paths.inner_values[first].astype(np.int64) - paths.values[from_cell]
    moves = np.concatenate((moves, inner_moves)).astype(np.int64)
    if len(moves) and not (((moves == 0) | (moves == 1)).all() and moves.any(axis=1).all()):
        raise ParameterError("a path must go in steps of at most one frame")
    steps = np.where(moves.all(axis=1), 0, np.where(moves[:, 0] > 0, 1, 2))
    return steps, np.concatenate((rises, inner_rises))


def _packed(steps: IndexArray) -> NDArray[np.uint8]:
    whole = np.zeros(-(-len(steps) // 4) * 4, np.uint8)
    whole[: len(steps)] = steps
    quads = whole.reshape(-1, 4) << np.array([0, 2, 4, 6], np.uint8)
    packed: NDArray[np.uint8] = np.bitwise_or.reduce(quads, axis=1).astype(np.uint8)
    return packed


def path_counts(data: bytes | memoryview) -> tuple[int, int, int, int]:
    """Count what `encode_paths` wrote.

    Parameters
    ----------
    data : bytes

    Returns
    -------
    tuple of int
        Chains, their cells, bridges, their inner cells.

    Raises
    ------
    StoreError
        If it is cut off; the message does not say in which file.
    """
    chains, cells, bridges, inner = _numbers(data)[:4]
    return chains, cells, bridges, inner


def decode_paths(data: bytes | memoryview) -> GridPaths:
    """Read what `encode_paths` wrote, and check that it makes sense.

    Parameters
    ----------
    data : bytes

    Returns
    -------
    GridPaths
        Rows and columns with what was to be added to them.

    Raises
    ------
    StoreError
        If it does not; the message does not say of which file.
    """
    numbers, reader = _opened(data)
    chains, cells, bridges, inner, wide = numbers[:5]
    count = cells - chains + inner
    chain, leaving = reader.take(CHAIN, chains), reader.take(LEAVING, chains)
    bridge, packed = reader.take(BRIDGE, bridges), reader.take(np.dtype("u1"), -(-count // 4))
    narrow = reader.take(np.dtype("i1"), count)
    rises = narrow.astype(np.int64)
    wide_rises = reader.take(WIDE, wide)
    if np.count_nonzero(narrow == ESCAPE) != wide or leaving.sum(dtype=np.int64) != bridges:
        raise StoreError("the paths of two documents don't fit their number")
    rises[narrow == ESCAPE] = wide_rises
    lengths = chain["length"].astype(np.int64)
    inner_lengths = bridge["inner"].astype(np.int64)
    if lengths.sum() != cells or (lengths < 1).any() or inner_lengths.sum() != inner:
        raise StoreError("the paths of two documents don't fit their number")
    moves = np.array([[1, 1], [1, 0], [0, 1], [0, 0]])[_unpacked(packed, count)]
    starts, inner_starts = _bounds(lengths), _bounds(inner_lengths)
    firsts = chain["start"].astype(np.int64) + numbers[5:7], chain["value"].astype(np.int64)
    later = np.ones(cells, np.bool_)
    later[starts[:-1]] = False
    places = _walked(firsts[0], moves[: cells - chains], starts, later)
    values = _walked(firsts[1], rises[: cells - chains], starts, later)
    places_on = bridge["places"].astype(np.int64)
    left = np.repeat(np.arange(chains), leaving)
    ends = np.column_stack((left, places_on[:, 0], bridge["chain"], places_on[:, 1]))
    _check_ends(ends, lengths, chains)
    leaves = starts[ends[:, 0]] + ends[:, 1]
    come = starts[ends[:, 2]] + ends[:, 3]
    inner_places = _crossed(places[leaves], moves[cells - chains :], inner_starts)
    inner_values = _crossed(values[leaves], rises[cells - chains :], inner_starts)
    far = places.sum(axis=1)
    lasts = far[leaves] + _totals(moves[cells - chains :].sum(axis=1), inner_starts)
    for known in (values, inner_values):
        if len(known) and not 0 <= known.min() <= known.max() <= 65535:
            raise StoreError("the paths of two documents have impossible distances")
    if (far[come] <= lasts).any():
        raise StoreError("the paths of two documents do not lead forward")
    return GridPaths(
        places.astype(np.int32),
        starts,
        values.astype(np.uint16),
        ends.astype(np.int32),
        inner_places.astype(np.int32),
        inner_starts,
        inner_values.astype(np.uint16),
    )


def _check_ends(ends: IndexArray, lengths: IndexArray, chains: int) -> None:
    if not len(ends):
        return
    if (ends[:, 2] >= chains).any() or (ends[:, 1] >= lengths[ends[:, 0]]).any():
        raise StoreError("the paths of two documents have bridges without ends")
    if (ends[:, 3] >= lengths[ends[:, 2]]).any():
        raise StoreError("the paths of two documents have bridges without ends")


def _walked(
    firsts: IndexArray, steps: IndexArray, starts: IndexArray, later: NDArray[np.bool_]
) -> IndexArray:
    """Sum up steps along each chain, from its first cell."""
    whole = np.zeros((len(later), *firsts.shape[1:]), np.int64)
    whole[later] = steps
    sums = np.cumsum(whole, axis=0)
    walked: IndexArray = sums + np.repeat(firsts - sums[starts[:-1]], np.diff(starts), axis=0)
    return walked


def _crossed(before: IndexArray, steps: IndexArray, starts: IndexArray) -> IndexArray:
    """Sum up steps along each bridge, from the cell that it leaves."""
    sums = np.cumsum(steps, axis=0, dtype=np.int64)
    zero = np.zeros((1, *steps.shape[1:]), np.int64)
    ahead = np.concatenate((zero, sums))[starts[:-1]]
    crossed: IndexArray = sums + np.repeat(before - ahead, np.diff(starts), axis=0)
    return crossed


def _totals(steps: IndexArray, starts: IndexArray) -> IndexArray:
    sums = np.concatenate(([0], np.cumsum(steps, dtype=np.int64)))
    totals: IndexArray = np.diff(sums[starts])
    return totals


def _bounds(lengths: IndexArray) -> IndexArray:
    bounds = np.zeros(len(lengths) + 1, np.int64)
    np.cumsum(lengths, out=bounds[1:])
    return bounds


def _unpacked(packed: NDArray[np.uint8], count: int) -> NDArray[np.uint8]:
    quads = (packed[:, None] >> np.array([0, 2, 4, 6], np.uint8)) & np.uint8(3)
    return quads.reshape(-1)[:count]


def _numbers(data: bytes | memoryview) -> list[int]:
    if len(data) < FIELDS * HEAD.itemsize:
        raise StoreError("the paths of two documents are cut off")
    numbers: list[int] = np.frombuffer(data, HEAD, FIELDS).tolist()
    return numbers


def _opened(data: bytes | memoryview) -> tuple[list[int], "_Reader"]:
    """Inflate what the head announces, and no more."""
    numbers = _numbers(data)
    chains, cells, bridges, inner, wide = numbers[:5]
    count = cells - chains + inner
    whole = chains * (CHAIN.itemsize + LEAVING.itemsize) + bridges * BRIDGE.itemsize
    whole += -(-count // 4) + count + wide * WIDE.itemsize
    if cells < chains or whole > DEFLATES_TO * len(data):
        raise StoreError("the paths of two documents don't fit their number")
    inflater = zlib.decompressobj()
    try:
        inflated = inflater.decompress(data[FIELDS * HEAD.itemsize :], whole + 1)
    except zlib.error as exc:
        raise StoreError("the paths of two documents can't be inflated") from exc
    if len(inflated) != whole or not inflater.eof or inflater.unused_data:
        raise StoreError("the paths of two documents don't fit their number")
    return numbers, _Reader(inflated)


class _Reader:
    """Takes one array after another from bytes that are known to suffice."""

    def __init__(self, data: bytes) -> None:
        self.data, self.place = data, 0

    def take(self, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
        found = np.frombuffer(self.data, dtype, count, self.place)
        self.place += count * dtype.itemsize
        return found
