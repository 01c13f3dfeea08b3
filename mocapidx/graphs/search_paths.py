"""The paths of a grid laid out for searching: sums along them, and which bridge leaves where."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.graphs.paths import GridPaths
from mocapidx.model import IndexArray

__all__ = ["METRES_A_UNIT", "SearchPaths", "search_paths"]

METRES_A_UNIT: Final = 5e-4
"""Distances of stored paths are whole numbers of these, so that sums of them are exact."""


@dataclass(frozen=True, slots=True, eq=False)
class SearchPaths:
    """The paths of a grid, laid out for searching.

    Parameters
    ----------
    paths : GridPaths
        Rows and columns are frames of two documents.
    sums : ndarray of int64, shape (cells + 1,)
        Distances of the chains' cells, summed up from the first.
    chain_of : ndarray of int64, shape (cells,)
        The chain of each cell.
    bridge_starts : ndarray of int64, shape (chains + 1,)
        Where the bridges begin that leave each chain.
    inner_sums : ndarray of int64, shape (inner cells + 1,)
        Distances of the bridges' inner cells, summed up from the first.
    """

    paths: GridPaths
    sums: IndexArray
    chain_of: IndexArray
    bridge_starts: IndexArray
    inner_sums: IndexArray

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """All arrays, in the order in which the compiled search takes them."""
        paths = self.paths
        return (
            *(paths.cells, paths.starts, self.sums, self.chain_of, paths.ends),
            *(self.bridge_starts, paths.inner_cells, paths.inner_starts, self.inner_sums),
        )


def search_paths(paths: GridPaths) -> SearchPaths:
    """Lay out the paths of a grid for searching.

    Parameters
    ----------
    paths : GridPaths
        Distances in `METRES_A_UNIT`.

    Returns
    -------
    SearchPaths
    """
    numbers = np.arange(paths.chains + 1)
    return SearchPaths(
        paths,
        _summed(paths.values),
        np.repeat(numbers[:-1], np.diff(paths.starts)),
        np.searchsorted(paths.ends[:, 0], numbers).astype(np.int64),
        _summed(paths.inner_values),
    )


def _summed(values: NDArray[np.uint16]) -> IndexArray:
    sums = np.zeros(len(values) + 1, dtype=np.int64)
    np.cumsum(values, out=sums[1:])
    return sums
