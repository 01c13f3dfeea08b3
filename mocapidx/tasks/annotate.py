"""Say which motion class occurs when, in motion files and in stores."""

import itertools
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Final, Literal

import numpy as np

from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.featureset import FeatureSet, parse_feature_set
from mocapidx.model import Hit
from mocapidx.printable import shown
from mocapidx.store.read import Snapshot, open_store
from mocapidx.store.schema import MANIFEST
from mocapidx.tasks.hits import make_hit
from mocapidx.tasks.parallel import MapFunction, mapping
from mocapidx.tasks.prepare import Job, Prepared, Refused, prepare
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.records import HIT_COLUMNS, Record, hit_record
from mocapidx.tasks.segment_sources import untrusted_mask
from mocapidx.tasks.sources import Source, find_sources
from mocapidx.tasks.store_pieces import WordPiece, word_pieces
from mocapidx.tasks.store_words import WordBatch, check_store, cut_at_gaps, store_batches
from mocapidx.tasks.threads import thread_count
from mocapidx.templates.file import load_templates
from mocapidx.templates.match import find_hits, match_several
from mocapidx.templates.path import UNKNOWN_COST, annotate_words, loop_bank
from mocapidx.templates.quantise import quantise
from mocapidx.templates.template import MotionTemplate, TemplateSet
from mocapidx.templates.thresholds import beaten_by_rivals, own_threshold

__all__ = [
    "ANNOTATION_COLUMNS",
    "AnnotateOptions",
    "Annotated",
    "Annotation",
    "annotate_motion",
    "annotation_record",
]

ANNOTATION_COLUMNS: Final = (*(name for name in HIT_COLUMNS if name != "rank"), "repetitions")
"""The keys of an annotation, in their order."""

JOBS_PER_WORKER: Final = 8
"""Starting a worker takes as long as annotating a few files."""


@dataclass(frozen=True, slots=True)
class AnnotateOptions:
    """How motion is annotated.

    Parameters
    ----------
    classes : tuple of str
        Only these; empty: all that the templates have.
    method : {"path", "hits"}
        One path through looping templates, or the places where quantised templates match.
    fill : bool
        Path: give every frame a label, however little it is like any class.
    overlap : {"rivals", "keep"}
        Hits: where classes overlap, drop what another class explains better, or keep all.
    tau : float, optional
        Hits: the threshold of all classes instead of their own.
    skip_bad : bool
        Go on after a file that can't be used.
    read : ReadOptions
        How motion files are understood.
    root : Path, optional
        Names of files are relative to this folder.
    jobs : int
        Worker processes.

    Raises
    ------
    ParameterError
        If an option does not go with the method.
    """

    classes: tuple[str, ...] = ()
    method: Literal["path", "hits"] = "path"
    fill: bool = False
    overlap: Literal["rivals", "keep"] = "rivals"
    tau: float | None = None
    skip_bad: bool = False
    read: ReadOptions = field(default_factory=ReadOptions)
    root: Path | None = None
    jobs: int = 1

    def __post_init__(self) -> None:
        if self.fill and self.method != "path":
            raise ParameterError("--fill (every frame) goes with --method path only")
        if self.tau is not None and self.method != "hits":
            raise ParameterError("--tau (a threshold) goes with --method hits only")
        if self.overlap != "rivals" and self.method != "hits":
            raise ParameterError("--overlap keep goes with --method hits only")


@dataclass(frozen=True, slots=True)
class Annotation:
    """A class goes on in a stretch of a document.

    Parameters
    ----------
    hit : Hit
        Where, and at what cost: surprise in nats a feature, or the cost of a match.
    repetitions : float
        How often the movement was gone through, parts counted as parts.
    """

    hit: Hit
    repetitions: float


@dataclass(frozen=True, slots=True)
class Annotated:
    """The annotations of some documents, and what there is to know about them.

    Parameters
    ----------
    annotations : tuple of Annotation
        By document name, then by start.
    documents, frames : int
        How much was annotated, at the rate of the templates.
    rate : float
        That rate, in Hz.
    refused : tuple of Refused
        Files that could not be used, in the order of their names.
    assumed_rate : tuple of str
        Documents of which nothing says the source rate.
    untold : tuple of str
        Documents that tell too little of any class, always or in gaps.
    """

    annotations: tuple[Annotation, ...]
    documents: int
    frames: int
    rate: float
    refused: tuple[Refused, ...]
    assumed_rate: tuple[str, ...]
    untold: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Work:
    """What a worker needs besides the motion."""

    templates: tuple[MotionTemplate, ...]
    feature_set: FeatureSet
    rate: float
    options: AnnotateOptions


