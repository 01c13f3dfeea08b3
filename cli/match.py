"""The command `match`."""

from pathlib import Path

import click

from .options import NewFile, NumberRange, quiet_option, store_argument
from .rows import note, print_rows, row_options, warn

__all__ = ["match"]


@click.command()
@store_argument
@click.option(
    "--web",
    required=True,
    type=click.Path(path_type=Path),
    metavar="WEB",
    help="Match web of the store, from web build.",
)
@click.option(
    "--query",
    required=True,
    metavar="DOCUMENT[@START:END]",
    help="A document of the store, or seconds of it, at least 0.25.",
)
@click.option(
    "--epsilon",
    type=NumberRange(0, 10, min_open=True),
    metavar="METRES",
    help="Most that aligned frames may differ on average.  [default: chosen by a sweep]",
)
@click.option(
    "--single-step",
    is_flag=True,
    help="Only what is close to the query itself, not what is close to that.",
)
@click.option(
    "--sweep",
    is_flag=True,
    help="Show the number of matches over epsilon, from 0.04 to 0.22 m, instead of matches.",
)
@click.option(
    "--most",
    type=click.IntRange(min=1),
    default=400,
    show_default=True,
    metavar="N",
    help="Stop adding matches at so many.",
)
@click.option(
    "--same-overlap",
    type=NumberRange(0, 1),
    default=0.8,
    show_default=True,
    metavar="SHARE",
    help="Matches that overlap by more are one.",
)
@click.option(
    "--new-overlap",
    type=NumberRange(0, 1),
    default=0.2,
    show_default=True,
    metavar="SHARE",
    help="A match that overlaps all known ones by less is new; more suits periodic motion.",
)
@click.option(
    "--slack",
    type=NumberRange(0, 0.5),
    default=0.15,
    show_default=True,
    metavar="SHARE",
    help="Share of the query that may lack an alignment at either end; 0: as printed.",
)
@click.option(
    "--printed-overlap",
    is_flag=True,
    help="Measure overlap by the shorter of two stretches, as printed in the paper.",
)
@click.option(
    "--printed-averaging",
    is_flag=True,
    help="Average a match with what overlaps it, as printed; matches then drift.",
)
@click.option(
    "--graph",
    type=NewFile(),
    metavar="FILE",
    help="Write the match graph: .json (for blend) or .graphml; .png or .svg draws it.",
)
@click.option(
    "--top", type=click.IntRange(min=1), metavar="N", help="Only the best N.  [default: all]"
)
@row_options
@quiet_option
def match(
    store: Path,
    web: Path,
    query: str,
    epsilon: float | None,
    single_step: bool,
    sweep: bool,
    most: int,
    same_overlap: float,
    new_overlap: float,
    slack: float,
    printed_overlap: bool,
    printed_averaging: bool,
    graph: Path | None,
    top: int | None,
    row_format: str,
    output: Path,
    quiet: bool,
) -> None:
    """Find what moves like a stretch of STORE, directly or through what is in between.

    What is close to the query becomes a query itself, so that variants are found that are far
    from it but connected to it. The cost is the length of the way there in metres; direct is
    the distance to the query where the two could be aligned.

    \b
    Example:
      mocapidx match takes.store --web takes.web --query kick_01.amc@0.5:2
      mocapidx match takes.store --web takes.web --query kick_01.amc --graph kicks.json
    """
    from mocapidx.tasks.match import (
        MATCH_COLUMNS,
        SWEEP_COLUMNS,
        MatchOptions,
        match_records,
        match_store,
        sweep_records,
    )

    options = MatchOptions(
        epsilon=epsilon,
        single_step=single_step,
        most=most,
        same_overlap=same_overlap,
        new_overlap=new_overlap,
        slack=slack,
        union=not printed_overlap,
        keep=not printed_averaging,
        sweep=sweep,
    )
    found = match_store(store, web, query, options, graph=graph)
    for remark in found.remarks:
        note(f"Note: {remark}", quiet)
    for warning in found.warnings:
        warn(warning)
    if sweep:
        print_rows(sweep_records(found.steps), row_format, output, SWEEP_COLUMNS)
    else:
        print_rows(match_records(found)[:top], row_format, output, MATCH_COLUMNS)
