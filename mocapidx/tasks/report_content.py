"""What the page of a report shows: documents with their poses, and hits in step with a query."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.features.featureset import FeatureSet
from mocapidx.model import FloatArray
from mocapidx.reports.page.content import (
    PageCurve,
    PageDocument,
    PageHit,
    PagePiece,
    PageReference,
)
from mocapidx.skeleton.joints import INDEX
from mocapidx.store.manifest import Placed
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.align import AlignOptions, align_stretches
from mocapidx.tasks.example import forget_joints
from mocapidx.tasks.found import Found
from mocapidx.tasks.report_plan import Plan
from mocapidx.tasks.segment_sources import untrusted_mask
from mocapidx.tasks.stored import pose_rows
from mocapidx.tasks.stretch import Stretch
from mocapidx.templates.match import distance_function
from mocapidx.templates.template import MotionTemplate, TemplateSet

__all__ = ["Placing", "page_documents", "page_hits"]

LEG: Final = 0.85
"""Metres from the hip over the knee to the ankle of a grown person."""

SIZES: Final = (0.01, 100.0)
"""Of bodies; what is smaller or larger is a unit misunderstood, and is drawn all the same."""

GROUND: Final = 2.0
"""Percentile of the lowest joint over time: feet leave the ground, and data has spikes."""

MOST_CELLS: Final = 1 << 20
"""Pairs of frames that are looked at to bring a hit in step: two of 34 s at 30 Hz."""

MANY_TIMES: Final = 3.0
"""An annotation so many times as long as the best one covers repetitions; no path fits them."""


@dataclass(frozen=True, slots=True, eq=False)
class Placing:
    """A record on the frames of its document.

    Parameters
    ----------
    found : Found
    placed : Placed
        The document.
    start, end : int
        In its frames, half open, at least one.
    """

    found: Found
    placed: Placed
    start: int
    end: int


def page_documents(
    store: Snapshot, placings: Sequence[Placing], plan: Plan, templates: TemplateSet | None
) -> tuple[PageDocument, ...]:
    """Read the documents of some hits, as far as they are kept.

    Parameters
    ----------
    store : Snapshot
        With poses.
    placings : sequence of Placing
    plan : Plan
        With pieces for each of their documents.
    templates : TemplateSet, optional
        Of the store's feature set and rate.

    Returns
    -------
    tuple of PageDocument
        By name.
    """
    places = {each.placed.document.name: each.placed for each in placings}
    labels: dict[str, set[str]] = {}
    for each in placings:
        labels.setdefault(each.placed.document.name, set()).add(each.found.label)
    documents = []
    for name, placed in sorted(places.items()):
        document, offset = placed.document, placed.frame_offset
        words = store.array(placed.file, FRAME_WORDS.path, offset, offset + document.frames)
        words = words.astype(np.uint64)
        untrusted = untrusted_mask(document)
        pieces = tuple(
            PagePiece(
                start,
                pose_rows(store, placed.file, offset + start, offset + end),
                words[start:end],
                plan.step,
            )
            for start, end in plan.pieces[name]
        )
        size, floor = _body(np.concatenate([piece.poses for piece in pieces]))
        curves = tuple(
            PageCurve(
                template.label,
                template.threshold,
                distance_function(template, words, untrusted=untrusted),
            )
            for template in _class_templates(templates, sorted(labels[name]))
        )
        documents.append(
            PageDocument(name, document.frames, untrusted, floor, size, pieces, curves)
        )
    return tuple(documents)


def _class_templates(known: TemplateSet | None, labels: Sequence[str]) -> list[MotionTemplate]:
    """Return the templates that stand for whole classes, where a class has such."""
    chosen = []
    for label in labels:
        own = () if known is None else known.of(label) if label in known.labels else ()
        chosen += [each for each in own if each.kind == "class"] or list(own)
    return chosen


def _body(poses: FloatArray) -> tuple[float, float]:
    """Measure how large a body is, and how high the ground lies."""
    lengths = [
        np.linalg.norm(
            poses[:, INDEX[f"{side}{upper}"]] - poses[:, INDEX[f"{side}{lower}"]], axis=1
        )
        for upper, lower in (("hip", "knee"), ("knee", "ankle"))
        for side in "lr"
    ]
    known = [float(np.nanmedian(each)) for each in lengths if np.isfinite(each).any()]
    size = 2 * float(np.mean(known)) / LEG if known else 1.0
    heights = poses[..., 1]
    lowest = np.where(np.isfinite(heights), heights, np.inf).min(axis=1)
    lowest = lowest[np.isfinite(lowest)]
    floor = float(np.percentile(lowest, GROUND)) if len(lowest) else 0.0
    return float(np.clip(size, *SIZES)), floor


def page_hits(
    placings: Sequence[Placing],
    documents: Sequence[PageDocument],
    feature_set: FeatureSet,
    rate: float,
    query: Stretch | None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[tuple[PageHit, ...], tuple[PageReference, ...]]:
    """Lay out hits, each in step with what it is compared with.

    Parameters
    ----------
    placings : sequence of Placing
    documents : sequence of PageDocument
        Theirs.
    feature_set : FeatureSet
    rate : float
        In Hz.
    query : Stretch or None
        With poses; None: each hit is compared with the best of its class.
    progress : callable, optional
        Told how many hits are done, and how many there are.

    Returns
    -------
    hits : tuple of PageHit
        In the order of `placings`.
    references : tuple of PageReference
    """
    numbers = {document.name: number for number, document in enumerate(documents)}
    stretches = [_stretch(each, documents[numbers[each.placed.document.name]]) for each in placings]
    references: list[PageReference] = []
    of_label: dict[str, int] = {}
    reference_stretches: list[Stretch] = []
    if query is not None and query.poses is not None and placings:
        references.append(_query_reference(query))
        reference_stretches.append(query)
        of_label = {each.found.label: 0 for each in placings}
    else:
        for label, best in _best_of_each(placings).items():
            of_label[label] = len(references)
            references.append(PageReference(f"best of {label}", hit=best))
            reference_stretches.append(stretches[best])
    hits = []
    for number, (each, stretch) in enumerate(zip(placings, stretches, strict=True)):
        reference = of_label.get(each.found.label)
        if reference is not None and references[reference].hit == number:
            reference = None
        steps: tuple[int, ...] = ()
        if reference is not None:
            other = reference_stretches[reference]
            if each.found.ranked or len(stretch.words) <= MANY_TIMES * len(other.words):
                steps = _in_step(stretch, other, feature_set, rate)
        hits.append(
            PageHit(
                document=numbers[each.placed.document.name],
                label=each.found.label,
                cost=each.found.cost,
                start=each.start,
                end=each.end,
                rank=each.found.rank,
                reference=reference,
                steps=steps,
            )
        )
        if progress is not None:
            progress(number + 1, len(placings))
    return tuple(hits), tuple(references)


def _query_reference(query: Stretch) -> PageReference:
    poses: NDArray[np.float32] = np.asarray(query.poses, dtype=np.float32)
    size, floor = _body(poses)
    piece = PagePiece(0, poses, query.words)
    return PageReference(f"query {query.name}", piece=piece, size=size, floor=floor)


def _best_of_each(placings: Sequence[Placing]) -> dict[str, int]:
    """Give the number of the best hit of each class that has several."""
    of_label: dict[str, list[int]] = {}
    for number, each in enumerate(placings):
        of_label.setdefault(each.found.label, []).append(number)
    return {
        label: min(own, key=lambda number: placings[number].found.cost)
        for label, own in of_label.items()
        if len(own) > 1
    }


def _stretch(placing: Placing, document: PageDocument) -> Stretch:
    start, end = placing.start, placing.end
    piece = next(
        each for each in document.pieces if each.start <= start < each.start + len(each.words)
    )
    inner = slice(start - piece.start, end - piece.start)
    poses = piece.poses[inner].astype(np.float64)
    made = placing.placed.document.rig.get("made", ())
    return Stretch(
        document.name, start, piece.words[inner], document.untrusted, forget_joints(poses, made)
    )


def _in_step(one: Stretch, other: Stretch, feature_set: FeatureSet, rate: float) -> tuple[int, ...]:
    """For each frame of one give the frame of the other that goes with it; empty: none does."""
    frames, others = len(one.words), len(other.words)
    if frames * others > MOST_CELLS:
        return ()
    path = align_stretches(one, other, feature_set, rate, AlignOptions()).path
    if path is None:
        return ()
    totals = np.bincount(path.rows, weights=path.columns, minlength=frames)
    mean = totals / np.bincount(path.rows, minlength=frames)
    return tuple(np.rint(mean).astype(np.int64).tolist())
