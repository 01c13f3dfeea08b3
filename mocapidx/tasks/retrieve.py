"""Find every occurrence of a motion class in a store, best first."""

import itertools
import math
import re
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

import numpy as np

from mocapidx.alignment.subsequence import CostArray, Steps
from mocapidx.durable import durable_replace
from mocapidx.errors import ParameterError
from mocapidx.model import FloatArray, Hit, HitList, IndexArray
from mocapidx.printable import count, shown
from mocapidx.store.read import open_store
from mocapidx.tasks.hits import make_hit
from mocapidx.tasks.preselection import Preselection, preselected, preselection_remarks
from mocapidx.tasks.records import render_records
from mocapidx.tasks.store_pieces import WordPiece, word_pieces
from mocapidx.tasks.store_words import WordBatch, check_store, store_batches
from mocapidx.tasks.threads import map_ahead
from mocapidx.templates.file import load_templates
from mocapidx.templates.keyframes import TOLERANCE, Keyframes, choose_keyframes
from mocapidx.templates.match import (
    SHARED,
    Hits,
    Matching,
    find_hits,
    match_documents,
    merge_hits,
)
from mocapidx.templates.quantise import Quantised, quantise
from mocapidx.templates.template import TAU, MotionTemplate, TemplateSet
from mocapidx.templates.thresholds import beaten_by_rivals, own_threshold

if TYPE_CHECKING:
    from mocapidx.tasks.parallel import MapFunction

__all__ = ["KeyframeChoice", "RetrieveOptions", "Retrieved", "parse_keyframes", "retrieve"]

KeyframeChoice: TypeAlias = Literal["none", "auto"] | tuple[int, ...]

Curve: TypeAlias = tuple[str, int, CostArray]
"""Document, first frame and lowest costs of a piece."""

NONE: Final = np.zeros(0, np.int64)
NO_HITS: Final = Hits(NONE, NONE, NONE, np.zeros(0, np.float32))

PROFILE_COLUMNS: Final = ("document", "frame", "time", "cost")


@dataclass(frozen=True, slots=True)
class RetrieveOptions:
    """How occurrences of a class are found.

    Parameters
    ----------
    tau : float, optional
        The threshold; default the class's own, else 0.06. Given, there are no rivals.
    delta : float, optional
        For quantising; default the template's.
    top : int, optional
        Keep the best only.
    steps : {"weighted", "printed"}
        Whether a match pays for the rows of the template that it passes over. With printed
        steps, as in the paper, the ends of documents are not padded either.
    rivals : bool
        Drop a hit that another class of the same file explains better.
    keyframes : {"none", "auto"} or tuple of int
        Match everything; or only where keyframes follow one another: the template's own or, where
        it has none, rows chosen by rule; or these rows, from 0. That can lose hits.
    keyframe_tolerance : int, optional
        Entries of a keyframe that may disagree; default the template's, else 3.
    min_overlap : float
        Two hits are one, and the better one stays, if they share more than this part of the
        shorter one; from 0 (no two hits overlap) up to, not including, 1.

    Raises
    ------
    ParameterError
        If a value is out of its range.
    """

    tau: float | None = None
    delta: float | None = None
    top: int | None = None
    steps: Steps = "weighted"
    rivals: bool = True
    keyframes: KeyframeChoice = "none"
    keyframe_tolerance: int | None = None
    min_overlap: float = SHARED

    def __post_init__(self) -> None:
        if self.tau is not None and not (math.isfinite(self.tau) and self.tau > 0):
            raise ParameterError(f"tau must be above 0, got {self.tau}")
        if self.top is not None and self.top < 1:
            raise ParameterError(f"top must be at least 1, got {self.top}")
        if self.keyframe_tolerance is not None and self.keyframe_tolerance < 0:
            raise ParameterError(f"tolerance must be 0 or more, got {self.keyframe_tolerance}")
        if not 0 <= self.min_overlap < 1:
            raise ParameterError(f"the overlap must be from 0 to below 1, got {self.min_overlap}")


