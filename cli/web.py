"""The command `web` and its subcommands."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import (
    NewFile,
    NumberRange,
    jobs_option,
    quiet_option,
    scheduler_option,
    spread,
    store_argument,
)
from .progress import Bar
from .rows import note, print_rows, row_options

if TYPE_CHECKING:
    from mocapidx.tasks.web import WebProgress

__all__ = ["web"]


@click.group()
def web() -> None:
    """Compare all motion of a store with itself, once, for 'match' to search in.

    A match web holds every pair of stretches that could be similar, at about a byte for each
    pair of frames on the way. Building one takes time and grows with the square of the store;
    searching in it takes milliseconds.

    \b
    Example:
      mocapidx web build takes.store --output takes.web
      mocapidx web info takes.web
    """


@web.command(short_help="Build a match web, or add what is new.")
@store_argument
@click.option(
    "--output",
    required=True,
    type=NewFile(),
    metavar="WEB",
    help="The web; where it is there already, only what is new is compared.",
)
@click.option("--where", metavar="CONDITION", help="Only documents such as 'actor = bd'.")
@click.option(
    "--group-by",
    metavar="KEY",
    help="Compare only documents that have the same KEY, such as class.  [default: all]",
)
@click.option(
    "--name-pattern",
    metavar="REGEX",
    help="Take facts for --group-by from names, by named groups.  [default: those of index]",
)
@click.option(
    "--alpha",
    type=NumberRange(0, 1000),
    default=0.15,
    show_default=True,
    metavar="SHARE",
    help="The valid region ends at cells larger than a minimum by this share.",
)
@click.option(
    "--slope",
    type=click.IntRange(1, 8),
    default=3,
    show_default=True,
    metavar="K",
    help="Most frames of one motion that go with one frame of the other.",
)
@click.option(
    "--chain",
    "chain_seconds",
    type=NumberRange(0, 60),
    default=0.25,
    show_default=True,
    metavar="SECONDS",
    help="Shorter chains of minima are dropped.",
)
@click.option(
    "--bridge",
    "bridge_seconds",
    type=NumberRange(0, 2),
    default=2.0,
    show_default=True,
    metavar="SECONDS",
    help="Bridges between chains are shorter, over both motions together.",
)
@click.option(
    "--printed-region",
    is_flag=True,
    help="Let the valid region run on through lower cells, as printed in the paper.",
)
@click.option(
    "--printed-chains",
    is_flag=True,
    help="Start no chain at a minimum that only the slope kept out of another, as printed.",
)
@click.option(
    "--printed-bridges",
    is_flag=True,
    help="Let bridges run along chains instead of ending at the first, as printed.",
)
@jobs_option
@scheduler_option
@quiet_option
def build(
    store: Path,
    output: Path,
    where: str | None,
    group_by: str | None,
    name_pattern: str | None,
    alpha: float,
    slope: int,
    chain_seconds: float,
    bridge_seconds: float,
    printed_region: bool,
    printed_chains: bool,
    printed_bridges: bool,
    jobs: int,
    scheduler: str | None,
    quiet: bool,
) -> None:
    """Build the match web of a store, or add to it what is new.

    Every two documents are compared once. The work grows with the square of the store: with
    --where or --group-by only some are. An interrupted build goes on where it was.

    \b
    Example:
      mocapidx web build takes.store --output takes.web
      mocapidx web build takes.store --output takes.web --group-by class
    """
    from mocapidx.tasks.web import WebOptions, build_web, path_rules

    rules = path_rules(
        alpha=alpha,
        slope=slope,
        chain_seconds=chain_seconds,
        bridge_seconds=bridge_seconds,
        stop_below=not printed_region,
        restart=not printed_chains,
        stop_at_chains=not printed_bridges,
    )
    options = WebOptions(where, group_by, name_pattern, rules, jobs)
    with Bar(" Mcells", quiet) as bar, spread(scheduler) as map_fn:

        def show(done: "WebProgress") -> None:
            bar.show(done.cells // 1_000_000, done.all_cells // 1_000_000)

        summary = build_web(store, output, options, progress=show, map_fn=map_fn)
    if summary.changed_rules:
        note(f"Note: {output} had other options; all pairs were compared anew", quiet)
    note(
        f"{summary.documents} documents, {summary.pairs} pairs ({summary.new_pairs} new), "
        f"{summary.path_cells} path cells, {summary.size / 1e6:.1f} MB, {summary.seconds:.1f} s",
        quiet,
    )


@web.command(short_help="Show what a match web holds.")
@click.argument("web_file", metavar="WEB", type=click.Path(path_type=Path))
@row_options
def info(web_file: Path, row_format: str, output: Path) -> None:
    """Show what a match web holds and how it was made.

    \b
    Example:
      mocapidx web info takes.web
    """
    from mocapidx.tasks.records import pair_records
    from mocapidx.tasks.web import web_info

    facts = web_info(web_file)
    records = [facts] if row_format == "jsonl" else pair_records(facts)
    print_rows(records, row_format, output, ("what", "value"))
