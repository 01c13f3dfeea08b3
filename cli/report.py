"""The command `report`."""

from pathlib import Path
from typing import Any

import click

from mocapidx.printable import count

from .options import (
    NewFile,
    NumberRange,
    complete_file,
    quiet_option,
    read_options,
    reading_options,
    store_argument,
)
from .progress import Bar
from .rows import note

__all__ = ["report"]


@click.command()
@store_argument
@click.argument("records", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "--output",
    type=NewFile(allow_dash=True),
    required=True,
    metavar="REPORT.html",
    help="The page; it is written whole or not at all.",
)
@click.option(
    "--example",
    metavar="FILE[@START:END]",
    shell_complete=complete_file,
    help="The query, a file or a document of STORE, to be seen beside each hit.  "
    "[default: the best hit of each class]",
)
@click.option(
    "--templates",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Draw how near each class comes over time, and its threshold.",
)
@click.option(
    "--top",
    type=click.IntRange(min=1),
    metavar="N",
    help="Only the best N records.  [default: all]",
)
@click.option(
    "--max-size",
    type=NumberRange(min=1),
    default=32.0,
    show_default=True,
    metavar="MB",
    help="Of the page; what is left out to stay below is said.",
)
@click.option(
    "--title", metavar="TEXT", help="Of the page.  [default: what it shows of which store]"
)
@reading_options
@quiet_option
def report(
    store: Path,
    records: Path,
    output: Path,
    example: str | None,
    templates: Path | None,
    top: int | None,
    max_size: float,
    title: str | None,
    quiet: bool,
    **reading: Any,
) -> None:
    """Write a page on which hits or annotations of STORE move, to be opened in a browser.

    RECORDS are JSON lines or CSV that `query`, `retrieve` or `annotate` printed; - is the
    standard input. The page is one file that needs no network. STORE must have poses; the motion
    files themselves are not read.

    \b
    Example:
      mocapidx query takes.store --example kick.amc@1.2:3.0 --format jsonl |
        mocapidx report takes.store - --example kick.amc@1.2:3.0 --output kicks.html
      mocapidx report takes.store annotated.jsonl --templates t.h5 --output takes.html
    """
    from mocapidx.tasks.records import save_text
    from mocapidx.tasks.report import ReportOptions, make_report

    options = ReportOptions(
        example=example,
        templates=templates,
        top=top,
        max_size=max_size,
        title=title,
        read=read_options(reading),
    )
    with Bar("hit", quiet) as bar:
        made = make_report(store, records, options, progress=bar.show)
    if str(output) == "-":
        click.echo(made.html)
    else:
        save_text([made.html], output)
    for remark in made.remarks:
        note(f"Note: {remark}", quiet)
    hits, documents = count(made.hits, made.noun), count(made.documents, "document")
    place = "standard output" if str(output) == "-" else output
    note(f"{place}: {hits} of {documents}, {len(made.html) / 1e6:.1f} MB", quiet)
