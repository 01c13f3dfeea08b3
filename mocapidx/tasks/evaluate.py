"""Hold hits and annotations against labels."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError, ParameterError
from mocapidx.evaluation.metrics import (
    TAUS,
    TOPS,
    Counted,
    average_precision,
    class_times,
    counted_below,
    recall_in_top,
    separation_quotient,
)
from mocapidx.evaluation.truth import NOTHING, Judged, Stretch, confusion_seconds, judge_hits
from mocapidx.model import FloatArray
from mocapidx.printable import count, meant, shown
from mocapidx.store.read import open_store
from mocapidx.tasks.found import Found, read_found
from mocapidx.tasks.labels import LabelFile, named_labels
from mocapidx.tasks.records import Record
from mocapidx.tasks.store_words import check_store, store_batches
from mocapidx.templates.file import load_templates
from mocapidx.templates.match import match_documents
from mocapidx.templates.quantise import quantise

__all__ = [
    "NO_LABEL",
    "PAIR_COLUMNS",
    "TIME_COLUMNS",
    "UNKNOWN",
    "Evaluation",
    "EvaluationOptions",
    "evaluate_records",
]

POOLED: Final = "all"
NO_LABEL: Final = "(no label)"
UNKNOWN: Final = "(none)"

HIT_COLUMNS: Final = (
    "class",
    "labels",
    "hits",
    "relevant",
    "precision",
    "recall",
    "f1",
    "average_precision",
    *(f"recall_top_{top}" for top in TOPS),
    "separation",
)
TIME_COLUMNS: Final = (
    "class",
    "labelled_seconds",
    "annotated_seconds",
    "right_seconds",
    "precision",
    "recall",
    "f1",
)
PAIR_COLUMNS: Final = ("label", "annotated_as", "seconds", "share")


@dataclass(frozen=True, slots=True)
class EvaluationOptions:
    """What counts.

    Parameters
    ----------
    classes : tuple of str
        Only these. None: of annotations all that are labelled, of hits those that have hits.
    all_classes : bool
        Count labelled classes without any hit too.
    repeated : bool
        A label may cover several repetitions, so that further hits on it are right.
    labelled_documents : bool
        Leave out what is said of documents without any label.
    store : Path, optional
        Tells how long documents last.
    templates : Path, optional
        With a store: the separation quotient needs the distance functions.
    """

    classes: tuple[str, ...] = ()
    all_classes: bool = False
    repeated: bool = False
    labelled_documents: bool = False
    store: Path | None = None
    templates: Path | None = None


@dataclass(frozen=True, slots=True)
class Evaluation:
    """How hits or annotations agree with the labels.

    Parameters
    ----------
    classes : tuple of mapping
        A record for each class; the last one is for all of them.
    confusion : tuple of mapping
        Of annotations: seconds for each pair of label and annotation, and their share of the
        label's time. Empty for hits.
    columns : tuple of str
        Those of `classes` that a table shows.
    remarks : tuple of str
        What a person should know, a sentence each.
    """

    classes: tuple[Record, ...]
    confusion: tuple[Record, ...]
    columns: tuple[str, ...]
    remarks: tuple[str, ...]


def evaluate_records(
    records: Path, labels: LabelFile, options: EvaluationOptions | None = None
) -> Evaluation:
    """Hold hits or annotations against labels.

    Parameters
    ----------
    records : Path
        JSON lines or CSV of `retrieve`, `query` or `annotate`; ``-`` is the standard input.
        Records with a rank are hits.
    labels : LabelFile
    options : EvaluationOptions, optional

    Returns
    -------
    Evaluation

    Raises
    ------
    FormatError
        If the records can't be read, or are both hits and annotations.
    ParameterError
        If a class was asked for that nothing is said of.
    StoreError
    """
    options = options or EvaluationOptions()
    found = read_found(records)
    kinds = {each.ranked for each in found}
    if len(kinds) > 1:
        raise FormatError(f"{shown(records)}: holds both hits and annotations; give one kind")
    remarks = list(labels.remarks)
    lengths = {} if options.store is None else _lengths(options.store)
    labels = named_labels(labels, {**lengths, **{each.document: 0.0 for each in found}})
    if options.labelled_documents:
        labelled = {label.document for label in labels.labels}
        found = tuple(each for each in found if each.document in labelled)
    truth = [
        Stretch(
            label.document,
            label.label,
            label.start_time or 0.0,
            lengths.get(label.document, math.inf) if label.end_time is None else label.end_time,
        )
        for label in labels.labels
    ]
    if kinds == {False}:
        classes = _chosen(options, truth, found, truth, remarks)
        return _evaluate_annotations(found, truth, classes, lengths, remarks)
    classes = _chosen(options, found, found, truth, remarks)
    medians = _medians(options, classes)
    return _evaluate_hits(found, truth, classes, medians, options.repeated, remarks)


def _chosen(
    options: EvaluationOptions,
    default: Sequence[Found] | Sequence[Stretch],
    found: Sequence[Found],
    truth: Sequence[Stretch],
    remarks: list[str],
) -> list[str]:
    """Return the classes that count, sorted, and remark on what does not."""
    known = {each.label for each in found} | {each.label for each in truth}
    missing = [label for label in options.classes if label not in known]
    if missing:
        raise ParameterError(
            f"neither a record nor a label says '{shown(missing[0])}'{meant(missing[0], known)}"
        )
    if options.classes or options.all_classes:
        return sorted({*options.classes} or known)
    chosen = {each.label for each in default}
    left_out = sorted(({each.label for each in truth}) - chosen)
    if left_out:
        remarks.append(
            f"no hits of {', '.join(map(shown, left_out))}: left out (--all-classes counts them)"
        )
    return sorted(chosen)


def _lengths(store: Path) -> dict[str, float]:
    """Seconds that each document of a store lasts."""
    with open_store(store) as snapshot:
        rate = snapshot.manifest.settings.rate
        return {
            placed.document.name: placed.document.frames / rate for placed in snapshot.documents()
        }


def _medians(options: EvaluationOptions, classes: Iterable[str]) -> dict[str, float]:
    """Median of the distance function of each class over a store."""
    if options.store is None or options.templates is None:
        return {}
    known = load_templates(options.templates)
    medians = {}
    with open_store(options.store) as snapshot:
        check_store(snapshot, known)
        batches = list(store_batches(snapshot))
    for label in classes:
        if label not in known.labels:
            continue
        costs = []
        for batch in batches:
            each = [
                match_documents(
                    quantise(template.matrix, template.delta).without(batch.untrusted),
                    batch.words,
                    batch.bounds,
                ).costs
                for template in known.of(label)
            ]
            costs.append(np.minimum.reduce(each))
        everything = np.concatenate(costs)
        finite = everything[np.isfinite(everything)]
        medians[label] = float(np.median(finite)) if len(finite) else math.inf
    return medians


@dataclass(frozen=True, slots=True, eq=False)
class _Ranking:
    """The hits of one class, best first, and what is right about them."""

    label: str
    costs: FloatArray
    judged: Judged
    separation: float | None


def _evaluate_hits(
    found: Sequence[Found],
    truth: Sequence[Stretch],
    classes: Sequence[str],
    medians: Mapping[str, float],
    repeated: bool,
    remarks: list[str],
) -> Evaluation:
    rankings = []
    for label in classes:
        own = sorted(
            (each for each in found if each.label == label),
            key=lambda each: (each.cost, each.document, each.start, each.end),
        )
        judged = judge_hits(
            [Stretch(each.document, label, each.start, each.end) for each in own],
            [each for each in truth if each.label == label],
            repeated=repeated,
        )
        costs = np.array([each.cost for each in own], dtype=np.float64)
        median = medians.get(label)
        separation = None if median is None else separation_quotient(median, costs, judged)
        rankings.append(_Ranking(label, costs, judged, separation))
    records = [_hit_record(each.label, [each]) for each in rankings]
    return Evaluation((*records, _hit_record(POOLED, rankings)), (), HIT_COLUMNS, tuple(remarks))


def _hit_record(label: str, rankings: Sequence[_Ranking]) -> Record:
    """Lay out one class, or all of them: counts are summed up, averages are over classes."""
    record: dict[str, object] = {"class": label}
    record |= _counts(rankings, math.inf, "")
    precisions = [average_precision(each.judged) for each in rankings]
    known = [value for value in precisions if value is not None]
    record["average_precision"] = _rounded(float(np.mean(known)) if known else None)
    labels = sum(each.judged.labels for each in rankings)
    for top in TOPS:
        found = [(recall_in_top(each.judged, top) or 0.0) * each.judged.labels for each in rankings]
        record[f"recall_top_{top}"] = _rounded(sum(found) / labels if labels else None)
    separations = [each.separation for each in rankings if each.separation is not None]
    record["separation"] = _rounded(float(np.median(separations)) if separations else None)
    for tau in TAUS:
        record |= _counts(rankings, tau, f"_{tau:g}")
    return record


def _counts(rankings: Sequence[_Ranking], tau: float, suffix: str) -> dict[str, object]:
    counted = sum(
        (counted_below(each.costs, each.judged, tau) for each in rankings), Counted(0, 0, 0, 0)
    )
    labels = {} if suffix else {"labels": counted.labels}
    return labels | {
        f"hits{suffix}": counted.hits,
        f"relevant{suffix}": counted.relevant,
        f"precision{suffix}": _rounded(counted.precision),
        f"recall{suffix}": _rounded(counted.recall),
        f"f1{suffix}": _rounded(counted.f1),
    }


def _rounded(value: float | None) -> float | str | None:
    """Six digits; JSON has no infinity, so that becomes a text."""
    if value is None:
        return None
    return round(value, 6) if math.isfinite(value) else "inf"


def _evaluate_annotations(
    found: Sequence[Found],
    truth: Sequence[Stretch],
    classes: Sequence[str],
    lengths: Mapping[str, float],
    remarks: list[str],
) -> Evaluation:
    said = [Stretch(each.document, each.label, each.start, each.end) for each in found]
    open_ends = sorted({each.document for each in truth if math.isinf(each.end)} - {*lengths})
    if open_ends:
        remarks.append(
            f"{count(len(open_ends), 'document')} labelled without an end, such as "
            f"{shown(open_ends[0])}: taken to last as long as the annotation (--store tells how "
            "long documents last)"
        )
    everything = confusion_seconds(said, truth, lengths)
    kept = {pair: time for pair, time in everything.items() if pair[0] in (*classes, NOTHING)}
    records = [
        _time_record(label, times.labelled, times.annotated, times.right)
        for label, times in class_times(kept, classes).items()
    ]
    labelled = sum((time for (label, _), time in kept.items() if label != NOTHING), 0.0)
    annotated = sum((time for (_, one), time in kept.items() if one != NOTHING), 0.0)
    right = sum((time for (label, one), time in kept.items() if label == one != NOTHING), 0.0)
    records.append(_time_record(POOLED, labelled, annotated, right))
    return Evaluation(tuple(records), tuple(_pairs(kept)), TIME_COLUMNS, tuple(remarks))


def _time_record(label: str, labelled: float, annotated: float, right: float) -> Record:
    return {
        "class": label,
        "labelled_seconds": round(labelled, 6),
        "annotated_seconds": round(annotated, 6),
        "right_seconds": round(right, 6),
        "precision": _rounded(right / annotated if annotated else None),
        "recall": _rounded(right / labelled if labelled else None),
        "f1": _rounded(2 * right / (labelled + annotated) if labelled else None),
    }


def _pairs(confusion: Mapping[tuple[str, str], float]) -> Iterable[Record]:
    """Lay out pairs by label, what is annotated most often first."""
    totals: dict[str, float] = {}
    for (label, _), time in confusion.items():
        totals[label] = totals.get(label, 0.0) + time
    ordered = sorted(
        confusion.items(), key=lambda item: (item[0][0] == NOTHING, item[0][0], -item[1], item[0])
    )
    for (label, said), time in ordered:
        yield {
            "label": label or NO_LABEL,
            "annotated_as": said or UNKNOWN,
            "seconds": round(time, 6),
            "share": _rounded(time / totals[label] if totals[label] else None),
        }
