"""Draw templates, distance functions and annotations into files."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.alignment.subsequence import Steps
from mocapidx.durable import durable_replace
from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.featureset import FeatureSet
from mocapidx.features.gaps import Unspecified
from mocapidx.model import WordArray
from mocapidx.printable import meant, shown
from mocapidx.reports.confusion import confusion_picture
from mocapidx.reports.matrices import template_picture
from mocapidx.reports.style import picture_format
from mocapidx.reports.timelines import Curve, Span, Track, annotation_picture, distance_picture
from mocapidx.store.read import open_store
from mocapidx.store.schema import MANIFEST
from mocapidx.tasks.evaluate import NO_LABEL, UNKNOWN, EvaluationOptions, evaluate_records
from mocapidx.tasks.found import read_found
from mocapidx.tasks.labels import named_labels, read_labels
from mocapidx.tasks.prepare import Job, Prepared, Refused, prepare
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.segment_sources import untrusted_mask
from mocapidx.tasks.sources import find_sources
from mocapidx.tasks.store_words import check_store, document_words
from mocapidx.tasks.template import template_features
from mocapidx.tasks.template_records import template_facts
from mocapidx.tasks.unspecified import specified_pieces
from mocapidx.templates.file import load_templates
from mocapidx.templates.match import find_hits, match_documents
from mocapidx.templates.quantise import quantise
from mocapidx.templates.template import MotionTemplate, TemplateSet

__all__ = ["draw_annotations", "draw_confusion", "draw_distances", "draw_templates"]

MOST_DOCUMENTS: Final = 100
MOST_CLASSES: Final = 40


@dataclass(frozen=True, slots=True, eq=False)
class _Document:
    """The feature words of one document, and where it can't tell which features."""

    name: str
    words: WordArray
    untrusted: int
    pieces: Unspecified


def draw_templates(
    templates: Sequence[MotionTemplate], feature_set: FeatureSet, picture: Path
) -> list[Path]:
    """Draw the templates of one class.

    Parameters
    ----------
    templates : sequence of MotionTemplate
    feature_set : FeatureSet
        Theirs.
    picture : Path
        A .png or .svg file; of several templates the second gets ``-2`` behind its stem, and
        so on.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    ParameterError, WriteError
    """
    suffix = picture_format(picture)
    paths = []
    for number, template in enumerate(templates, start=1):
        path = picture if number == 1 else picture.with_stem(f"{picture.stem}-{number}")
        data = template_picture(
            template.matrix,
            template.delta,
            [f"{feature.id} {feature.name}" for feature in feature_set.features],
            [feature.part for feature in feature_set.features],
            template.rate,
            title=template.label,
            subtitle=_summary(template),
            keyframes=template.keyframes,
            suffix=suffix,
        )
        durable_replace(path, data)
        paths.append(path)
    return paths


def _summary(template: MotionTemplate) -> str:
    facts = template_facts(template)
    parts = [f"{facts['frames']} frames", f"{facts['decided']:.0%} decided"]
    if template.documents:
        examples = len(template.documents)
        parts.append(f"{examples} example{'s' * (examples > 1)}")
    if template.kind == "stretch":
        parts.append("one stretch of repetitions")
    if template.tau is not None:
        parts.append(f"threshold {template.tau:.3f}")
    return ", ".join(parts)


