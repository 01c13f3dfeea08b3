"""One column of numbers of a segment file, of which only what is looked at gets read.

A store checks its bytes a MiB at a time, so that much is read together. A query that goes by
rare words looks at few rows of an archive of any size.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.model import IndexArray

__all__ = ["Column", "column_of"]

BLOCK: Final = 1 << 18
"""Rows that are read together: a MiB."""


class Column:
    """Rows of unsigned numbers, read a block at a time when first looked at.

    Parameters
    ----------
    rows : int
        How many there are.
    read : callable
        ``read(start, stop)`` gives the rows from `start` up to, not including, `stop`, as uint32.
    """

    def __init__(self, rows: int, read: Callable[[int, int], NDArray[np.uint32]]) -> None:
        self._rows = rows
        self._read = read
        self._missing = np.ones(-(-rows // BLOCK), np.bool_)
        self._values: NDArray[np.uint32] | None = None

    def __len__(self) -> int:
        return self._rows

    def unread(self, places: int) -> int:
        """Estimate the rows that looking at so many places, anywhere, would still read."""
        return min(places, int(np.count_nonzero(self._missing))) * BLOCK

    def whole(self) -> NDArray[np.uint32]:
        """Give all rows, shape (R,)."""
        return self._load(self._missing)

    def take(self, places: IndexArray) -> NDArray[np.uint32]:
        """Give the rows at some places.

        Parameters
        ----------
        places : ndarray of int64, of any shape
            From 0; negative ones count from the end.

        Returns
        -------
        ndarray of uint32, of the same shape
        """
        wanted = np.zeros(len(self._missing), np.bool_)
        if self._missing.any() and places.size:
            wanted[np.where(places < 0, places + self._rows, places) // BLOCK] = True
        return self._load(wanted & self._missing).take(places)

    def search(self, values: IndexArray | NDArray[np.uint32], before: bool = True) -> IndexArray:
        """Find where numbers belong in a column that ascends.

        Parameters
        ----------
        values : ndarray of int64 or uint32, shape (N,)
            None of them negative.
        before : bool
            Before rows that equal them, else after.

        Returns
        -------
        ndarray of int64, shape (N,)
            How many rows are less, or not greater.
        """
        side, wanted = "left" if before else "right", values.astype(np.uint32)
        halvings = len(self._missing).bit_length()
        if len(wanted) * halvings < np.count_nonzero(self._missing):
            found = [self._find(value, before) for value in wanted]
            return np.array(found, dtype=np.int64)
        return np.searchsorted(self.whole(), wanted, side)  # type: ignore[call-overload,no-any-return]

    def _find(self, value: np.uint32, before: bool) -> int:
        """Find one number by halving the blocks that it may be in."""
        low, high = 0, len(self._missing)
        while high - low > 1:
            middle = (low + high) // 2
            first = self._block(middle)[0]
            if first < value or (first == value and not before):
                low = middle
            else:
                high = middle
        side = "left" if before else "right"
        found: np.intp = np.searchsorted(self._block(low), value, side)  # type: ignore[call-overload]
        return low * BLOCK + int(found)

    def _block(self, number: int) -> NDArray[np.uint32]:
        wanted = np.zeros(len(self._missing), np.bool_)
        wanted[number] = self._missing[number]
        return self._load(wanted)[number * BLOCK : (number + 1) * BLOCK]

    def _load(self, wanted: NDArray[np.bool_]) -> NDArray[np.uint32]:
        """Read blocks, neighbours at one go; rows that were never read hold anything."""
        if self._values is None:
            if wanted.all():
                self._values = self._read(0, self._rows)
                self._missing[:] = False
                return self._values
            self._values = np.empty(self._rows, np.uint32)
        if not wanted.any():
            return self._values
        borders = np.flatnonzero(np.diff(wanted, prepend=False, append=False))
        for first, last in borders.reshape(-1, 2).tolist():
            rows = slice(first * BLOCK, min(last * BLOCK, self._rows))
            self._values[rows] = self._read(rows.start, rows.stop)
            self._missing[first:last] = False
        return self._values


def column_of(values: NDArray[np.uint32]) -> Column:
    """Give an array that is in memory as a column."""
    column = Column(len(values), lambda start, stop: values[start:stop])
    column.whole()
    return column
