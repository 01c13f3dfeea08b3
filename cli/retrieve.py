"""The command `retrieve`."""

from pathlib import Path
from typing import Any

import click

from .options import NewFile, NumberRange, quiet_option, scheduler_option, spread, store_argument
from .rows import note, print_rows, row_options

__all__ = ["retrieve"]

STEPS = ("weighted", "printed")


@click.command()
@store_argument
@click.option(
    "--templates",
    required=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Template file, from learn-mt.",
)
@click.option("--class", "label", required=True, metavar="NAME", help="The class to find.")
@click.option(
    "--tau",
    type=NumberRange(min=0, min_open=True),
    metavar="COST",
    help="Hits cost less than this; rivals are then off.  [default: the class's own, else 0.06]",
)
@click.option(
    "--delta",
    type=NumberRange(0, 0.5, min_open=True, max_open=True),
    metavar="SHARE",
    help="Share of examples that may disagree about an entry that still counts."
    "  [default: the template's]",
)
@click.option(
    "--top", type=click.IntRange(min=1), metavar="N", help="Only the best N.  [default: all]"
)
@click.option(
    "--steps",
    type=click.Choice(STEPS),
    default="weighted",
    show_default=True,
    help="Whether a match pays for what it passes over, or not, as printed in the paper.",
)
@click.option(
    "--no-rivals",
    "rivals",
    flag_value=False,
    default=True,
    help="Keep hits that another class of the same file explains better.",
)
@click.option(
    "--keyframes",
    default="none",
    show_default=True,
    metavar="none|auto|COLUMNS",
    help="Match only where keyframes follow one another: the template's own, or columns of it, "
    "from 0, such as 8,44. That can lose hits.",
)
@click.option(
    "--keyframe-tolerance",
    type=click.IntRange(min=0),
    metavar="N",
    help="Entries of a keyframe that may disagree.  [default: the template's, else 3]",
)
@click.option(
    "--min-overlap",
    type=NumberRange(0, 1, max_open=True),
    metavar="SHARE",
    default=0.5,
    show_default=True,
    help="Hits that share more than this part of the shorter one are the same; the best stays.",
)
@click.option(
    "--profile",
    type=NewFile(),
    metavar="FILE.csv",
    help="Write the distance function: document, frame, time (seconds), cost.",
)
@row_options
@scheduler_option
@quiet_option
def retrieve(
    store: Path,
    templates: Path,
    label: str,
    tau: float | None,
    delta: float | None,
    top: int | None,
    steps: Any,
    rivals: bool,
    keyframes: str,
    keyframe_tolerance: int | None,
    min_overlap: float,
    profile: Path | None,
    row_format: str,
    output: Path,
    scheduler: str | None,
    quiet: bool,
) -> None:
    """Find every occurrence of a motion class in STORE, best first.

    A cost is the share of the consistent entries of the class's template that the motion
    violates: 0 is perfect.

    \b
    Example:
      mocapidx retrieve takes.store --templates sports.h5 --class squat --top 20
    """
    from mocapidx.tasks.records import HIT_COLUMNS, hit_record
    from mocapidx.tasks.retrieve import RetrieveOptions, parse_keyframes
    from mocapidx.tasks.retrieve import retrieve as retrieve_class

    options = RetrieveOptions(
        tau=tau,
        delta=delta,
        top=top,
        steps=steps,
        rivals=rivals,
        keyframes=parse_keyframes(keyframes),
        keyframe_tolerance=keyframe_tolerance,
        min_overlap=min_overlap,
    )
    with spread(scheduler) as map_fn:
        found = retrieve_class(store, templates, label, options, profile=profile, map_fn=map_fn)
    for remark in found.remarks:
        note(f"Note: {remark}", quiet)
    records = [hit_record(hit, rank) for rank, hit in enumerate(found.hits, start=1)]
    print_rows(records, row_format, output, HIT_COLUMNS)