def draw_distances(
    motion: Path,
    templates: Path | TemplateSet,
    picture: Path,
    *,
    classes: Sequence[str] = (),
    documents: Sequence[str] = (),
    labels: Path | None = None,
    tau: float | None = None,
    steps: Steps = "weighted",
    read: ReadOptions | None = None,
) -> None:
    """Draw the distance functions of some classes over motion, a panel each.

    Parameters
    ----------
    motion : Path
        A motion file or a store.
    templates : Path or TemplateSet
    picture : Path
        A .png or .svg file.
    classes : sequence of str
        In this order; none: all.
    documents : sequence of str
        Of the store, end to end in this order; none: the only one.
    labels : Path, optional
        A labels file, drawn above the panels.
    tau : float, optional
        Threshold of all classes instead of their own.
    steps : {"weighted", "printed"}
    read : ReadOptions, optional
        How a motion file is understood.

    Raises
    ------
    FormatError, ParameterError, StoreError, WriteError
    """
    suffix = picture_format(picture)
    known = load_templates(templates) if isinstance(templates, Path) else templates
    chosen = _class_templates(known, classes)
    if (motion / MANIFEST).exists():
        taken = _from_store(motion, known, documents)
    else:
        taken = _from_file(motion, known, read or ReadOptions())
    offsets = np.concatenate(([0], np.cumsum([len(each.words) for each in taken]))) / known.rate
    curves = [_curve(template, taken, offsets.tolist(), tau, steps) for template in chosen]
    truth = [] if labels is None else _truth(labels, taken, offsets.tolist())
    data = distance_picture(
        curves,
        known.rate,
        title=taken[0].name if len(taken) == 1 else f"{len(taken)} documents end to end",
        borders=offsets[1:-1].tolist(),
        truth=truth,
        suffix=suffix,
    )
    durable_replace(picture, data)


def _class_templates(known: TemplateSet, classes: Sequence[str]) -> list[MotionTemplate]:
    """Return the templates to match: those that stand for whole classes, where there are any."""
    found = [each for label in (classes or known.labels) for each in known.of(label)]
    chosen = [each for each in found if each.kind == "class"] or found
    if len(chosen) > MOST_CLASSES:
        raise ParameterError(
            f"{len(chosen)} classes are too many for one picture, at most {MOST_CLASSES}; "
            "choose with --class"
        )
    return chosen


def _from_store(path: Path, known: TemplateSet, names: Sequence[str]) -> list[_Document]:
    with open_store(path) as store:
        check_store(store, known)
        places = {placed.document.name: placed for placed in store.documents()}
        if not names and len(places) != 1:
            raise ParameterError(
                f"{shown(path)} holds {len(places)} documents; choose with --document"
            )
        missing = [name for name in names if name not in places]
        if missing:
            raise ParameterError(
                f"{shown(path)}: no document '{shown(missing[0])}'{meant(missing[0], places)}"
            )
        return [
            _Document(
                name,
                document_words(store, [places[name]])[0],
                untrusted_mask(places[name].document),
                specified_pieces(places[name].document),
            )
            for name in names or places
        ]


def _from_file(path: Path, known: TemplateSet, options: ReadOptions) -> list[_Document]:
    sources, _ = find_sources([path])
    if len(sources) != 1 or path.is_dir():
        raise ParameterError(f"{shown(path)}: give a motion file or a store")
    job = Job(sources[0], None, options, template_features(known), known.rate, poses=False)
    prepared = prepare(job)
    if not isinstance(prepared, Prepared):
        message = prepared.message if isinstance(prepared, Refused) else f"{shown(path)}: not read"
        raise FormatError(message)
    record = prepared.document
    pieces = specified_pieces(record)
    return [_Document(record.name, prepared.words, untrusted_mask(record), pieces)]


def _curve(
    template: MotionTemplate,
    documents: Sequence[_Document],
    offsets: Sequence[float],
    tau: float | None,
    steps: Steps,
) -> Curve:
    threshold = template.threshold if tau is None else tau
    quantised = quantise(template.matrix, template.delta)
    costs, hits = [], []
    for document, offset in zip(documents, offsets, strict=False):
        for first, stop, unspecified in document.pieces:
            words = document.words[first:stop]
            trusted = quantised.without(document.untrusted | unspecified)
            matching = match_documents(trusted, words, np.array([0, len(words)]), steps)
            found = find_hits(matching, threshold)
            costs.append(matching.costs)
            start = offset + first / template.rate
            hits += [
                Span(start + begin / template.rate, start + end / template.rate, template.label)
                for begin, end in zip(found.starts.tolist(), found.ends.tolist(), strict=True)
            ]
    return Curve(template.label, np.concatenate(costs), threshold, tuple(hits))


def _truth(path: Path, documents: Sequence[_Document], offsets: Sequence[float]) -> list[Span]:
    """Labels of the documents, moved to where the documents are drawn."""
    labels = named_labels(read_labels(path), (document.name for document in documents)).labels
    spans = []
    for document, start, end in zip(documents, offsets[:-1], offsets[1:], strict=True):
        for label in labels:
            if label.document == document.name:
                stop = end if label.end_time is None else min(start + label.end_time, end)
                spans.append(Span(start + (label.start_time or 0.0), stop, label.label))
    return [span for span in spans if span.start < span.end]


