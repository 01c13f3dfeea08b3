"""The command `doctor`."""

from pathlib import Path
from typing import Any

import click

from mocapidx.printable import count, shown

from .options import complete_file, quiet_option, read_options, reading_options
from .progress import Bar
from .rows import note, print_lines, print_rows, row_options, warn

__all__ = ["doctor"]

SKIPPED = 5  # exit code: done, but some inputs could not be used


@click.command()
@click.argument(
    "inputs", nargs=-1, required=True, metavar="INPUT...", type=click.Path(path_type=Path)
)
@click.option(
    "--feature-set",
    default="f39",
    show_default=True,
    metavar="NAME|FILE",
    shell_complete=complete_file,
    help="Whose features are told from those not to be trusted.",
)
@reading_options
@row_options
@quiet_option
def doctor(
    inputs: tuple[Path, ...],
    feature_set: str,
    row_format: str,
    output: Path,
    quiet: bool,
    **reading: Any,
) -> int:
    """Examine motion files: what is recognised in them, and what is not sound.

    INPUT are motion files and folders. One file is told in detail: what unit, axis and rate were
    understood, gaps, joints that jump, sides that change places, joints that are made up or one
    point, features not to be trusted. Several are a table, one row a file; those that can't be
    used have the reason in their row, and the exit code is then 5.

    \b
    Example:
      mocapidx doctor takes/walk.c3d
      mocapidx doctor takes/ --format csv --output takes.csv
    """
    from mocapidx.tasks.doctor import (
        COLUMNS,
        examination_lines,
        examination_record,
        examine,
        examine_file,
    )

    options = read_options(reading)
    if len(inputs) == 1 and not inputs[0].is_dir():
        found = examine_file(inputs[0], options, feature_set)
        if row_format == "table":
            print_lines(examination_lines(found), output)
        else:
            print_rows([examination_record(found)], row_format, output, COLUMNS)
        return 0
    with Bar("file", quiet) as bar:
        examinations = list(examine(inputs, options, feature_set, progress=bar.show))
    print_rows(map(examination_record, examinations), row_format, output, COLUMNS)
    if not examinations and not quiet:
        warn(f"no motion file below {', '.join(map(shown, inputs))}: is it the right folder?")
    bad = sum(found.report is None for found in examinations)
    note(f"{count(len(examinations), 'file')} examined, {bad} can't be used", quiet)
    return SKIPPED if bad else 0
