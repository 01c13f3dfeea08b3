"""The command `align`."""

from pathlib import Path
from typing import Any

import click

from .options import (
    NewFile,
    NumberRange,
    complete_file,
    quiet_option,
    read_options,
    reading_options,
)
from .rows import note, print_rows, row_options, warn

__all__ = ["align"]


@click.command()
@click.argument("a", metavar="A", shell_complete=complete_file)
@click.argument("b", metavar="B", shell_complete=complete_file)
@click.option(
    "--store",
    type=click.Path(path_type=Path),
    metavar="STORE",
    help="A and B may be documents of this store, too.",
)
@click.option(
    "--select",
    default="all",
    show_default=True,
    metavar="FEATURES",
    help="Features whose segments are matched, as many of them as agree.",
)
@click.option(
    "--margin",
    type=NumberRange(min=0),
    default=0.1,
    show_default=True,
    metavar="SECONDS",
    help="Widen the matched segments by this; more where the path needs it.",
)
@click.option(
    "--distance",
    type=click.Choice(["poses", "words"]),
    default="poses",
    show_default=True,
    help="What is compared frame by frame: joint positions or the selected features.",
)
@click.option("--coarse-only", is_flag=True, help="Print the matched segments and stop.")
@click.option(
    "--feature-set",
    default="f39",
    show_default=True,
    metavar="NAME|FILE",
    shell_complete=complete_file,
    help="Relational features of files; a store has its own.",
)
@click.option(
    "--rate",
    type=NumberRange(1, 1000),
    default=30.0,
    show_default=True,
    metavar="HZ",
    help="Frames a second at which files are aligned; a store has its own.",
)
@click.option(
    "--plot",
    type=NewFile(),
    metavar="FILE",
    help="Draw segments, region and path too: PNG or SVG by suffix.",
)
@reading_options
@row_options
@quiet_option
def align(
    a: str,
    b: str,
    store: Path | None,
    select: str,
    margin: float,
    distance: Any,
    coarse_only: bool,
    feature_set: str,
    rate: float,
    plot: Path | None,
    row_format: str,
    output: Path,
    quiet: bool,
    **reading: Any,
) -> None:
    """Print which frame of A goes with which frame of B.

    A and B are FILE or FILE@START:END, in seconds. Stretches in which both go through the same
    features are matched first; the warping path is then sought near them only. The last `total`
    is the cost of the alignment.

    \b
    Example:
      mocapidx align walk1.amc walk2.amc --plot walks.png --output path.csv --format csv
      mocapidx align walk1.amc walk2.amc --select F17,F18,F20,F21 --coarse-only
    """
    from mocapidx.tasks import align as task

    options = task.AlignOptions(
        select=select,
        margin=margin,
        distance=distance,
        coarse_only=coarse_only,
        feature_set=feature_set,
        rate=rate,
        read=read_options(reading),
    )
    aligned = task.align_motions(a, b, options, store=store, picture=plot)
    if coarse_only:
        print_rows(task.segment_records(aligned), row_format, output, task.SEGMENT_COLUMNS)
    else:
        print_rows(task.path_records(aligned), row_format, output, task.PATH_COLUMNS)
    for remark in aligned.remarks:
        warn(remark)
    note(task.alignment_summary(aligned), quiet)
