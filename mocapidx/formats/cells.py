"""Tables of numbers in text, where a cell may be empty: rows as columns have them."""

from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.numbers import Tokens, find_tokens, parse_numbers
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
    _check_cells(tokens, rows, columns, bad, width, where, line)
    used, places = np.unique(rows, return_inverse=True)
    table = np.full((len(used), width), np.nan)
    table[places, columns] = values
    return table, used + line


def _check_cells(
    tokens: Tokens,
    rows: IndexArray,
    columns: IndexArray,
    bad: IndexArray,
    width: int,
    where: str,
    line: int,
) -> None:
    """Raise FormatError for the first cell that is wrong, if one is."""
    odd = [i for i in bad.tolist() if tokens.word(i).lower() not in NOT_SEEN]
    repeated = np.flatnonzero((np.diff(rows) == 0) & (np.diff(columns) == 0))
    beyond = np.flatnonzero(columns >= width)
    wrong = [int(found[0]) for found in (odd, repeated, beyond) if len(found)]
    if wrong:
        i = min(wrong)
        at, column = f"{where}:{line + rows[i]}", f"column {columns[i] + 1}"
        if i in odd[:1]:
            word = shown(decoded(tokens.word(i)), 40)
            raise FormatError(f"{at}: {column} is '{word}', expected a number")
        if i in repeated[:1]:
            raise FormatError(
                f"{at}: {column} holds two numbers, expected a tab or comma between them"
            )
        most = columns[rows == rows[i]].max() + 1
        raise FormatError(f"{at}: has {most} values, expected {width}")
