"""Tables of numbers in text, where a cell may be empty: rows as columns have them."""

from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.numbers import find_tokens, parse_numbers
from mocapidx.formats.text import decoded
from mocapidx.model import FloatArray, IndexArray
from mocapidx.printable import shown

__all__ = ["cells_of", "number_table"]

NOT_SEEN: Final = frozenset({b"nan", b"-nan", b"+nan", b"na", b"n/a", b"null", b"none"})
BLOCK: Final = 1 << 22  # bytes converted at a time
TABS: Final = bytes.maketrans(b",;", b"\t\t")


def cells_of(line: bytes) -> list[bytes]:
    """Split one line at tabs, or else commas or semicolons.

    Parameters
    ----------
    line : bytes

    Returns
    -------
    list of bytes
        Without outer blanks and quotes.
    """
    return [cell.strip(b' \r\n"') for cell in line.translate(TABS).split(b"\t")]


def number_table(text: bytes, width: int, where: str, line: int) -> tuple[FloatArray, IndexArray]:
    """Read lines of numbers between tabs, commas or semicolons.

    Parameters
    ----------
    text : bytes
        Whole lines; those that are blank are no rows.
    width : int
        Columns. Cells that a line lacks at its end count as empty.
    where : str
        The file, for messages.
    line : int
        The number of the first line, from 1.

    Returns
    -------
    values : ndarray of float64, shape (R, width)
        NaN where a cell is empty or says so (``NaN``, in any case).
    lines : ndarray of int64, shape (R,)
        The number of the line of each row.

    Raises
    ------
    FormatError
        If a cell holds something else than a number, or a line has more than `width`.
    """
    parts: list[tuple[FloatArray, IndexArray]] = []
    at = 0
    while at < len(text):
        end = text.rfind(b"\n", at, at + BLOCK) + 1 or text.find(b"\n", at) + 1 or len(text)
        block = text[at:end]
        parts.append(_block(block.translate(TABS), width, where, line))
        line += block.count(b"\n")
        at = end
    if not parts:
        return np.empty((0, width)), np.empty(0, dtype=np.int64)
    values, lines = zip(*parts, strict=True)
    return np.concatenate(values), np.concatenate(lines)


def _block(text: bytes, width: int, where: str, line: int) -> tuple[FloatArray, IndexArray]:
    tokens = find_tokens(text)
    starts, ends = tokens.starts, tokens.ends
    breaks = np.flatnonzero(tokens.text == ord("\n"))
    cells = np.flatnonzero((tokens.text == ord("\t")) | (tokens.text == ord("\n")))
    rows = np.searchsorted(breaks, starts)
    # the cells before a row: all up to the break that ends the row before
    before = np.append(0, np.searchsorted(cells, breaks, side="right"))
    columns = np.searchsorted(cells, starts) - before[rows]
    values, bad = parse_numbers(tokens.text, starts, ends)
    for i in bad.tolist():
        word = tokens.word(i)
        if word.lower() not in NOT_SEEN:
            raise FormatError(
                f"{where}:{line + rows[i]}: column {columns[i] + 1} is "
                f"'{shown(decoded(word), 40)}', expected a number"
            )
    repeated = np.flatnonzero((np.diff(rows) == 0) & (np.diff(columns) == 0))
    if len(repeated):
        i = int(repeated[0])
        raise FormatError(
            f"{where}:{line + rows[i]}: column {columns[i] + 1} holds two numbers, "
            "expected a tab or comma between them"
        )
    beyond = np.flatnonzero(columns >= width)
    if len(beyond):
        raise FormatError(
            f"{where}:{line + rows[beyond[0]]}: has {columns[beyond].max() + 1} values, "
            f"expected {width}"
        )
    used, places = np.unique(rows, return_inverse=True)
    table = np.full((len(used), width), np.nan)
    table[places, columns] = values
    return table, used + line
