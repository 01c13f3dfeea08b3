"""The command `features` and what it does with feature sets."""

from pathlib import Path
from typing import Any

import click

from .options import NewFile, NumberRange, complete_file, read_options, reading_options
from .rows import print_rows, row_options

__all__ = ["features"]

set_option = click.option(
    "--feature-set",
    "name",
    default="f39",
    show_default=True,
    metavar="NAME|FILE|STORE",
    shell_complete=complete_file,
    help="A shipped set, a TOML file, or the set of a store.",
)
rate_option = click.option(
    "--rate",
    type=NumberRange(1, 1000),
    default=30.0,
    show_default=True,
    metavar="HZ",
    help="Frames a second at which features are computed.",
)


@click.group()
def features() -> None:
    """Look at feature sets, try them on motion, and learn thresholds.

    A set of your own is a TOML file; docs/features.md has its form.

    \b
    Example:
      mocapidx features show f39 --select lower
      mocapidx features check hands.toml takes/
      mocapidx features plot take.amc --feature F17 --output raised.png
    """


@features.command("list", short_help="List feature sets.")
@click.argument("sets", nargs=-1, metavar="[SET]...", shell_complete=complete_file)
@row_options
def list_sets(sets: tuple[str, ...], row_format: str, output: Path) -> None:
    """List feature sets: the shipped ones, or each SET, a TOML file or a store.

    \b
    Example:
      mocapidx features list
      mocapidx features list hands.toml takes.store
    """
    from mocapidx.tasks.features import SET_COLUMNS, set_records

    print_rows(set_records(sets), row_format, output, SET_COLUMNS)


@features.command(short_help="Show the features of a set.")
@click.argument("name", metavar="SET", default="f39", shell_complete=complete_file)
@click.option(
    "--select",
    default="all",
    show_default=True,
    metavar="FEATURES",
    help="Ids such as F17,F18 or the sets upper, lower, mix, all.",
)
@row_options
def show(name: str, select: str, row_format: str, output: Path) -> None:
    """Show the features of SET: a shipped set, a TOML file, or the set of a store.

    \b
    Example:
      mocapidx features show f31 --select upper
    """
    from mocapidx.tasks.features import FEATURE_COLUMNS, feature_records, named_set

    print_rows(feature_records(named_set(name), select), row_format, output, FEATURE_COLUMNS)


@features.command(short_help="Check a set, and try it on motion.")
@click.argument("name", metavar="SET", shell_complete=complete_file)
@click.argument("inputs", nargs=-1, metavar="[MOTION]...", type=click.Path(path_type=Path))
@rate_option
@reading_options
@row_options
def check(
    name: str,
    inputs: tuple[Path, ...],
    rate: float | None,
    row_format: str,
    output: Path,
    **reading: Any,
) -> None:
    """Check a feature set; with MOTION, files, folders or stores, try it there too.

    The trial says how often each feature is on, how often it changes, and which features look
    odd: never on, always on, or trembling around a threshold.

    \b
    Example:
      mocapidx features check hands.toml
      mocapidx features check hands.toml takes.store
    """
    from mocapidx.tasks import features as task

    feature_set = task.named_set(name)
    if not inputs:
        print_rows([task.set_facts(feature_set)], row_format, output, task.SET_COLUMNS)
        return
    records = task.check_features(feature_set, inputs, rate=rate, read=read_options(reading))
    print_rows(records, row_format, output, task.CHECK_COLUMNS)


@features.command(short_help="Draw the values beneath features.")
@click.argument("motion", type=click.Path(path_type=Path))
@click.option(
    "--feature",
    "selected",
    required=True,
    multiple=True,
    metavar="ID",
    help="A feature, a panel each; may be repeated.",
)
@set_option
@click.option("--document", metavar="NAME", help="The document, where MOTION is a store.")
@click.option("--start", type=NumberRange(min=0), metavar="SECONDS", help="From here.")
@click.option(
    "--end", type=NumberRange(min=0, min_open=True), metavar="SECONDS", help="Up to here."
)
@rate_option
@click.option(
    "--output",
    type=NewFile(),
    required=True,
    help="The picture: PNG or SVG by suffix.",
)
@reading_options
def plot(
    motion: Path,
    selected: tuple[str, ...],
    name: str,
    document: str | None,
    start: float | None,
    end: float | None,
    rate: float | None,
    output: Path,
    **reading: Any,
) -> None:
    """Draw the values beneath features over MOTION, with both thresholds.

    A feature turns on beyond the dashed threshold and off behind the dotted one; it is on where
    shaded.

    \b
    Example:
      mocapidx features plot kick.amc --feature F17 --feature F20 --output kick.png
      mocapidx features plot takes.store --document kick.amc --feature F17 --output kick.svg
    """
    from mocapidx.tasks.features import draw_features, named_set

    draw_features(
        named_set(name),
        ",".join(selected),
        motion,
        output,
        document=document,
        start=start,
        end=end,
        rate=rate,
        read=read_options(reading),
    )


@features.command("learn-threshold", short_help="Learn a feature's thresholds from examples.")
@click.argument(
    "inputs", nargs=-1, required=True, metavar="MOTION...", type=click.Path(path_type=Path)
)
@click.option(
    "--positive",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE|FOLDER",
    help="Labels, as learn-mt reads them: where the feature should be on.",
)
@click.option(
    "--negative",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE|FOLDER",
    help="Labels, as learn-mt reads them: where it should be off.",
)
@click.option("--feature", required=True, metavar="ID", help="The feature.")
@set_option
@rate_option
@reading_options
@row_options
def learn_threshold(
    inputs: tuple[Path, ...],
    positive: Path,
    negative: Path,
    feature: str,
    name: str,
    rate: float | None,
    row_format: str,
    output: Path,
    **reading: Any,
) -> None:
    """Learn both thresholds of a feature from examples in MOTION, files, folders or stores.

    `on` and `off` are for the set's TOML file; `right` is the share of frames that come out as
    they should, 0.5 is chance.

    \b
    Example:
      mocapidx features learn-threshold takes.store --feature F17 \\
        --positive raised.csv --negative standing.csv
    """
    from mocapidx.tasks.features import named_set
    from mocapidx.tasks.learn_thresholds import learn_feature, separation_facts
    from mocapidx.tasks.records import pair_records

    feature_set = named_set(name)
    found = learn_feature(
        inputs, feature_set, feature, positive, negative, rate=rate, read=read_options(reading)
    )
    facts = separation_facts(feature_set, feature, found)
    records = pair_records(facts) if row_format == "table" else [facts]
    print_rows(records, row_format, output, ("what", "value"))
