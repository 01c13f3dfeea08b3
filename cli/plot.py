"""The command `plot`."""

from pathlib import Path
from typing import Any

import click

from .options import NumberRange, read_options, reading_options

__all__ = ["plot"]

picture_option = click.option(
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    help="The picture: PNG or SVG by suffix.",
)
labels_option = click.option(
    "--labels",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Labels file (CSV) to draw above.",
)
document_option = click.option(
    "--document",
    "documents",
    multiple=True,
    metavar="NAME",
    help="Only this document; may be repeated.",
)


@click.group()
def plot() -> None:
    """Draw distance functions and annotations as PNG or SVG; needs no display.

    \b
    Example:
      mocapidx plot distance take.amc --templates t.h5 --class squat --output squat.png
      mocapidx annotate take.amc --templates t.h5 --format jsonl |
        mocapidx plot annotation - --labels labels.csv --output take.svg
    """


@plot.command(short_help="Draw how near each class comes over time.")
@click.argument("motion", type=click.Path(path_type=Path))
@click.option("--templates", type=click.Path(path_type=Path), required=True, help="Template file.")
@click.option(
    "--class",
    "classes",
    multiple=True,
    metavar="NAME",
    help="A class, a panel each; may be repeated.  [default: all]",
)
@document_option
@labels_option
@click.option(
    "--tau",
    type=NumberRange(min=0, min_open=True),
    metavar="COST",
    help="Threshold of all classes.  [default: the class's own, else 0.06]",
)
@click.option(
    "--steps",
    type=click.Choice(["weighted", "printed"]),
    default="weighted",
    show_default=True,
    help="How a step that passes over a frame of the template is paid.",
)
@picture_option
@reading_options
def distance(
    motion: Path,
    templates: Path,
    classes: tuple[str, ...],
    documents: tuple[str, ...],
    labels: Path | None,
    tau: float | None,
    steps: Any,
    output: Path,
    **reading: Any,
) -> None:
    """Draw how near each class comes over time in MOTION, a motion file or a store.

    Below the dashed threshold a minimum is a hit: the shaded stretch that ends there.

    \b
    Example:
      mocapidx plot distance take.amc --templates t.h5 --class squat --output squat.png
      mocapidx plot distance takes.store --document walk/a.amc --templates t.h5 --output a.svg
    """
    from mocapidx.tasks.plot import draw_distances

    draw_distances(
        motion,
        templates,
        output,
        classes=classes,
        documents=documents,
        labels=labels,
        tau=tau,
        steps=steps,
        read=read_options(reading),
    )


@plot.command(short_help="Draw annotations or hits as timelines.")
@click.argument("records", type=click.Path(path_type=Path, allow_dash=True))
@document_option
@labels_option
@picture_option
def annotation(
    records: Path, documents: tuple[str, ...], labels: Path | None, output: Path
) -> None:
    """Draw RECORDS, annotations or hits as JSON lines or CSV, as a timeline for each document.

    \b
    Example:
      mocapidx plot annotation annotations.jsonl --labels labels.csv --output takes.png
    """
    from mocapidx.tasks.plot import draw_annotations

    draw_annotations(records, output, labels=labels, documents=documents)
