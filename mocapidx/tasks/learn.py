"""Learn a motion template for each class from labelled documents of a store."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from mocapidx.alignment.dtw import LONGEST_SEQUENCE
from mocapidx.errors import FormatError, ParameterError
from mocapidx.printable import meant, shown
from mocapidx.store.read import Snapshot, open_store
from mocapidx.tasks.labels import Example, LabelFile, labels_from_names, place_labels, read_labels
from mocapidx.tasks.parallel import MapFunction, mapping
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.tasks.store_words import check_store, document_words, store_batches
from mocapidx.tasks.unspecified import untrusted_between
from mocapidx.templates.classes import ClassMotion, LearnedClass, learn_class
from mocapidx.templates.file import save_templates
from mocapidx.templates.learn import SHORTEST_EXAMPLE
from mocapidx.templates.template import DELTA, TAU, TemplateSet
from mocapidx.templates.thresholds import POOR_SEPARATION, Clip

__all__ = [
    "LearnOptions",
    "LearnedClass",
    "Learning",
    "find_labels",
    "learn_classes",
    "save_learning",
]

BACKGROUND_SECONDS: Final = 10.0
"""Length of the pieces that unlabelled motion is cut into."""


@dataclass(frozen=True, slots=True)
class LearnOptions:
    """How templates are learned.

    Parameters
    ----------
    classes : tuple of str
        Only these; empty: every label.
    repetitions : {"none", "auto"}
        Each label covers one repetition, or an unknown number of them.
    delta : float
        Entries below it count as 0, above ``1 - delta`` as 1, when the template is matched.
    background : Path, optional
        A store of unlabelled motion, for the thresholds.
    jobs : int
        Worker processes.

    Raises
    ------
    ParameterError
        If `delta` is out of range.
    """

    classes: tuple[str, ...] = ()
    repetitions: Literal["none", "auto"] = "none"
    delta: float = DELTA
    background: Path | None = None
    jobs: int = 1

    def __post_init__(self) -> None:
        if not 0.0 < self.delta < 0.5:
            raise ParameterError(f"delta must lie between 0 and 0.5, got {self.delta}")


@dataclass(frozen=True, slots=True)
class Learning:
    """Templates, and what a person should know about them.

    Parameters
    ----------
    templates : TemplateSet
    classes : tuple of LearnedClass
        In the order of the templates.
    remarks : tuple of str
        A sentence each.
    """

    templates: TemplateSet
    classes: tuple[LearnedClass, ...]
    remarks: tuple[str, ...]


def find_labels(
    store: Path, labels: Path | None = None, labels_from: str | None = None
) -> LabelFile:
    """Read labels from a file, or take them from the names of a store's documents.

    Parameters
    ----------
    store : Path
    labels : Path, optional
        A labels file, as `mocapidx.tasks.labels.read_labels` reads it.
    labels_from : str, optional
        A rule, as `mocapidx.tasks.labels.labels_from_names` takes it.

    Returns
    -------
    LabelFile

    Raises
    ------
    ParameterError
        Unless exactly one of the two is given.
    FormatError
        If a row of the file is wrong.
    """
    if (labels is None) == (labels_from is None):
        either = "either --labels FILE.csv or --labels-from folder"
        raise ParameterError(f"give {either}" + (", not both" if labels is not None else ""))
    if labels is not None:
        return read_labels(labels)
    with open_store(store) as snapshot:
        names = [placed.document.name for placed in snapshot.documents()]
    return labels_from_names(sorted(names), str(labels_from))


def learn_classes(
    store: Path,
    labels: LabelFile,
    options: LearnOptions | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
    report: Callable[[LearnedClass], None] | None = None,
    map_fn: MapFunction | None = None,
) -> Learning:
    """Learn a template for each label.

    Parameters
    ----------
    store : Path
        Holds the labelled documents.
    labels : LabelFile
    options : LearnOptions, optional
    progress : callable, optional
        Called with the number of classes done and of all.
    report : callable, optional
        Called with each class as soon as it is learned, in the order of the result.
    map_fn : callable, optional
        Runs the work, with the shape of ``map``; by default ``options.jobs`` processes.

    Returns
    -------
    Learning
        Equal inputs give equal templates, whatever runs the work.

    Raises
    ------
    FormatError
        If a label means no document or no frames of one, or too few or too many.
    ParameterError
        If a class was asked for that has no label.
    StoreError
        If a store is damaged, or the background store is of another feature set or rate.
    """
    options = options or LearnOptions()
    with open_store(store) as snapshot:
        settings = snapshot.manifest.settings
        jobs = _jobs(snapshot, labels, options)
    done = []
    jobs_at_once = min(options.jobs, len(jobs))
    parallel = jobs_at_once > 1 and map_fn is None
    with mapping(jobs_at_once) if parallel else nullcontext(map_fn or map) as apply:
        for outcome in apply(learn_class, jobs):
            done.append(outcome)
            if report is not None:
                report(outcome)
            if progress is not None:
                progress(len(done), len(jobs))
    templates = TemplateSet(
        tuple(template for found in done for template in found.templates),
        settings.feature_set_name,
        settings.feature_set_digest,
        settings.feature_set_text,
        settings.rate,
    )
    return Learning(templates, tuple(done), (*labels.remarks, *_remarks(done)))


def save_learning(learning: Learning, path: Path) -> None:
    """Write the templates to a file that is whole, or as it was before.

    Raises
    ------
    WriteError
        If it could not be written.
    """
    save_templates(path, learning.templates)


def _jobs(snapshot: Snapshot, labels: LabelFile, options: LearnOptions) -> list[ClassMotion]:
    settings = snapshot.manifest.settings
    documents = snapshot.documents()
    examples = place_labels(
        labels.labels, [placed.document for placed in documents], settings.rate, SHORTEST_EXAMPLE
    )
    # By name and time, so that neither the order of the rows nor that of the store counts.
    examples.sort(key=lambda example: (example.label.document, example.start))
    classes = sorted({example.label.label for example in examples})
    missing = [label for label in options.classes if label not in classes]
    if missing:
        raise ParameterError(
            f"the class '{shown(missing[0])}' has no example among the labels; "
            f"there are: {', '.join(map(shown, classes))}{meant(missing[0], classes)}"
        )
    if options.repetitions == "none":
        _check_lengths(examples, settings.rate)
    wanted = sorted({example.document for example in examples})
    words = document_words(snapshot, (documents[number] for number in wanted))
    by_document = dict(zip(wanted, words, strict=True))
    clips = [
        Clip(
            by_document[example.document][example.start : example.end],
            untrusted_between(documents[example.document].document, example.start, example.end),
        )
        for example in examples
    ]
    features = len(store_feature_set(snapshot).ids)
    background: tuple[Clip, ...] = ()
    if options.background is not None:
        labelled = {example.label.document for example in examples}
        background = tuple(_background(options.background, snapshot, labelled))
    jobs = []
    for label in dict.fromkeys(options.classes) or classes:
        own = [n for n, example in enumerate(examples) if example.label.label == label]
        jobs.append(
            ClassMotion(
                label=label,
                examples=tuple(clips[n] for n in own),
                names=tuple(_example_name(examples[n]) for n in own),
                groups=tuple(examples[n].label.group or examples[n].label.document for n in own),
                others=tuple(clip for n, clip in enumerate(clips) if n not in set(own)),
                background=background,
                features=features,
                feature_set_digest=settings.feature_set_digest,
                rate=settings.rate,
                repetitions=options.repetitions,
                delta=options.delta,
                places=tuple(examples[n].label.where for n in own),
            )
        )
    return jobs


def _check_lengths(examples: Iterable[Example], rate: float) -> None:
    for example in examples:
        if example.end - example.start > LONGEST_SEQUENCE:
            raise FormatError(
                f"{example.label.where}: '{shown(example.label.label)}' lasts "
                f"{(example.end - example.start) / rate:.0f} s, one repetition at most "
                f"{LONGEST_SEQUENCE / rate:.0f} s; for labels of many use --repetitions auto"
            )


def _example_name(example: Example) -> str:
    label = example.label
    if label.start_time is None and label.end_time is None:
        return label.document
    end = "" if label.end_time is None else f"{label.end_time:g}"
    return f"{label.document}@{label.start_time or 0.0:g}:{end}"


def _background(path: Path, labelled: Snapshot, documents: Iterable[str]) -> Iterator[Clip]:
    """Cut the motion of a background store into pieces of the length of usual clips."""
    settings = labelled.manifest.settings
    with open_store(path) as snapshot:
        own = TemplateSet(
            (),
            settings.feature_set_name,
            settings.feature_set_digest,
            settings.feature_set_text,
            settings.rate,
        )
        check_store(snapshot, own)
        left_out = set(documents) if path.samefile(labelled.path) else set()
        length = round(BACKGROUND_SECONDS * settings.rate)
        for batch in store_batches(snapshot):
            spans = itertools.pairwise(batch.bounds.tolist())
            for document, (start, stop) in zip(batch.documents, spans, strict=True):
                if document.name not in left_out:
                    for place in range(start, stop, length):
                        words = batch.words[place : min(place + length, stop)]
                        yield Clip(words, batch.untrusted)


def _remarks(classes: Iterable[LearnedClass]) -> Iterator[str]:
    for found in classes:
        label, threshold = shown(found.template.label), found.threshold
        if threshold.tau is None:
            what = "one example" if threshold.positive_cost is None else "nothing else"
            yield (
                f"{label}: no basis for a threshold of its own ({what} to compare with), "
                f"{TAU} is used; add examples, other classes or --background"
            )
        elif (threshold.separation or 0.0) >= POOR_SEPARATION:
            yield (
                f"{label}: not well separated from the rest (its own motion costs "
                f"{threshold.positive_cost:.3f}, other motion {threshold.background_cost:.3f}); "
                "add people or examples"
            )
