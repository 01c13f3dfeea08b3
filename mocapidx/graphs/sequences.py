"""Match sequences: ways through the paths of a web that lead from one row to another.

The rows are the frames of a query. Each sequence is a time alignment of the query with a
stretch of another motion. The work is done in C where it was built, else by
`mocapidx.graphs.sequences_python`, with the same outcome.
"""

from dataclasses import dataclass

import numpy as np

from mocapidx.errors import StoreError
from mocapidx.graphs.search_paths import METRES_A_UNIT, SearchPaths
from mocapidx.graphs.sequences_python import find_sequences_python
from mocapidx.kernels.choice import compiled
from mocapidx.model import FloatArray, IndexArray

__all__ = ["Sequences", "find_sequences"]

TOTAL, COUNT, FIRST, LAST, STATE, BRIDGE, FROM, TO = range(8)
CELL, PARENT, BY_BRIDGE, BRIDGE_FROM = range(4)


@dataclass(frozen=True, slots=True, eq=False)
class Sequences:
    """Ways from one row to another.

    Parameters
    ----------
    found : SearchPaths
        Where they were found.
    role : {0, 1}
        Which of a cell's two numbers is the row.
    table : ndarray of int64, shape (S, 8)
        Of each: total, cells, first column, last column, and where it ends. Where a path does
        not reach the first or last row, its columns are continued at slope 1.
    states : ndarray of int64, shape (N, 6)
        How they came there.
    """

    found: SearchPaths
    role: int
    table: IndexArray
    states: IndexArray

    def __len__(self) -> int:
        return len(self.table)

    @property
    def costs(self) -> FloatArray:
        """Average frame distance of each, in metres."""
        averages: FloatArray = self.table[:, TOTAL] / self.table[:, COUNT] * METRES_A_UNIT
        return averages

    @property
    def columns(self) -> IndexArray:
        """First and last column of each, both included, shape (S, 2)."""
        return self.table[:, FIRST : LAST + 1]

    def cells(self, number: int) -> IndexArray:
        """List the cells of a sequence.

        Parameters
        ----------
        number : int
            From 0.

        Returns
        -------
        ndarray of int64, shape (N, 2)
            Row and column, in the order of time.
        """
        paths = self.found.paths
        end = self.table[number]
        state, pieces = end[STATE], []
        if end[BRIDGE] < 0:
            to = end[TO]
        else:
            pieces.append(paths.inner_cells[end[FROM] : end[TO] + 1])
            to = self._leaves(end[BRIDGE]) if state >= 0 else -1
        while state >= 0:
            cell, parent, bridge, start = self.states[state, : BRIDGE_FROM + 1]
            pieces.append(paths.cells[cell : to + 1])
            if bridge >= 0:
                pieces.append(paths.inner_cells[start : paths.inner_starts[bridge + 1]])
                to = self._leaves(bridge)
            state = parent
        cells = np.concatenate(pieces[::-1]).astype(np.int64)
        return cells[:, ::-1] if self.role else cells

    def _leaves(self, bridge: int) -> int:
        chain, cell = self.found.paths.ends[bridge, :2]
        return int(self.found.paths.starts[chain]) + int(cell)


def find_sequences(
    found: SearchPaths, role: int, first_row: int, last_row: int, slack: int, epsilon: float
) -> Sequences:
    """Find the match sequences from one row to another.

    A sequence begins at the first cell of a path in the first row, or where a chain begins at
    most `slack` rows later; it goes along chains and over bridges, and ends at the last cell of
    a path in the last row, or where a chain ends at most `slack` rows earlier. Of all ways from
    one beginning into one cell the one with the least average goes on.

    Parameters
    ----------
    found : SearchPaths
    role : {0, 1}
        Which of a cell's two numbers is the row, the other is the column.
    first_row, last_row : int
        Both included.
    slack : int
        In rows; 0: as printed.
    epsilon : float
        Most that a sequence may cost, its average distance in metres.

    Returns
    -------
    Sequences
        Starts in the order of their paths, chains first; ends in the order of time.

    Raises
    ------
    StoreError
        If the web contradicts itself.

    References
    ----------
    .. [1] Kovar, Gleicher, SIGGRAPH 2004, section 3.3.
    """
    # Floats such as .18 lie a little below or above what they mean; sums are whole.
    most = int(np.floor(epsilon / METRES_A_UNIT + 1e-6))
    limits = role, first_row, last_row, slack, most
    kernel = compiled("sequences")
    try:
        if kernel is None:
            table, states = find_sequences_python(found, *limits)
        else:
            parts = kernel.find_sequences(*found.arrays, *limits)
            table, states = (np.frombuffer(part, np.int64) for part in parts)
    except ValueError as exc:
        raise StoreError(f"the web contradicts itself ({exc}); build it again") from exc
    return Sequences(found, role, table.reshape(-1, 8), states.reshape(-1, 6))