@dataclass(frozen=True, slots=True)
class _Done:
    """What a worker found in a batch."""

    annotations: tuple[Annotation, ...]
    documents: tuple[str, ...]
    frames: int
    assumed_rate: bool
    untold: frozenset[str] = frozenset()


def annotate_motion(
    inputs: Sequence[str | Path],
    templates: str | Path | TemplateSet,
    options: AnnotateOptions | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
    map_fn: MapFunction | None = None,
) -> Annotated:
    """Annotate motion files, folders and stores with the classes of a template file.

    Parameters
    ----------
    inputs : sequence of str or Path
        Motion files, folders that are searched for them, and stores.
    templates : str, Path or TemplateSet
    options : AnnotateOptions, optional
    progress : callable, optional
        Called with the number of documents done and of all.
    map_fn : callable, optional
        Runs the work, with the shape of ``map``; by default ``options.jobs`` processes.

    Returns
    -------
    Annotated

    Raises
    ------
    FormatError
        If a file can't be used and ``skip_bad`` is off.
    ParameterError
        If an input does not exist, two documents have one name, or there is no such class.
    StoreError
        If a store or the template file is damaged, or they are of different feature sets or
        rates.
    """
    options = options or AnnotateOptions()
    known = templates if isinstance(templates, TemplateSet) else load_templates(Path(templates))
    work = _Work(
        _chosen(known, options),
        parse_feature_set(known.feature_set_text, "the templates"),
        known.rate,
        options,
    )
    paths = [Path(given) for given in inputs]
    folders = [path for path in paths if not os.path.lexists(path / MANIFEST)]
    sources = find_sources(folders, options.root)[0] if folders else ()
    with ExitStack() as stack:
        stores = [stack.enter_context(open_store(path)) for path in paths if path not in folders]
        for store in stores:
            check_store(store, known)
        total = _count_documents(sources, stores)
        divided = store_batches if map_fn is None else word_pieces
        items = itertools.chain(sources, *map(divided, stores))
        jobs = min(options.jobs, -(-total // JOBS_PER_WORKER))
        parallel = jobs > 1 and map_fn is None
        apply = stack.enter_context(mapping(jobs) if parallel else nullcontext(map_fn or map))
        return _gathered(
            apply(partial(_annotate, work), items), known.rate, options, total, progress
        )


def annotation_record(annotation: Annotation) -> Record:
    """Lay out an annotation as the record that is printed.

    Parameters
    ----------
    annotation : Annotation

    Returns
    -------
    dict
        The keys of a hit without its rank, then ``repetitions``, rounded to hundredths.
    """
    record = dict(hit_record(annotation.hit, 1))
    del record["rank"]
    return record | {"repetitions": round(annotation.repetitions, 2)}


def _chosen(known: TemplateSet, options: AnnotateOptions) -> tuple[MotionTemplate, ...]:
    """Templates of the chosen classes; hits are found with class templates alone."""
    labels = dict.fromkeys(options.classes) or known.labels
    templates = tuple(template for label in labels for template in known.of(label))
    if options.method == "hits":
        templates = tuple(template for template in templates if template.kind == "class")
    if not templates:
        raise ParameterError("the template file holds no template to annotate with")
    return templates


def _count_documents(sources: Sequence[Source], stores: Sequence[Snapshot]) -> int:
    """Count all documents; no two may have one name."""
    origins = {source.name: source.path for source in sources}
    for store in stores:
        for placed in store.documents():
            name = placed.document.name
            if name in origins:
                raise ParameterError(
                    f"{shown(origins[name])} and {shown(store.path)} both hold a document "
                    f"'{shown(name)}'; annotate them one after the other"
                )
            origins[name] = store.path
    return len(origins)


def _annotate(work: _Work, item: Source | WordBatch | WordPiece) -> _Done | Refused:
    """Annotate a motion file or documents of a store; runs in any process."""
    if isinstance(item, WordBatch):
        return _done(work, item, assumed_rate=False)
    if isinstance(item, WordPiece):
        several = [_done(work, batch, assumed_rate=False) for batch in item.batches()]
        return _Done(
            tuple(found for done in several for found in done.annotations),
            tuple(name for done in several for name in done.documents),
            sum(done.frames for done in several),
            assumed_rate=False,
            untold=frozenset().union(*(done.untold for done in several)),
        )
    job = Job(item, None, work.options.read, work.feature_set, work.rate, poses=False)
    prepared = prepare(job)
    if not isinstance(prepared, Prepared):
        return Refused(item.name, prepared.message if isinstance(prepared, Refused) else "")
    batch = WordBatch(
        (prepared.document,),
        np.zeros(1, dtype=np.int64),
        prepared.words,
        np.array([0, len(prepared.words)]),
        untrusted_mask(prepared.document),
    )
    pieces = [_done(work, piece, prepared.assumed_rate) for piece in cut_at_gaps(batch)]
    annotations = tuple(found for piece in pieces for found in piece.annotations)
    untold = frozenset[str]().union(*(piece.untold for piece in pieces))
    return replace(pieces[0], annotations=annotations, frames=len(batch.words), untold=untold)


def _done(work: _Work, batch: WordBatch, assumed_rate: bool) -> _Done:
    find = _path_annotations if work.options.method == "path" else _hit_annotations
    told = tuple(
        template
        for template in work.templates
        if quantise(template.matrix, template.delta).is_told_without(batch.untrusted)
    )
    return _Done(
        annotations=tuple(find(replace(work, templates=told), batch)) if told else (),
        documents=tuple(
            document.name
            for document, first in zip(batch.documents, batch.starts.tolist(), strict=True)
            if first == 0  # one of several pieces
        ),
        frames=len(batch.words),
        assumed_rate=assumed_rate,
        untold=frozenset() if told else frozenset(each.name for each in batch.documents),
    )


def _path_annotations(work: _Work, batch: WordBatch) -> Iterator[Annotation]:
    bank = loop_bank(
        [template.matrix for template in work.templates],
        [template.label for template in work.templates],
        rate=work.rate,
        trusted=((1 << len(work.feature_set.ids)) - 1) & ~batch.untrusted,
    )
    unknown = None if work.options.fill else UNKNOWN_COST
    spans = itertools.pairwise(batch.bounds.tolist())
    firsts = batch.starts.tolist()
    for document, first, (start, stop) in zip(batch.documents, firsts, spans, strict=True):
        for found in annotate_words(batch.words[start:stop], bank, unknown_cost=unknown):
            span = first + found.start, first + found.end
            hit = make_hit(document, *span, work.rate, found.cost, found.label)
            yield Annotation(hit, found.repetitions)


def _hit_annotations(work: _Work, batch: WordBatch) -> Iterator[Annotation]:
    labels = list(dict.fromkeys(template.label for template in work.templates))
    found: dict[int, list[tuple[int, int, float, float, int]]] = {}
    several = [
        quantise(template.matrix, template.delta).without(batch.untrusted)
        for template in work.templates
    ]
    threads = min(work.options.jobs, thread_count())
    matchings = match_several(several, batch.words, batch.bounds, threads=threads)
    for template, matching in zip(work.templates, matchings, strict=True):
        number = labels.index(template.label)
        rivals = work.options.overlap == "rivals" and len(labels) > 1
        own = own_threshold(template, rivals)
        tau = own if work.options.tau is None else work.options.tau
        hits = find_hits(matching, tau)
        columns = (hits.documents, hits.starts, hits.ends, hits.costs)
        for document, start, end, cost in zip(*(c.tolist() for c in columns), strict=True):
            # A threshold of 0 has no hits, so the ratio is always there.
            found.setdefault(document, []).append((start, end, cost, cost / tau, number))
    for document, rows in found.items():
        starts, ends, _, ratios, classes = (np.array(column) for column in zip(*rows, strict=True))
        beaten = np.zeros(len(rows), dtype=np.bool_)
        if work.options.overlap == "rivals":
            beaten = beaten_by_rivals(starts, ends, ratios, classes)
        for (start, end, cost, _, number), lost in zip(rows, beaten.tolist(), strict=True):
            if not lost:
                record, first = batch.documents[document], int(batch.starts[document])
                span = first + start, first + end
                hit = make_hit(record, *span, work.rate, cost, labels[number])
                yield Annotation(hit, 1.0)


def _gathered(
    outcomes: Iterable[_Done | Refused],
    rate: float,
    options: AnnotateOptions,
    total: int,
    progress: Callable[[int, int], None] | None,
) -> Annotated:
    annotations: list[Annotation] = []
    refused: list[Refused] = []
    assumed_rate: list[str] = []
    untold: set[str] = set()
    documents = frames = 0
    for outcome in outcomes:
        if isinstance(outcome, Refused):
            if not options.skip_bad:
                raise FormatError(f"{outcome.message} (--skip-bad passes over such files)")
            refused.append(outcome)
        else:
            annotations.extend(outcome.annotations)
            documents += len(outcome.documents)
            frames += outcome.frames
            untold |= outcome.untold
            if outcome.assumed_rate:
                assumed_rate.extend(outcome.documents)
        if progress is not None:
            progress(documents + len(refused), total)
    annotations.sort(
        key=lambda a: (a.hit.document, a.hit.start_frame, a.hit.end_frame, a.hit.label)
    )
    return Annotated(
        tuple(annotations),
        documents,
        frames,
        rate,
        tuple(refused),
        tuple(assumed_rate),
        tuple(sorted(untold)),
    )
