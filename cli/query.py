"""The command `query`."""

from pathlib import Path
from typing import Any

import click

from .auto import print_auto
from .options import (
    NewFile,
    complete_file,
    quiet_option,
    read_options,
    reading_options,
    scheduler_option,
    spread,
    store_argument,
)
from .rows import note, print_rows, row_options

__all__ = ["query"]

MODES = ("exact", "fuzzy", "adaptive", "mismatch")
RANKINGS = ("length", "dtw", "template", "none")
ASKED = ("pattern", "steps_of", "scene", "mode", "mismatches", "mirror", "where")
UNSET = {None, "adaptive", 0}  # what they are where not given; 0 is also False


@click.command()
@store_argument
@click.option(
    "--example",
    "examples",
    multiple=True,
    metavar="FILE[@START:END]",
    shell_complete=complete_file,
    help="A motion file, or a document of STORE, or the part between two times in seconds.",
)
@click.option(
    "--pattern",
    type=click.Path(path_type=Path),
    metavar="FILE.toml",
    help="Steps written by hand, in place of an example.",
)
@click.option(
    "--steps-of",
    nargs=2,
    metavar="FEATURES STEPS",
    help="The short form of a pattern, such as F20 '0 1 0 1 0'.",
)
@click.option(
    "--scene",
    metavar="FILE.toml|NAME",
    shell_complete=complete_file,
    help="Several progressions and conditions between them; shipped is kick-then-punch.",
)
@click.option(
    "--select",
    metavar="FEATURES",
    help="Features of an example that count: ids such as F17,F18, names, or the sets upper, "
    "lower, mix, all; auto, which weighs all of them and ranks everything; or relax, which leaves "
    "features out until there are enough hits.  [default: all]",
)
@click.option(
    "--no-feedback",
    is_flag=True,
    help="With auto: don't sharpen the template with the surest hits.",
)
@click.option(
    "--learn",
    type=NewFile(),
    metavar="TEMPLATES",
    help="With auto: write a motion template of the example and the surest hits to this file.",
)
@click.option(
    "--mode",
    type=click.Choice(MODES),
    default="adaptive",
    show_default=True,
    help="How steps are matched: segmentation of the selection, of its sub-indexes, adapted, or "
    "but for some steps.",
)
@click.option(
    "--mismatches",
    type=click.IntRange(min=0),
    default=0,
    metavar="M",
    help="With the mode mismatch: how many steps may disagree.  [default: 0]",
)
@click.option(
    "--mismatch-at",
    metavar="STEPS",
    help="With the mode mismatch: only these steps may, such as 2,4.  [default: any]",
)
@click.option(
    "--rank",
    type=click.Choice(RANKINGS),
    help="Order hits by the lengths of their steps, by time warping (of poses where STORE has "
    "them), by the example as a template, or by document.  [default: length, or none without "
    "an example]",
)
@click.option(
    "--any/--all",
    "any_of",
    default=True,
    help="With several examples: hits of any of them, or where all of them agree.",
)
@click.option(
    "--mirror", is_flag=True, help="Also look for the same with left and right exchanged."
)
@click.option(
    "--where",
    metavar="CONDITION",
    help="Only documents such as 'actor = ann and not class = walk*'; info --where lists them.",
)
@click.option("--explain", is_flag=True, help="Say why there are hits, or why there is none.")
@click.option(
    "--top", type=click.IntRange(min=1), metavar="N", help="Only the best N.  [default: all]"
)
@reading_options
@row_options
@scheduler_option
@quiet_option
def query(
    store: Path,
    examples: tuple[str, ...],
    select: str | None,
    no_feedback: bool,
    learn: Path | None,
    rank: str | None,
    top: int | None,
    mismatch_at: str | None,
    any_of: bool,
    explain: bool,
    row_format: str,
    output: Path,
    scheduler: str | None,
    quiet: bool,
    **others: Any,
) -> None:
    """Find every place in STORE that moves like an example, or as a pattern or scene says.

    A hit goes through the same sequence of feature words as the example, whatever the speed.
    Times are in seconds of the document; source frames are those of the original file.

    \b
    Example:
      mocapidx query takes.store --example kick.amc@1.2:3.0 --select F17,F20
      mocapidx query takes.store --example kick.amc --select auto --top 20
      mocapidx query takes.store --steps-of "right knee bent" "0 1 0 1 0" --mirror
      mocapidx query takes.store --scene kick-then-punch --where "actor = ann"
    """
    asked = {name: others.pop(name) for name in ASKED}
    if select == "auto":
        auto: dict[str, Any] = {"feedback": not no_feedback, "learn": learn, "top": top}
        auto["where"] = asked.pop("where")
        if len(examples) != 1 or rank or mismatch_at or not any_of or set(asked.values()) != UNSET:
            raise click.UsageError(
                "--select auto takes one --example, and of the other options only --no-feedback, "
                "--learn, --where, --top and --explain"
            )
        with spread(scheduler) as map_fn:
            auto |= {} if map_fn is None else {"map_fn": map_fn}
            print_auto(store, examples[0], auto, others, row_format, output, quiet, explain=explain)
        return
    if learn is not None or no_feedback:
        raise click.UsageError("--learn and --no-feedback go with --select auto")
    from mocapidx.tasks.query import query_store
    from mocapidx.tasks.records import HIT_COLUMNS

    with spread(scheduler) as map_fn:
        found = query_store(
            store,
            examples or None,
            select=select,
            rank=rank,
            top=top,
            mismatch_at=None if mismatch_at is None else steps_of_text(mismatch_at),
            combine="any" if any_of else "all",
            explain=explain,
            read=read_options(others),
            map_fn=map_fn,
            **asked,
        )
    for remark in found.remarks:
        note(f"Note: {remark}", quiet)
    columns = (*HIT_COLUMNS, "mirrored") if asked["mirror"] else HIT_COLUMNS
    print_rows(found.records(), row_format, output, columns)
    if row_format == "table" or not found.hits:
        for line in found.explanation:
            click.echo(line, err=True)


def steps_of_text(text: str) -> list[int]:
    """Read step numbers such as ``2,4``."""
    try:
        return [int(number) for number in text.split(",")]
    except ValueError:
        raise click.UsageError(
            f"--mismatch-at takes numbers of steps such as 2,4, not '{text}'"
        ) from None
