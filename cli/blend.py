"""The command `blend` and what it does: fit spaces of motion, look at them, make new motion."""

from pathlib import Path
from typing import Any

import click

from .options import NewFile, NumberRange, complete_file
from .rows import note, print_rows, row_options

__all__ = ["blend"]

space_argument = click.argument("space", type=click.Path(path_type=Path))
quiet_option = click.option("--quiet", is_flag=True, help="Say nothing but errors.")


def numbers(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
    """Take numbers with commas between them apart; of an option that may be repeated, each."""
    if isinstance(value, tuple):
        return tuple(numbers(ctx, param, each) for each in value)
    try:
        return tuple(float(part) for part in str(value).split(","))
    except ValueError as exc:
        raise click.BadParameter(f"{value!r} is no list of numbers such as 0.1,1.2,0.9") from exc


@click.group()
def blend() -> None:
    """Make new motion from found motion: fit a space, then say where to go in it.

    \b
    Example:
      mocapidx match takes.store --web takes.web --query kick.amc --format jsonl \\
        --graph kicks.json --output kicks.jsonl
      mocapidx blend fit kicks.jsonl --store takes.store --graph kicks.json \\
        --parameter foot.toml --output kicks.space
      mocapidx blend make kicks.space --at 0.1,1.2,0.9 --output kick.bvh
    """


@blend.command(short_help="Register found motions and sample their blends.")
@click.argument("hits", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "--parameter",
    required=True,
    metavar="FILE",
    shell_complete=complete_file,
    help="What to steer by: a TOML file, or FILE.py:FUNCTION (which is run).",
)
@click.option(
    "--output",
    type=NewFile(),
    required=True,
    help="The space file; no file is left half written.",
)
@click.option(
    "--store",
    type=click.Path(path_type=Path),
    metavar="STORE",
    help="Knows where the documents of HITS are.",
)
@click.option(
    "--root",
    "roots",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    multiple=True,
    help="Folder that documents lie below; may be repeated.",
)
@click.option(
    "--graph",
    type=click.Path(path_type=Path),
    metavar="FILE.json",
    help="Match graph of `match`: motions are aligned along its edges.  "
    "[default: each with the first of HITS]",
)
@click.option("--top", type=click.IntRange(min=2), metavar="N", help="Only the first N of HITS.")
@click.option(
    "--extrapolation",
    type=NumberRange(0, 1),
    default=0.1,
    show_default=True,
    metavar="WEIGHT",
    help="How far blend weights may go below 0 and above 1.",
)
@click.option(
    "--samples",
    type=click.IntRange(0, 100_000),
    default=1000,
    show_default=True,
    metavar="N",
    help="How many blends are tried.",
)
@click.option(
    "--tolerance",
    type=NumberRange(min=0),
    default=0.0127,
    show_default=True,
    metavar="METRES",
    help="Drop samples nearer to another one (m/s, s and radians count as metres).",
)
@click.option(
    "--redundant",
    type=NumberRange(min=0),
    metavar="METRES",
    help="Leave out examples that the others give, off by this at most.  [default: keep all]",
)
@click.option(
    "--joint-map",
    type=click.Path(path_type=Path),
    metavar="FILE.toml",
    help="Maps a rig's nodes to the 24 joints.  [default: chosen by the names]",
)
@quiet_option
def fit(
    hits: Path,
    parameter: str,
    output: Path,
    store: Path | None,
    roots: tuple[Path, ...],
    graph: Path | None,
    top: int | None,
    extrapolation: float,
    samples: int,
    tolerance: float,
    redundant: float | None,
    joint_map: Path | None,
    quiet: bool,
) -> None:
    """Build a space of motion from HITS (JSON lines or CSV of query, retrieve or match).

    All motions must have one skeleton hierarchy; new motion has the bones of the first.

    \b
    Example:
      mocapidx blend fit kicks.jsonl --store takes.store --parameter foot.toml \\
        --output kicks.space
    """
    from mocapidx.tasks import blend as task
    from mocapidx.tasks.blend_examples import ExampleOptions
    from mocapidx.tasks.read import ReadOptions

    space = task.fit_blend_space(
        hits,
        parameter,
        output,
        examples=ExampleOptions(store, roots, graph, top, ReadOptions(joint_map=joint_map)),
        options=task.FitOptions(extrapolation, samples, tolerance, redundant),
    )
    for line in task.space_facts(space):
        note(line, quiet)


@blend.command(short_help="Make the motion that does what is asked.")
@space_argument
@click.option(
    "--at",
    callback=numbers,
    required=True,
    metavar="X,Y,...",
    help="The parameters, in their units (see `blend info`).",
)
@click.option(
    "--output",
    type=NewFile(is_motion=True),
    required=True,
    metavar="NEW.bvh|NEW.amc",
    help="The new motion; NEW.asf is written with an AMC.",
)
@click.option(
    "--rate",
    type=NumberRange(1, 1000),
    metavar="HZ",
    help="Frames a second of the new motion.  [default: the first example's]",
)
@click.option(
    "--parameter",
    metavar="FILE.py:FUNCTION",
    shell_complete=complete_file,
    help="The function again, where the space was fitted with one; it is run.",
)
@click.option(
    "--picture",
    type=NewFile(),
    metavar="FILE",
    help="Draw the new motion as stick figures too: PNG or SVG by suffix.",
)
@click.option(
    "--format",
    "row_format",
    type=click.Choice(["table", "jsonl", "csv"]),
    default="table",
    show_default=True,
    help="How records are printed.",
)
@quiet_option
def make(
    space: Path,
    at: tuple[float, ...],
    output: Path,
    rate: float | None,
    parameter: str | None,
    picture: Path | None,
    row_format: str,
    quiet: bool,
) -> None:
    """Make the motion of SPACE that has the parameters asked for, or comes nearest to them.

    It starts over the origin and faces Z; X is to the left, Y is up.

    \b
    Example:
      mocapidx blend make kicks.space --at 0.1,1.2,0.9 --output kick.bvh
    """
    from mocapidx.tasks import blend as task

    if picture is not None:
        from mocapidx.tasks.blend_plot import draw_motion, picture_format

        picture_format(picture)
    made = task.make_motion(space, at, parameter=parameter, rate=rate, output=output)
    if picture is not None:
        draw_motion(made, picture)
    print_rows(task.aim_records(made), row_format, Path("-"), task.AIM_COLUMNS)
    note(task.made_summary(made), quiet)


@blend.command(short_help="Show the examples of a space and what it is steered by.")
@space_argument
@row_options
def info(space: Path, row_format: str, output: Path) -> None:
    """Show the examples of SPACE, their parameters, and how far these go.

    \b
    Example:
      mocapidx blend info kicks.space
    """
    from mocapidx.tasks import blend as task

    loaded = task.open_space(space)
    above = [*task.space_facts(loaded), ""] if row_format == "table" else []
    columns = (*task.EXAMPLE_COLUMNS, *loaded.names)
    print_rows(task.example_records(loaded), row_format, output, columns, above=above)


@blend.command(short_help="Draw the accessible region of a space.")
@space_argument
@click.option(
    "--output",
    type=NewFile(),
    required=True,
    help="The picture: PNG or SVG by suffix.",
)
@click.option(
    "--at",
    "targets",
    callback=numbers,
    multiple=True,
    metavar="X,Y,...",
    help="Draw this target, and what comes nearest to it; may be repeated.",
)
@click.option(
    "--parameter",
    metavar="FILE.py:FUNCTION",
    shell_complete=complete_file,
    help="The function again, where the space was fitted with one; it is run.",
)
def plot(
    space: Path, output: Path, targets: tuple[tuple[float, ...], ...], parameter: str | None
) -> None:
    """Draw which parameters the motions of SPACE can have: examples, samples and targets.

    \b
    Example:
      mocapidx blend plot kicks.space --at 0.1,1.2,0.9 --output kicks.png
    """
    from mocapidx.tasks.blend_plot import draw_space

    draw_space(space, output, targets, parameter=parameter)
