"""Texts in the cells of CSV files, which spreadsheets must not run as formulas."""

from typing import Final

__all__ = ["quoted", "unquoted"]

FORMULAS: Final = ("=", "+", "-", "@")


def quoted(text: str) -> str:
    """Put an apostrophe before a text that a spreadsheet would run.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
        A text that looks as if it had been given one gets another.
    """
    return f"'{text}" if _is_formula(text) else text


def unquoted(cell: str) -> str:
    """Take away what `quoted` has put before a text.

    Parameters
    ----------
    cell : str
        Of a CSV file.

    Returns
    -------
    str
    """
    return cell[1:] if cell.startswith("'") and _is_formula(cell) else cell


def _is_formula(text: str) -> bool:
    return text.lstrip("'").startswith(FORMULAS)
