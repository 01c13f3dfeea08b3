"""The command `annotate`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mocapidx.printable import count, shown

if TYPE_CHECKING:
    from mocapidx.tasks.annotate import Annotated

from .options import (
    NumberRange,
    jobs_option,
    quiet_option,
    read_options,
    reading_options,
    scheduler_option,
    spread,
)
from .progress import Bar
from .rows import note, print_rows, row_options, warn

__all__ = ["annotate"]

SKIPPED = 5  # exit code: done, but some inputs were skipped
METHODS = ("path", "hits")
OVERLAPS = ("rivals", "keep")


@click.command()
@click.argument(
    "inputs",
    nargs=-1,
    required=True,
    metavar="INPUT_OR_STORE...",
    type=click.Path(path_type=Path),
)
@click.option(
    "--templates",
    required=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Template file, from learn-mt.",
)
@click.option(
    "--class",
    "classes",
    multiple=True,
    metavar="NAME",
    help="Only this class; may be given more than once.  [default: all]",
)
@click.option(
    "--method",
    type=click.Choice(METHODS),
    default="path",
    show_default=True,
    help="One path through looping templates, or the hits of quantised templates.",
)
@click.option(
    "--fill", is_flag=True, help="path: label every frame, also motion that is like no class."
)
@click.option(
    "--overlap",
    type=click.Choice(OVERLAPS),
    default="rivals",
    show_default=True,
    help="hits: where classes overlap, keep the better one or all.",
)
@click.option(
    "--tau",
    type=NumberRange(min=0, min_open=True),
    metavar="COST",
    help="hits: one threshold for all classes.  [default: each class's own, else 0.06]",
)
@click.option(
    "--skip-bad", is_flag=True, help="Pass over files that can't be used; the exit code is then 5."
)
@click.option(
    "--root",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Name documents by their path below this folder.",
)
@reading_options
@row_options
@jobs_option
@scheduler_option
@quiet_option
def annotate(
    inputs: tuple[Path, ...],
    templates: Path,
    classes: tuple[str, ...],
    method: Any,
    fill: bool,
    overlap: Any,
    tau: float | None,
    skip_bad: bool,
    root: Path | None,
    row_format: str,
    output: Path,
    jobs: int,
    scheduler: str | None,
    quiet: bool,
    **reading: Any,
) -> int:
    """Say which motion class occurs when, in motion files, folders and stores.

    Each record is a stretch of a document in which one class goes on, with the number of its
    repetitions. Motion that is like no class stays unlabelled.

    \b
    Example:
      mocapidx annotate takes/ --templates sports.h5 --format csv --output labels.csv
    """
    from mocapidx.tasks.annotate import (
        ANNOTATION_COLUMNS,
        AnnotateOptions,
        annotate_motion,
        annotation_record,
    )

    options = AnnotateOptions(
        classes=classes,
        method=method,
        fill=fill,
        overlap=overlap,
        tau=tau,
        skip_bad=skip_bad,
        read=read_options(reading),
        root=root,
        jobs=jobs,
    )
    with Bar("doc", quiet) as bar, spread(scheduler) as map_fn:
        annotated = annotate_motion(inputs, templates, options, progress=bar.show, map_fn=map_fn)
    for refused in annotated.refused:
        warn(refused.message)
    if not (annotated.documents or annotated.refused or quiet):
        warn(f"no motion file below {', '.join(map(shown, inputs))}: is it the right folder?")
    if annotated.assumed_rate and not quiet:
        files, first = count(len(annotated.assumed_rate), "AMC file"), annotated.assumed_rate[0]
        warn(
            f"nothing says the rate of {files}, such as {first}: taken as 120 Hz; use --source-rate"
        )
    if annotated.untold:
        several, first = count(len(annotated.untold), "document"), annotated.untold[0]
        told = "too little of any class can be told, always or in gaps"
        note(f"Note: in {several}, such as {first}, {told}: no annotations there", quiet)
    records = map(annotation_record, annotated.annotations)
    print_rows(records, row_format, output, ANNOTATION_COLUMNS)
    note(sentence(annotated), quiet)
    return SKIPPED if annotated.refused else 0


def sentence(annotated: "Annotated") -> str:
    """Say in one line what was annotated."""
    minutes = annotated.frames / annotated.rate / 60
    text = (
        f"{count(annotated.documents, 'document')}, {minutes:.1f} minutes: "
        f"{count(len(annotated.annotations), 'annotation')}"
    )
    return f"{text}; {len(annotated.refused)} could not be used" if annotated.refused else text