@dataclass(frozen=True, slots=True)
class Retrieved:
    """Occurrences of a class.

    Parameters
    ----------
    hits : tuple of Hit
        By cost, then document name, then start.
    remarks : tuple of str
        What a person should know about the answer, a sentence each.
    """

    hits: tuple[Hit, ...]
    remarks: tuple[str, ...]

    def _repr_html_(self) -> str:
        return HitList(self.hits)._repr_html_()


def parse_keyframes(text: str) -> KeyframeChoice:
    """Understand ``none``, ``auto`` or columns of a template such as ``8,44``.

    Raises
    ------
    ParameterError
        If the text is none of these.
    """
    if text in ("none", "auto"):
        return "none" if text == "none" else "auto"
    if not re.fullmatch(r"[0-9]{1,6}(,[0-9]{1,6})*", text, re.ASCII):
        raise ParameterError(
            f"--keyframes {shown(text)}: expected none, auto or columns such as 8,44"
        )
    return tuple(sorted({int(column) for column in text.split(",")}))


def retrieve(
    store: Path,
    templates: Path | TemplateSet,
    label: str,
    options: RetrieveOptions | None = None,
    *,
    profile: Path | None = None,
    map_fn: "MapFunction | None" = None,
) -> Retrieved:
    """Find every occurrence of a motion class in a store.

    Parameters
    ----------
    store : Path
    templates : Path or TemplateSet
    label : str
        The class.
    options : RetrieveOptions, optional
    profile : Path, optional
        Write the distance function of every document to this file: CSV with the columns
        document, frame, time (seconds) and cost, empty where no match can end.
    map_fn : callable, optional
        Runs the work, with the shape of ``map``; by default a few threads.

    Returns
    -------
    Retrieved

    Raises
    ------
    ParameterError
        If there is no such class.
    StoreError
        If the store or the template file is damaged, or they are of different feature sets or
        rates.
    WriteError
        If the profile could not be written.
    """
    options = options or RetrieveOptions()
    known = load_templates(templates) if isinstance(templates, Path) else templates
    own = _class_templates(known, label)
    rivals: tuple[MotionTemplate, ...] = ()
    if options.rivals and options.tau is None:
        others = (other for other in known.labels if other != label)
        rivals = tuple(t for other in others for t in known.of(other) if t.kind == "class")
    options = replace(options, rivals=bool(rivals))
    found: list[Hit] = []
    curves: list[Curve] = []
    remarks = list(_remarks(own, label, options))
    with open_store(store) as snapshot:
        check_store(snapshot, known)
        preselection = None if options.keyframes == "none" else _preselection(own, options)
        search = partial(
            _search, own, rivals, options, preselection, known.rate, label, profile is not None
        )
        frames, seconds = np.zeros(2, np.int64), np.zeros(2)
        untold: set[str] = set()
        if map_fn is None:
            outcomes: Iterable[_Outcome] = map_ahead(search, store_batches(snapshot))
        else:
            several = map_fn(partial(_search_piece, search), word_pieces(snapshot))
            outcomes = itertools.chain.from_iterable(several)
        for outcome in outcomes:
            found += outcome.hits
            curves += outcome.curves
            untold |= outcome.untold
            frames, seconds = frames + outcome.frames, seconds + outcome.seconds
        if preselection is not None:
            remarks += preselection_remarks(preselection.keyframes, frames, seconds)
    if untold:
        places = count(len(untold), "document")
        remarks.append(
            f"in {places}, such as {shown(min(untold))}, too little of what '{shown(label)}' asks "
            "for can be told, always or in gaps: no hits there"
        )
    found.sort(key=lambda hit: (hit.cost, hit.document, hit.start_frame))
    if profile is not None:
        durable_replace(profile, _profile_chunks(curves, known.rate))
    return Retrieved(HitList(found[: options.top]), tuple(remarks))


@dataclass(frozen=True, slots=True)
class _Outcome:
    """What came of a batch.

    The hits, the distance functions if they are wanted; the frames before and after the
    preselection, and the seconds of preselecting and of matching; documents of which nothing
    can be said.
    """

    hits: Sequence[Hit]
    curves: Sequence[Curve]
    frames: IndexArray
    seconds: FloatArray
    untold: frozenset[str]


