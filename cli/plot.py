"""The command `plot`."""

from pathlib import Path
from typing import Any

import click

from .options import (
    NewFile,
    NumberRange,
    complete_file,
    read_options,
    reading_options,
    store_argument,
)

__all__ = ["plot"]

picture_option = click.option(
    "--output",
    type=NewFile(),
    required=True,
    help="The picture: PNG or SVG by suffix.",
)
labels_option = click.option(
    "--labels",
    type=click.Path(path_type=Path),
    metavar="FILE|FOLDER",
    help="Labels to draw above, as learn-mt reads them.",
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
    """Draw features, lists, templates, distances, annotations, confusions as PNG or SVG.

    No display is needed. `mocapidx align --plot` draws alignments.

    \b
    Example:
      mocapidx plot distance take.amc --templates t.h5 --class squat --output squat.png
      mocapidx annotate take.amc --templates t.h5 --format jsonl |
        mocapidx plot annotation - --labels labels.csv --output take.svg
    """


@plot.command(short_help="Draw how near each class comes over time.")
@click.argument("motion", type=click.Path(path_type=Path))
@click.option(
    "--templates",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE",
    help="Template file, from learn-mt.",
)
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


@plot.command(short_help="Draw all features over time, with the segments.")
@click.argument("motion", type=click.Path(path_type=Path))
@click.option("--document", metavar="NAME", help="The document, where MOTION is a store.")
@click.option("--start", type=NumberRange(min=0), metavar="SECONDS", help="From here.")
@click.option(
    "--end", type=NumberRange(min=0, min_open=True), metavar="SECONDS", help="Up to here."
)
@click.option(
    "--feature-set",
    default="f39",
    show_default=True,
    metavar="NAME|FILE",
    shell_complete=complete_file,
    help="Features of a file; a store has its own.",
)
@picture_option
@reading_options
def matrix(
    motion: Path,
    document: str | None,
    start: float | None,
    end: float | None,
    feature_set: str,
    output: Path,
    **reading: Any,
) -> None:
    """Draw all features of MOTION over time: dark is on, grey is what the skeleton can't tell.

    MOTION is a motion file or a store. Below the features of each part stand the segments of its
    sub-index.

    \b
    Example:
      mocapidx plot matrix kick.amc --output kick.png
      mocapidx plot matrix takes.store --document walk/a.amc --end 20 --output walk.svg
    """
    from mocapidx.tasks.plot_features import draw_feature_matrix

    draw_feature_matrix(
        motion,
        output,
        document=document,
        start=start,
        end=end,
        feature_set=feature_set,
        read=read_options(reading),
    )


@plot.command(short_help="Draw how long the inverted lists of a store are.")
@store_argument
@picture_option
def lists(store: Path, output: Path) -> None:
    """Draw how many segments each feature word of STORE has, in each sub-index.

    Short lists make fast queries.

    \b
    Example:
      mocapidx plot lists takes.store --output lists.png
    """
    from mocapidx.tasks.plot_features import draw_list_sizes

    draw_list_sizes(store, output)


@plot.command(short_help="Draw the template of a class.")
@click.argument("templates", type=click.Path(path_type=Path))
@click.option("--class", "label", required=True, metavar="NAME", help="The class.")
@picture_option
def template(templates: Path, label: str, output: Path) -> None:
    """Draw what the examples of a class in TEMPLATES agree on.

    Further templates of the class get -2, -3, ... behind the name of the picture.

    \b
    Example:
      mocapidx plot template sports.h5 --class squat --output squat.png
    """
    from mocapidx.tasks.plot import draw_templates
    from mocapidx.tasks.template import shown_template

    draw_templates(*shown_template(templates, label), output)


@plot.command(short_help="Draw what was said while something else happened.")
@click.argument("records", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "--labels",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE|FOLDER",
    help="Labels of what really happened, as learn-mt reads them.",
)
@click.option(
    "--labelled-documents",
    is_flag=True,
    help="Leave out what is said of documents without any label.",
)
@picture_option
def confusion(records: Path, labels: Path, labelled_documents: bool, output: Path) -> None:
    """Draw how the time of each labelled class is shared out in RECORDS, annotations.

    \b
    Example:
      mocapidx plot confusion annotations.jsonl --labels labels.csv --output confusion.png
    """
    from mocapidx.tasks.plot import draw_confusion

    draw_confusion(records, labels, output, labelled_documents=labelled_documents)
