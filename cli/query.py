"""The command `query`."""

from pathlib import Path
from typing import Any

import click

from .auto import print_auto
from .options import quiet_option, read_options, reading_options, store_argument
from .rows import note, print_rows, row_options

__all__ = ["query"]

MODES = ("exact", "fuzzy", "adaptive")
RANKINGS = ("length", "none")


@click.command()
@store_argument
@click.option(
    "--example",
    required=True,
    metavar="FILE[@START:END]",
    help="A motion file, or the part of it between two times in seconds.",
)
@click.option(
    "--select",
    default="all",
    show_default=True,
    metavar="FEATURES",
    help="Features that count: ids such as F17,F18 or the sets upper, lower, mix, all; or auto, "
    "which weighs all of them and ranks everything.",
)
@click.option(
    "--no-feedback",
    is_flag=True,
    help="With auto: don't sharpen the template with the surest hits.",
)
@click.option(
    "--learn",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="TEMPLATES",
    help="With auto: write a motion template of the example and the surest hits to this file.",
)
@click.option(
    "--mode",
    type=click.Choice(MODES),
    default="adaptive",
    show_default=True,
    help="How steps are matched: segmentation of the selection, of its sub-indexes, or adapted.",
)
@click.option(
    "--rank",
    type=click.Choice(RANKINGS),
    default="length",
    show_default=True,
    help="Order hits by how alike the lengths of their steps are, or by document.",
)
@click.option(
    "--top", type=click.IntRange(min=1), metavar="N", help="Only the best N.  [default: all]"
)
@reading_options
@row_options
@quiet_option
def query(
    store: Path,
    example: str,
    select: str,
    no_feedback: bool,
    learn: Path | None,
    mode: str,
    rank: str,
    top: int | None,
    row_format: str,
    output: Path,
    quiet: bool,
    **reading: Any,
) -> None:
    """Find every place in STORE that moves like an example.

    A hit goes through the same sequence of feature words as the example, whatever the speed.
    Times are in seconds of the document; source frames are those of the original file.

    \b
    Example:
      mocapidx query takes.store --example kick.amc@1.2:3.0 --select F17,F20
      mocapidx query takes.store --example kick.amc --select auto --top 20
    """
    if select == "auto":
        auto = {"feedback": not no_feedback, "learn": learn, "top": top}
        print_auto(store, example, auto, reading, row_format, output, quiet)
        return
    if learn is not None or no_feedback:
        raise click.UsageError("--learn and --no-feedback go with --select auto")
    from mocapidx.tasks.query import query_store
    from mocapidx.tasks.records import HIT_COLUMNS, hit_record

    found = query_store(
        store,
        example,
        select=select,
        mode=mode,
        rank=rank,
        top=top,
        read=read_options(reading),
    )
    for remark in found.remarks:
        note(f"Note: {remark}", quiet)
    records = [hit_record(hit, rank) for rank, hit in enumerate(found.hits, start=1)]
    print_rows(records, row_format, output, HIT_COLUMNS)