def _search(
    own: Sequence[MotionTemplate],
    rivals: Sequence[MotionTemplate],
    options: RetrieveOptions,
    preselection: Preselection | None,
    rate: float,
    label: str,
    profiled: bool,
    batch: WordBatch,
) -> _Outcome:
    """Find the hits in a batch; runs in any thread or process."""
    times = [time.perf_counter()]
    left = batch if preselection is None else preselected(preselection, batch)
    times.append(time.perf_counter())
    hits = NO_HITS
    curves: Sequence[Curve] = ()
    mask = batch.untrusted
    told = any(quantise(t.matrix, _delta(t, options)).is_told_without(mask) for t in own)
    if left.documents and (told or profiled):
        matchings = [_match(template, left, options) for template in own]
        if told:
            hits = _hits(own, matchings, options, top=None if rivals else options.top)
        if rivals and len(hits.costs):
            hits = _unbeaten(hits, own, rivals, left, options)
        curves = tuple(_curves(left, matchings)) if profiled else ()
    times.append(time.perf_counter())
    frames = np.array([len(batch.words), len(left.words)])
    described = tuple(_described(hits, left, rate, label))
    untold = frozenset[str]() if told else frozenset(each.name for each in batch.documents)
    return _Outcome(described, curves, frames, np.diff(times), untold)


def _search_piece(search: Callable[[WordBatch], _Outcome], piece: WordPiece) -> list[_Outcome]:
    return [search(batch) for batch in piece.batches()]


def _preselection(own: Sequence[MotionTemplate], options: RetrieveOptions) -> Preselection:
    if len(own) > 1:
        raise ParameterError(f"'{shown(own[0].label)}' has several templates; use no keyframes")
    quantised = quantise(own[0].matrix, _delta(own[0], options))
    keyframes = _keyframes(own[0], quantised, options)
    return Preselection(quantised, keyframes, options.steps == "weighted")


def _keyframes(
    template: MotionTemplate, quantised: Quantised, options: RetrieveOptions
) -> Keyframes:
    tolerance = options.keyframe_tolerance
    if isinstance(options.keyframes, tuple):
        return Keyframes(options.keyframes, TOLERANCE if tolerance is None else tolerance)
    if not template.keyframes:
        return choose_keyframes(quantised, tolerance=TOLERANCE if tolerance is None else tolerance)
    return Keyframes(
        template.keyframes, template.keyframe_tolerance if tolerance is None else tolerance
    )


def _class_templates(known: TemplateSet, label: str) -> tuple[MotionTemplate, ...]:
    own = tuple(template for template in known.of(label) if template.kind == "class")
    if not own:
        raise ParameterError(f"'{shown(label)}' has templates of stretches only, none of the class")
    return own


def _match(template: MotionTemplate, batch: WordBatch, options: RetrieveOptions) -> Matching:
    quantised = quantise(template.matrix, _delta(template, options)).without(batch.untrusted)
    # The paper's own matching knows no padding.
    padded = batch.at_ends if options.steps == "weighted" else False
    return match_documents(quantised, batch.words, batch.bounds, options.steps, padded)


def _delta(template: MotionTemplate, options: RetrieveOptions) -> float:
    return template.delta if options.delta is None else options.delta


def _threshold(template: MotionTemplate, options: RetrieveOptions) -> float:
    return own_threshold(template, options.rivals) if options.tau is None else options.tau


def _hits(
    templates: Sequence[MotionTemplate],
    matchings: Sequence[Matching],
    options: RetrieveOptions,
    top: int | None = None,
) -> Hits:
    several = [
        find_hits(matching, _threshold(template, options), top=top, shared=options.min_overlap)
        for template, matching in zip(templates, matchings, strict=True)
    ]
    return several[0] if len(several) == 1 else merge_hits(several, options.min_overlap)


