"""The command `evaluate`."""

from pathlib import Path

import click

from .options import jobs_option, quiet_option
from .progress import Bar
from .rows import note, print_rows, row_options

__all__ = ["evaluate"]


@click.command()
@click.argument("records", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE|FOLDER",
    help="Labels: CSV with document,label and perhaps start_time,end_time (seconds),group; or "
    "JSON lines, or files of ELAN, Praat, WebVTT, SRT or BABEL.",
)
@click.option(
    "--class",
    "classes",
    multiple=True,
    metavar="NAME",
    help="Count only this class; may be repeated.  [default: classes of hits; labelled ones]",
)
@click.option("--all-classes", is_flag=True, help="Count labelled classes without any hit too.")
@click.option(
    "--repeated",
    is_flag=True,
    help="A label may cover several repetitions: further hits on it are right.",
)
@click.option(
    "--labelled-documents",
    is_flag=True,
    help="Leave out records of documents without any label; they count as wrong otherwise.",
)
@click.option(
    "--store",
    type=click.Path(path_type=Path),
    metavar="STORE",
    help="Tells how long documents last, for labels without an end.",
)
@click.option(
    "--templates",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="With --store: adds the separation quotient of hits.",
)
@click.option(
    "--confusion",
    is_flag=True,
    help="Of annotations, print what was taken for what, as jsonl or csv.",
)
@click.option(
    "--baselines",
    is_flag=True,
    help="RECORDS is a store: compare templates with simpler methods on its labelled clips.",
)
@jobs_option
@row_options
@quiet_option
def evaluate(
    records: Path,
    truth: Path,
    classes: tuple[str, ...],
    all_classes: bool,
    repeated: bool,
    labelled_documents: bool,
    store: Path | None,
    templates: Path | None,
    confusion: bool,
    baselines: bool,
    jobs: int,
    row_format: str,
    output: Path,
    quiet: bool,
) -> None:
    """Measure RECORDS, hits or annotations as JSON lines or CSV, against labels.

    Of hits: precision, recall, F1 of all that are given and at several thresholds, average
    precision, recall among the best. Of annotations: the same by time, and what was taken for
    what. docs/evaluation.md says what counts as right.

    \b
    Example:
      mocapidx retrieve takes.store --templates t.h5 --class squat --tau 1 --format jsonl |
        mocapidx evaluate - --truth labels.csv
      mocapidx evaluate takes.store --baselines --truth labels.csv
    """
    from mocapidx.tasks.labels import read_labels

    labels = read_labels(truth)
    if baselines:
        from mocapidx.tasks.compare import COMPARE_COLUMNS, compare_methods

        with Bar("search", quiet) as bar:
            compared = compare_methods(
                records, labels, classes=classes, jobs=jobs, progress=bar.show
            )
        print_rows(compared, row_format, output, COMPARE_COLUMNS)
        return
    from mocapidx.tasks.evaluate import PAIR_COLUMNS, EvaluationOptions, evaluate_records
    from mocapidx.tasks.evaluation_table import evaluation_table
    from mocapidx.tasks.records import save_text

    options = EvaluationOptions(
        classes=classes,
        all_classes=all_classes,
        repeated=repeated,
        labelled_documents=labelled_documents,
        store=store,
        templates=templates,
    )
    found = evaluate_records(records, labels, options)
    for remark in found.remarks:
        note(f"Note: {remark}", quiet)
    if confusion:
        print_rows(found.confusion, row_format, output, PAIR_COLUMNS)
    elif row_format != "table":
        print_rows(found.classes, row_format, output, found.columns)
    elif str(output) == "-":
        for line in evaluation_table(found):
            click.echo(line)
    else:
        save_text(evaluation_table(found), output)
