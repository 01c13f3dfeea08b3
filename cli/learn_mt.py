"""The command `learn-mt`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mocapidx.printable import count

if TYPE_CHECKING:
    from mocapidx.tasks.learn import LearnedClass

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
from .rows import note

__all__ = ["learn_mt"]

REPETITIONS = ("none", "auto")


@click.command("learn-mt")
@store_argument
@click.option(
    "--labels",
    type=click.Path(path_type=Path),
    metavar="FILE|FOLDER",
    help="Labels: CSV with document,label and perhaps start_time,end_time (seconds),group; or "
    "JSON lines, or files of ELAN, Praat, WebVTT, SRT or BABEL.",
)
@click.option(
    "--labels-from",
    metavar="folder|REGEX",
    help="Take labels from names: the folder, or (?P<label>...) in an expression.",
)
@click.option(
    "--output",
    required=True,
    type=NewFile(),
    metavar="FILE",
    help="The template file to write.",
)
@click.option(
    "--class",
    "classes",
    multiple=True,
    metavar="NAME",
    help="Learn only this class; may be given more than once.  [default: all labels]",
)
@click.option(
    "--repetitions",
    type=click.Choice(REPETITIONS),
    default="none",
    show_default=True,
    help="Each label covers one repetition, or an unknown number of them.",
)
@click.option(
    "--delta",
    type=NumberRange(0, 0.5, min_open=True, max_open=True),
    metavar="SHARE",
    default=0.1,
    show_default=True,
    help="Share of examples that may disagree about an entry that still counts.",
)
@click.option(
    "--background",
    type=click.Path(path_type=Path),
    metavar="STORE",
    help="Unlabelled motion without the classes, for their thresholds.",
)
@jobs_option
@scheduler_option
@quiet_option
def learn_mt(
    store: Path,
    labels: Path | None,
    labels_from: str | None,
    output: Path,
    classes: tuple[str, ...],
    repetitions: Any,
    delta: float,
    background: Path | None,
    jobs: int,
    scheduler: str | None,
    quiet: bool,
) -> None:
    """Learn one motion template for each label from the documents of STORE.

    The class's own threshold is learned from its examples and from those of the other labels.

    \b
    Example:
      mocapidx learn-mt takes.store --labels labels.csv --output sports.h5
    """
    from mocapidx.tasks.learn import LearnOptions, find_labels, learn_classes, save_learning

    options = LearnOptions(
        classes=classes,
        repetitions=repetitions,
        delta=delta,
        background=background,
        jobs=jobs,
    )
    with Bar("class", quiet) as bar, spread(scheduler) as map_fn:
        learning = learn_classes(
            store,
            find_labels(store, labels, labels_from),
            options,
            progress=bar.show,
            report=lambda found: bar.write(sentence(found)),
            map_fn=map_fn,
        )
    save_learning(learning, output)
    for remark in learning.remarks:
        note(f"Note: {remark}", quiet)
    note(f"{output}: {count(len(learning.templates.templates), 'template')}", quiet)


def sentence(found: "LearnedClass") -> str:
    """Say in one line what was learned of a class."""
    template, threshold = found.template, found.threshold
    text = f"{template.label}: {count(found.examples, 'example')}"
    if template.looping:
        text += f" with {count(found.repetitions, 'repetition')}"
    seconds = len(template.matrix) / template.rate
    text += f", {seconds:.2f} s, {count(template.passes, 'pass', 'passes')}"
    if threshold.tau is not None:
        text += (
            f", costs {threshold.positive_cost:.3f} against {threshold.background_cost:.3f}, "
            f"threshold {threshold.tau:.3f}"
        )
    return text