def _unbeaten(
    hits: Hits,
    own: Sequence[MotionTemplate],
    rivals: Sequence[MotionTemplate],
    batch: WordBatch,
    options: RetrieveOptions,
) -> Hits:
    """Drop the hits that rivals explain better.

    Only where a rival comes below the ratio of a hit near it is the document searched for the
    rival's own hits.
    """
    tau = min(_threshold(template, options) for template in own)
    ratios = hits.costs / tau
    # Laid end to end with room between them, hits of different documents never meet.
    first = np.cumsum(np.diff(batch.bounds) + 1) - np.diff(batch.bounds) - 1
    columns = [(first[hits.documents] + hits.starts, first[hits.documents] + hits.ends, ratios)]
    kinds = [np.zeros(len(ratios), dtype=np.int64)]
    for kind, rival in enumerate(rivals, start=1):
        near = _lowest_near(rival, hits, batch, options) / _threshold(rival, options)
        # Not np.unique, which imports masked arrays: a seventh of a small search.
        documents = np.flatnonzero(np.bincount(hits.documents[near < ratios]))
        if len(documents):
            place = batch.select(documents)
            theirs = _hits([rival], [_match(rival, place, options)], options)
            shift = first[documents[theirs.documents]]
            theirs_ratios = theirs.costs / _threshold(rival, options)
            columns.append((shift + theirs.starts, shift + theirs.ends, theirs_ratios))
            kinds.append(np.full(len(theirs.costs), kind))
    starts, ends, levels = map(np.concatenate, zip(*columns, strict=True))
    kept = ~beaten_by_rivals(starts, ends, levels, np.concatenate(kinds))[: len(ratios)]
    return Hits(hits.documents[kept], hits.starts[kept], hits.ends[kept], hits.costs[kept])


def _lowest_near(
    rival: MotionTemplate, hits: Hits, batch: WordBatch, options: RetrieveOptions
) -> CostArray:
    """Give the lowest cost of a rival's matches that can overlap each hit, shape (H,)."""
    reach = 2 * len(rival.matrix)  # longer than any match
    lengths = np.diff(batch.bounds)[hits.documents]
    starts = np.maximum(hits.starts - reach, 0)
    place = batch.cut(hits.documents, starts, np.minimum(hits.ends + reach, lengths))
    matching = _match(rival, place, options)
    borders = np.column_stack((place.bounds[:-1] + hits.starts - starts, place.bounds[1:])).ravel()
    return np.minimum.reduceat(np.append(matching.costs, np.float32(np.inf)), borders)[::2]


def _described(hits: Hits, batch: WordBatch, rate: float, label: str) -> Iterator[Hit]:
    columns = (hits.documents, hits.starts, hits.ends, hits.costs)
    for number, start, end, cost in zip(*(c.tolist() for c in columns), strict=True):
        first = int(batch.starts[number])
        yield make_hit(batch.documents[number], first + start, first + end, rate, cost, label)


def _curves(batch: WordBatch, matchings: Sequence[Matching]) -> Iterator[Curve]:
    """Give document, first frame and lowest costs of each piece."""
    lowest = np.minimum.reduce([matching.costs for matching in matchings])
    spans = itertools.pairwise(batch.bounds.tolist())
    names = (document.name for document in batch.documents)
    for name, first, (start, stop) in zip(names, batch.starts.tolist(), spans, strict=True):
        yield name, first, lowest[start:stop]


def _profile_chunks(curves: Sequence[Curve], rate: float) -> Iterator[bytes]:
    """Give the profile as CSV, one document after the other in the order of their names."""
    yield from (f"{line}\n".encode() for line in render_records([], "csv", PROFILE_COLUMNS))
    for name, first, costs in sorted(curves, key=lambda curve: curve[:2]):
        rows = (
            {"document": name, "frame": frame, "time": round(frame / rate, 6), "cost": cost}
            for frame, cost in enumerate(map(_finite, costs.tolist()), start=first)
        )
        lines = itertools.islice(render_records(rows, "csv", PROFILE_COLUMNS), 1, None)
        yield "".join(f"{line}\n" for line in lines).encode()


def _finite(cost: float) -> float | str:
    return round(cost, 9) if math.isfinite(cost) else ""


def _remarks(own: Sequence[MotionTemplate], label: str, options: RetrieveOptions) -> Iterator[str]:
    if options.tau is None and all(template.tau is None for template in own):
        yield f"{shown(label)} has no threshold of its own, {TAU} is used"
    if options.tau is None and options.steps == "printed":
        yield "thresholds were learned with weighted steps; with printed ones --tau fits better"
