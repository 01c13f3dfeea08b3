"""How commands print: records to a stream or a file, notes and warnings to stderr.

Commands import the library when they run, so that their help needs no NumPy.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from .main import say
from .options import NewFile

if TYPE_CHECKING:
    from mocapidx.tasks.records import Record

__all__ = ["note", "print_lines", "print_rows", "row_options", "warn"]

Command = TypeVar("Command", bound=Callable[..., Any])


def row_options(command: Command) -> Command:
    """Give a command ``--format`` and ``--output``."""
    command = click.option(
        "--output",
        type=NewFile(allow_dash=True),
        default=Path("-"),
        metavar="FILE",
        help="Where the records go; no file is left half written.  [default: - (stdout)]",
    )(command)
    return click.option(
        "--format",
        "row_format",
        type=click.Choice(["table", "jsonl", "csv"]),
        default="table",
        show_default=True,
        help="How records are printed.",
    )(command)


def print_rows(
    records: "Iterable[Record]",
    row_format: str,
    output: Path,
    columns: Sequence[str],
    *,
    above: Iterable[str] = (),
) -> None:
    """Print records to stdout or to a file, below what lines there are to stand above them."""
    from mocapidx.tasks.records import render_records

    print_lines(chain(above, render_records(records, row_format, columns)), output)


def print_lines(lines: Iterable[str], output: Path) -> None:
    """Print lines to stdout or to a file."""
    from mocapidx.tasks.records import save_text

    if str(output) == "-":
        for line in lines:
            click.echo(line)
    else:
        save_text(lines, output)


def warn(message: str) -> None:
    """Print one line of warning on stderr."""
    say(f"Warning: {message}")


def note(message: str, quiet: bool) -> None:
    """Print one line about what was done on stderr, unless asked for silence."""
    if not quiet:
        say(message)
