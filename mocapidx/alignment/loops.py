"""The cheapest way through templates that loop, frame by frame, in bounded memory.

The columns of all templates stand end to end: column ``c`` of ``C``. A frame lies in a column for
the first or for the second time; from there the path stays (once), advances by one or two
columns around the loop, or jumps to any column for a price. Row ``t`` of the back-pointers says
how the states of frame ``t`` come from those of frame ``t - 1``. The compiled kernel ``path.c``
goes forward and traces back with the same bits.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.kernels.choice import compiled
from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray

__all__ = ["UNKNOWN", "Loops", "align_loops", "byte_tables", "cheapest_path", "join_loops"]

UNKNOWN = -1
"""The column of a frame that lies in no template."""

POINTER_BYTES = 32 << 20  # back-pointers held at a time, one a column and frame
LATE, SKIP, JUMP = 1, 2, 4  # their bits
LEVEL: str | None = None
"""The instructions that the kernel uses: by default the fastest that this processor has."""
SHIFT_FRAMES = 64  # sums are shifted so often: they stay small enough for float32


@dataclass(frozen=True, slots=True)
class Loops:
    """Looping templates laid end to end.

    Parameters
    ----------
    bounds : ndarray of int64, shape (M + 1,)
        Template ``m`` has the columns ``bounds[m]`` up to, not including, ``bounds[m + 1]``.
    before, two_before : ndarray of int64, shape (C,)
        The columns from which one or two steps around the loop lead to each column. In loops
        of three columns or fewer both are the same: no step skips a column.
    """

    bounds: IndexArray
    before: IndexArray
    two_before: IndexArray


def join_loops(lengths: Sequence[int]) -> Loops:
    """Lay templates of the given lengths end to end.

    Parameters
    ----------
    lengths : sequence of int
        Columns of each template, from 1; at least one template.

    Returns
    -------
    Loops

    Raises
    ------
    ParameterError
        If there is no template, or one without columns.
    """
    if not len(lengths) or min(lengths) < 1:
        raise ParameterError(f"templates need at least one column each, got {list(lengths)}")
    counts = np.asarray(lengths, dtype=np.int64)
    bounds = np.concatenate(([0], np.cumsum(counts)))
    first = np.repeat(bounds[:-1], counts)
    length = np.repeat(counts, counts)
    phase = np.arange(bounds[-1]) - first
    step = np.where(length > 3, 2, 1)
    return Loops(bounds, first + (phase - 1) % length, first + (phase - step) % length)


def byte_tables(when_zero: FloatArray, when_one: FloatArray) -> NDArray[np.float32]:
    """Tabulate the cost of every column for every value of each byte of a feature word.

    The cost of a word in all columns is the sum of one row of each table.

    Parameters
    ----------
    when_zero, when_one : ndarray of float, shape (C, F)
        What a feature costs in a column when it is 0 and when it is 1.

    Returns
    -------
    ndarray of float32, shape (B, 256, C)
        Table ``b`` is for features ``8 b`` to ``8 b + 7``; ``B = ceil(F / 8)``.
    """
    columns, features = when_zero.shape
    bits = (np.arange(256)[:, None] >> np.arange(8)) & 1
    tables = np.zeros((-(-features // 8), 256, columns), dtype=np.float32)
    for table, low in zip(tables, range(0, features, 8), strict=True):
        ones = bits[:, : min(8, features - low)].astype(np.float64)
        zero, one = when_zero[:, low : low + 8].T, when_one[:, low : low + 8].T
        table[:] = ones @ one + (1 - ones) @ zero
    return tables


def cheapest_path(
    words: WordArray,
    tables: NDArray[np.float32],
    loops: Loops,
    *,
    jump_price: float,
    unknown_price: float = np.inf,
    pointer_bytes: int = POINTER_BYTES,
) -> tuple[IndexArray, BoolArray]:
    """Find the cheapest path through all templates, with jumps.

    A first pass keeps the sums at the block borders only; the blocks are then gone through
    from the last to the first, so that the back-pointers of one block are held at a time.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        At least one frame.
    tables : ndarray of float32, shape (B, 256, C)
        Costs of a frame in the columns, from `byte_tables`.
    loops : Loops
        Of C columns.
    jump_price : float
        For each jump to any column, or into or out of no template.
    unknown_price : float
        Of each frame that lies in no template; infinite: all lie in one.
    pointer_bytes : int
        Memory for back-pointers; changes nothing in the result.

    Returns
    -------
    columns : ndarray of int64, shape (T,)
        The column of each frame, or `UNKNOWN`.
    jumps : ndarray of bool, shape (T,)
        Whether the path jumped to get to this frame; the first frame counts as a jump.
        Equal costs: a step of one, then of two, then a jump.

    Raises
    ------
    ParameterError
        If there is no frame.
    """
    walk = _Walk(tables, loops, jump_price, unknown_price)
    columns, jumps = _paths(words, walk, lambda ended: [ended.best()], pointer_bytes)
    return columns[0], jumps[0]


def align_loops(words: WordArray, tables: NDArray[np.float32], loops: Loops) -> IndexArray:
    """Align every template by itself with all frames: start and end anywhere, no jumps.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        At least one frame.
    tables : ndarray of float32, shape (B, 256, C)
    loops : Loops
        Of M templates and C columns.

    Returns
    -------
    ndarray of int64, shape (M, T)
        The column of each frame in each template's own cheapest path, counted over all.

    Raises
    ------
    ParameterError
        If there is no frame.
    """
    walk = _Walk(tables, loops, np.inf, np.inf)
    spans = list(itertools.pairwise(loops.bounds.tolist()))
    columns, _ = _paths(words, walk, lambda ended: [ended.best(*span) for span in spans])
    return columns


def _paths(
    words: WordArray,
    walk: "_Walk",
    ends: "Callable[[_State], list[tuple[int, bool]]]",
    pointer_bytes: int = POINTER_BYTES,
) -> tuple[IndexArray, BoolArray]:
    """Trace back from all the `ends` of the last sums: columns and jumps, one row a path."""
    if not len(words):
        raise ParameterError("a path needs at least one frame")
    words = np.ascontiguousarray(words, dtype=np.uint64)
    width = len(walk.loops.before)
    block = max(pointer_bytes // width // SHIFT_FRAMES, 1) * SHIFT_FRAMES
    starts = range(0, len(words), block)
    states = [walk.start()]
    for start in starts[:-1]:
        states.append(walk.forward(words[start : start + block], states[-1]))
    pointers = _Pointers.empty(min(block, len(words)), width)
    at: list[tuple[int, bool]] = []
    for start, state in zip(reversed(starts), reversed(states), strict=True):
        ended = walk.forward(words[start : start + block], state, pointers)
        if not at:
            at = ends(ended)
            columns = np.empty((len(at), len(words)), dtype=np.int64)
            jumps = np.empty(columns.shape, dtype=np.bool_)
        part = slice(start, min(start + block, len(words)))
        at = [
            _trace(pointers, walk.loops, last, column[part], jump[part])
            for last, column, jump in zip(at, columns, jumps, strict=True)
        ]
    return columns, jumps


@dataclass(frozen=True, slots=True)
class _State:
    """Sums after a frame: of each column held for the first or second time, and of no column."""

    first: NDArray[np.float32]
    second: NDArray[np.float32]
    unknown: float
    fresh: bool  # no frame yet: any column may be entered for nothing

    def best(self, low: int = 0, high: int | None = None) -> tuple[int, bool]:
        """Return the cheapest column between `low` and `high`, and whether held a second time."""
        sums = np.minimum(self.first, self.second)[low:high]
        column = low + int(sums.argmin())
        if self.unknown < sums.min():
            return UNKNOWN, False
        return column, bool(self.second[column] < self.first[column])


@dataclass(frozen=True, slots=True)
class _Pointers:
    """How the states of each frame come from those of the frame before."""

    steps: NDArray[np.uint8]
    """(T, C): `LATE`, the column before was better held for the second time; `SKIP`, two columns
    forward, not one; `JUMP`."""
    source: IndexArray  # (T,): the column that jumps come from
    unknown_jump: NDArray[np.uint8]  # (T,): no template was entered by a jump

    @classmethod
    def empty(cls, frames: int, columns: int) -> "_Pointers":
        steps = np.empty((frames, columns), np.uint8)
        return cls(steps, np.empty(frames, np.int64), np.empty(frames, np.uint8))

    def until(self, frames: int) -> "_Pointers":
        return _Pointers(self.steps[:frames], self.source[:frames], self.unknown_jump[:frames])


class _Walk:
    """The recursion over frames; holds tables and prices, no sums."""

    def __init__(
        self,
        tables: NDArray[np.float32],
        loops: Loops,
        jump_price: float,
        unknown_price: float,
    ) -> None:
        self.tables = np.ascontiguousarray(tables, dtype=np.float32)
        self.loops = loops
        self.jump_price = jump_price
        self.unknown_price = unknown_price

    def start(self) -> _State:
        nothing = np.full(len(self.loops.before), np.inf, dtype=np.float32)
        return _State(nothing, nothing, np.inf, fresh=True)

    def forward(self, words: WordArray, state: _State, pointers: _Pointers | None = None) -> _State:
        """Go over some frames, SHIFT_FRAMES or a multiple unless they are the last."""
        kernel = compiled("path")
        if kernel is None:
            return self._forward(words, state, pointers)
        first, second = state.first.copy(), state.second.copy()
        kept = NOT_KEPT if pointers is None else pointers.until(len(words))
        unknown = kernel.forward(
            words,
            self.tables,
            self.loops.before,
            self.loops.two_before,
            self.jump_price,
            self.unknown_price,
            state.fresh,
            first,
            second,
            state.unknown,
            kept.steps,
            kept.source,
            kept.unknown_jump,
            LEVEL,
        )
        return _State(first, second, unknown, fresh=False)

    def _forward(self, words: WordArray, state: _State, pointers: _Pointers | None) -> _State:
        first, second, unknown = state.first.copy(), state.second.copy(), state.unknown
        late, skip, jump = np.empty((3, len(first)), dtype=np.bool_)
        either, stepped, skipped, cost = np.empty((4, len(first)), dtype=np.float32)
        before, two_before = self.loops.before, self.loops.two_before
        octets = words.astype("<u8").view(np.uint8).reshape(-1, 8)[:, : len(self.tables)]
        rows = [list(table) for table in self.tables]
        last_octets: list[int] = []
        for t, frame_octets in enumerate(octets.tolist()):
            if frame_octets != last_octets:
                _add_up(rows, frame_octets, cost)
                last_octets = frame_octets
            np.less(second, first, out=late)
            np.minimum(first, second, out=either)
            source = int(either.argmin())
            best = float(either[source])
            if unknown < best:
                source, best = UNKNOWN, unknown
            enter = 0.0 if state.fresh and t == 0 else best + self.jump_price
            np.take(either, before, out=stepped, mode="clip")
            np.take(either, two_before, out=skipped, mode="clip")
            np.less(skipped, stepped, out=skip)
            np.minimum(stepped, skipped, out=stepped)
            price = np.float32(enter)
            np.less(price, stepped, out=jump)
            np.minimum(stepped, price, out=stepped)
            np.add(first, cost, out=second)
            np.add(stepped, cost, out=first)
            if pointers is not None:
                steps = pointers.steps[t]
                np.multiply(jump, np.uint8(JUMP), out=steps)
                steps += skip.view(np.uint8) * np.uint8(SKIP)
                steps += late.view(np.uint8)
                pointers.source[t] = source
                pointers.unknown_jump[t] = enter < unknown
            unknown = min(unknown, enter) + self.unknown_price
            if t % SHIFT_FRAMES == SHIFT_FRAMES - 1:
                least = np.float32(min(first.min(), second.min()))
                first -= least
                second -= least
                unknown -= float(least)
        return _State(first, second, unknown, fresh=False)


NOT_KEPT: Final = _Pointers.empty(0, 0)


def _add_up(
    rows: Sequence[Sequence[NDArray[np.float32]]],
    frame_octets: Sequence[int],
    cost: NDArray[np.float32],
) -> None:
    """Sum the costs of the bytes of a word in all columns."""
    cost[:] = rows[0][frame_octets[0]]
    for row, octet in zip(rows[1:], frame_octets[1:], strict=True):
        cost += row[octet]


def _trace(
    pointers: _Pointers,
    loops: Loops,
    at: tuple[int, bool],
    columns: IndexArray,
    jumps: BoolArray,
) -> tuple[int, bool]:
    """Follow the pointers back, fill in the path, and return the state before the first frame."""
    column, held = at
    kernel = compiled("path")
    if kernel is not None:
        there = (pointers.steps, pointers.source, pointers.unknown_jump)
        back = (loops.before, loops.two_before)
        column, held = kernel.trace(*there, *back, column, held, columns, jumps)
        return column, held
    for t in range(len(columns) - 1, -1, -1):
        columns[t], jumps[t] = column, False
        if held:
            held = False
            continue
        if column == UNKNOWN:
            jumps[t] = bool(pointers.unknown_jump[t])
            column = int(pointers.source[t]) if jumps[t] else UNKNOWN
        elif pointers.steps[t, column] & JUMP:
            jumps[t] = True
            column = int(pointers.source[t])
        else:
            skipped = pointers.steps[t, column] & SKIP
            column = int((loops.two_before if skipped else loops.before)[column])
        held = column != UNKNOWN and bool(pointers.steps[t, column] & LATE)
    return column, held