def draw_annotations(
    records: Path,
    picture: Path,
    *,
    labels: Path | None = None,
    documents: Sequence[str] = (),
) -> None:
    """Draw annotations, or hits, as a timeline for each document.

    Parameters
    ----------
    records : Path
        JSON lines or CSV that `annotate` or `retrieve` printed; ``-`` is the standard input.
    picture : Path
        A .png or .svg file.
    labels : Path, optional
        A labels file, drawn above each annotation.
    documents : sequence of str
        Only these, in this order; none: all that are annotated or labelled.

    Raises
    ------
    FormatError, ParameterError, WriteError
    """
    suffix = picture_format(picture)
    found = read_found(records)
    spans: dict[str, list[Span]] = {}
    for each in found:
        spans.setdefault(each.document, []).append(Span(each.start, each.end, each.label))
    ends = {name: max(span.end for span in own) for name, own in spans.items()}
    truth = {} if labels is None else _labels_by_document(labels, ends)
    names = list(documents) or sorted({*spans, *truth})
    _check_names(names, {*spans, *truth})
    tracks = [Track(name, tuple(spans.get(name, ())), tuple(truth.get(name, ()))) for name in names]
    title = "hits" if any(each.ranked for each in found) else "annotation"
    durable_replace(picture, annotation_picture(tracks, title=title, suffix=suffix))


def _labels_by_document(path: Path, ends: dict[str, float]) -> dict[str, list[Span]]:
    """Labels as spans; one without an end goes as far as the annotation of its document."""
    spans: dict[str, list[Span]] = {}
    for label in named_labels(read_labels(path), ends).labels:
        start = label.start_time or 0.0
        end = ends.get(label.document, 0.0) if label.end_time is None else label.end_time
        if start < end:
            spans.setdefault(label.document, []).append(Span(start, end, label.label))
    return spans


def _check_names(names: Sequence[str], known: Iterable[str]) -> None:
    missing = [name for name in names if name not in {*known}]
    if missing:
        near = meant(missing[0], [*known])
        raise ParameterError(f"nothing is said of a document '{shown(missing[0])}'{near}")
    if not names:
        raise ParameterError("there is nothing to draw: no records and no labels")
    if len(names) > MOST_DOCUMENTS:
        raise ParameterError(
            f"{len(names)} documents are too many for one picture, at most {MOST_DOCUMENTS}; "
            "choose with --document"
        )


def draw_confusion(
    records: Path,
    labels: Path,
    picture: Path,
    *,
    classes: Sequence[str] = (),
    labelled_documents: bool = False,
) -> None:
    """Draw how the time of each labelled class was annotated.

    Parameters
    ----------
    records : Path
        JSON lines or CSV that `annotate` printed; ``-`` is the standard input.
    labels : Path
        A labels file.
    picture : Path
        A .png or .svg file.
    classes : sequence of str
        Only these; none: all.
    labelled_documents : bool
        Leave out what is said of documents without any label.

    Raises
    ------
    FormatError, ParameterError, WriteError
    """
    suffix = picture_format(picture)
    options = EvaluationOptions(classes=tuple(classes), labelled_documents=labelled_documents)
    found = evaluate_records(records, read_labels(labels), options)
    if not found.confusion:
        raise ParameterError(
            f"{shown(records)}: hits have no confusion table; give what 'annotate' printed"
        )
    seconds = {
        (str(row["label"]), str(row["annotated_as"])): float(str(row["seconds"]))
        for row in found.confusion
    }
    truth = sorted({label for label, _ in seconds}, key=_class_order)
    said = sorted({said for _, said in seconds}, key=_class_order)
    data = confusion_picture(seconds, truth, said, title="labels and annotations", suffix=suffix)
    durable_replace(picture, data)


def _class_order(label: str) -> tuple[bool, str]:
    """Sort by name, what is no class last."""
    return (label in (NO_LABEL, UNKNOWN), label)
