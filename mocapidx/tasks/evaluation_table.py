"""Evaluations laid out for people."""

from collections.abc import Iterable, Sequence

from mocapidx.evaluation.metrics import TAUS
from mocapidx.printable import shown
from mocapidx.tasks.evaluate import NO_LABEL, TIME_COLUMNS, UNKNOWN, Evaluation
from mocapidx.tasks.records import Record, render_records

__all__ = ["evaluation_table"]


def evaluation_table(evaluation: Evaluation) -> Iterable[str]:
    """Lay an evaluation out for people.

    Parameters
    ----------
    evaluation : Evaluation

    Yields
    ------
    str
        Lines of tables: the classes; of hits then how many are right of how many below each
        threshold, and precision and recall of all classes there; of annotations the confusions.
    """
    yield from render_records(evaluation.classes, "table", evaluation.columns)
    if evaluation.columns == TIME_COLUMNS:
        yield ""
        yield "seconds of each label (rows) that are annotated as ... (columns, by their numbers)"
        yield from _confusion_lines(evaluation.confusion)
        pooled = evaluation.classes[-1]
        accuracy = "-" if pooled["recall"] is None else f"{pooled['recall']:.4f}"
        yield ""
        yield f"frame accuracy: {accuracy} of {pooled['labelled_seconds']:.1f} labelled seconds"
        return
    yield ""
    yield "right / all hits below tau"
    shares = [
        {"class": record["class"]}
        | {f"{tau:g}": f"{record[f'relevant_{tau:g}']}/{record[f'hits_{tau:g}']}" for tau in TAUS}
        for record in evaluation.classes
    ]
    yield from render_records(shares, "table", list(shares[0]))
    yield ""
    pooled = evaluation.classes[-1]
    names = ("hits", "relevant", "precision", "recall", "f1")
    sweep = [
        {"tau": f"{tau:g}"} | {name: pooled[f"{name}_{tau:g}"] for name in names} for tau in TAUS
    ]
    yield from render_records(sweep, "table", list(sweep[0]))


def _confusion_lines(pairs: Sequence[Record]) -> Iterable[str]:
    """Lay pairs out as a matrix; columns have the numbers of the rows, for want of room."""
    rows = list(dict.fromkeys(str(pair["label"]) for pair in pairs))
    classes = [row for row in rows if row != NO_LABEL]
    classes += sorted({str(pair["annotated_as"]) for pair in pairs} - {UNKNOWN, *rows})
    numbers = {label: str(number) for number, label in enumerate(classes, start=1)}
    seconds = {(pair["label"], pair["annotated_as"]): f"{pair['seconds']:.1f}" for pair in pairs}
    shown_rows = [*classes, *(row for row in rows if row == NO_LABEL)]
    cells = [
        [numbers.get(row, ""), shown(row)]
        + [seconds.get((row, column), ".") for column in (*classes, UNKNOWN)]
        for row in shown_rows
    ]
    table = [["", "", *numbers.values(), UNKNOWN], *cells]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for line in table:
        words = [line[0].rjust(widths[0]), line[1].ljust(widths[1])]
        words += [cell.rjust(width) for cell, width in zip(line[2:], widths[2:], strict=True)]
        yield "  ".join(words).rstrip()
