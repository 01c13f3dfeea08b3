"""Query by one example without choosing features: a one-shot template with guarded feedback."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from mocapidx.features.featureset import FeatureSet
from mocapidx.model import FloatArray, Hit, HitList, IndexArray
from mocapidx.printable import count, shown
from mocapidx.store.manifest import Placed
from mocapidx.tasks.answers import feature_ranges, open_archive
from mocapidx.tasks.example import Example
from mocapidx.tasks.hits import make_hit
from mocapidx.tasks.oneshot_example import ExampleShot, read_example
from mocapidx.tasks.oneshot_learn import learn_from_hits, stretch_name
from mocapidx.tasks.oneshot_scan import Area, Ranking, choose_area, median_cost, rank
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.records import Record, hit_record
from mocapidx.tasks.segment_sources import untrusted_mask
from mocapidx.tasks.sigma import store_sigma
from mocapidx.tasks.store_poses import read_shot
from mocapidx.templates.oneshot import (
    ACCEPTED,
    LIKELY,
    SURE,
    Pattern,
    accept,
    join_examples,
    signed_distances,
    weigh,
    weight_shares,
)

if TYPE_CHECKING:
    from mocapidx.tasks.parallel import MapFunction

__all__ = ["AutoFound", "WeightShare", "auto_records", "query_auto", "weight_records"]

SHOWN_ROWS: Final = 10
"""Rows that carry the weight, as far as a person wants to read them."""


@dataclass(frozen=True, slots=True)
class WeightShare:
    """How much one feature matters to a one-shot template.

    Parameters
    ----------
    feature : str
        Its id.
    name : str
        What it says in words.
    share : float
        Of all weight, from 0 to 1.
    on : float
        Of its weight, how much expects the feature to be on.
    """

    feature: str
    name: str
    share: float
    on: float


@dataclass(frozen=True, slots=True)
class AutoFound:
    """The answer to a query by one example, features being weighed automatically.

    Parameters
    ----------
    hits : tuple of Hit
        By cost, then document name, then start.
    sure : tuple of bool
        Which of them cost at most a fifth of the median.
    accepted : tuple of Hit
        What was taken for the same motion after the first look, and sharpened the template.
    weights : tuple of WeightShare
        What the template is about, the weightiest first.
    remarks : tuple of str
        What a person should know about the answer, a sentence each.
    """

    hits: tuple[Hit, ...]
    sure: tuple[bool, ...]
    accepted: tuple[Hit, ...]
    weights: tuple[WeightShare, ...]
    remarks: tuple[str, ...]

    def _repr_html_(self) -> str:
        return HitList(self.hits)._repr_html_()


@dataclass(frozen=True, slots=True, eq=False)
class _Answer:
    """A ranking, the pattern it is of, and what led to it."""

    pattern: Pattern
    ranking: Ranking
    median: float
    accepted: tuple[Hit, ...] = ()


def query_auto(
    store: str | Path,
    example: str | Path | Example,
    *,
    feedback: bool = True,
    top: int | None = None,
    learn: Path | None = None,
    where: str | None = None,
    read: ReadOptions | None = None,
    map_fn: "MapFunction" = map,
) -> AutoFound:
    """Rank everything in a store by how much it is like one example; no features are chosen.

    Parameters
    ----------
    store : str or Path
    example : str, Path or Example
        As text: ``FILE`` or ``FILE@START:END``; a document of the store in place of FILE.
    feedback : bool
        Sharpen the template once with the hits that are surely the same motion.
    top : int, optional
        Keep the best only.
    learn : Path, optional
        Make an ordinary template of the example and these hits, and write it to this file.
    where : str, optional
        A condition on documents, as in `mocapidx.tasks.where`; the others don't count at all.
    read : ReadOptions, optional
        How the example's file is understood.
    map_fn : callable
        Matches what was read of the store, with the shape of ``map``.

    Returns
    -------
    AutoFound

    Raises
    ------
    FormatError
        If the example can't be used.
    ParameterError, StoreError
    WriteError
        If the template could not be written.
    """
    with open_archive(store, where) as archive:
        snapshot, feature_set = archive.snapshot, archive.feature_set
        settings = snapshot.manifest.settings
        documents = [
            place.placed[number]
            for place in archive.files
            for group in place.groups
            for number in group.documents.tolist()
        ]
        shot = read_example(snapshot, example, feature_set, read or ReadOptions())
        remarks = list(_remarks(settings.poses, documents, shot, feature_set, feedback))
        sigma = store_sigma(snapshot, feature_set)
        signed = signed_distances(shot.shot, sigma)
        pattern = weigh(signed)
        area = choose_area(snapshot, documents, pattern, map_fn)
        if area.pieces is not None:
            remarks.append(
                "the store is too large to be looked through: the better fifth of a coarse scan "
                "was; about one hit in a hundred is lost"
            )
        answer = _ranked(area, pattern)
        if feedback and settings.poses:
            answer = _sharpened(area, answer, shot, signed, sigma, feature_set)
        if not answer.median:
            remarks.append(
                "half of all places agree with the example in all that has weight: it says too "
                "little, or the store holds copies of it"
            )
        elif feedback and settings.poses and not answer.accepted:
            remarks.append("no hit was near enough to sharpen the template with")
        if learn is not None:
            learn_from_hits(learn, shot, snapshot, answer.accepted)
            examples = ", ".join([shot.name, *map(stretch_name, answer.accepted)])
            remarks.append(f"the template is learned from {shown(examples, None)}")
        hits = _hits(area, answer.ranking, slice(top), shot.label)
    costs, median = answer.ranking.costs, answer.median
    remarks.append(
        f"of {len(costs)} places {int((costs <= SURE * median).sum())} are sure, up to a cost of "
        f"{SURE * median:.3f}, and {int((costs <= LIKELY * median).sum())} likely, up to "
        f"{LIKELY * median:.3f}"
    )
    sure = costs[:top] <= SURE * median
    return AutoFound(
        HitList(hits),
        tuple(sure.tolist()),
        answer.accepted,
        tuple(_weights(answer.pattern, feature_set)),
        tuple(remarks),
    )


def auto_records(found: AutoFound) -> list[Record]:
    """Lay the hits out as records: those of every query, then `sure` and `accepted`.

    Parameters
    ----------
    found : AutoFound

    Returns
    -------
    list of dict
        `sure` says whether a hit is as good as certain, `accepted` how many hits sharpened the
        template.
    """
    pairs = zip(found.hits, found.sure, strict=True)
    return [
        {**hit_record(hit, number), "sure": sure, "accepted": len(found.accepted)}
        for number, (hit, sure) in enumerate(pairs, start=1)
    ]


def weight_records(found: AutoFound) -> list[Record]:
    """Lay out what the template is about, for people and programs.

    Parameters
    ----------
    found : AutoFound

    Returns
    -------
    list of dict
        The weightiest features, as shares of all weight.
    """
    return [
        {
            "feature": row.feature,
            "name": row.name,
            "share": round(row.share, 4),
            "on": round(row.on, 4),
        }
        for row in found.weights[:SHOWN_ROWS]
    ]


def _remarks(
    poses: bool,
    documents: Sequence[Placed],
    shot: ExampleShot,
    feature_set: FeatureSet,
    feedback: bool,
) -> Sequence[str]:
    remarks = []
    if shot.untrusted:
        remarks.append(
            f"the example's skeleton can't tell {feature_ranges(feature_set, shot.untrusted)}; "
            "they have no weight"
        )
    if not poses:
        lost = "there is no feedback, and " if feedback else ""
        remarks.append(
            f"the store keeps no poses, so {lost}how people differ is not measured on it"
        )
    left_out: dict[int, int] = {}
    for placed in documents:
        if mask := untrusted_mask(placed.document) & ~shot.untrusted:
            left_out[mask] = left_out.get(mask, 0) + 1
    for mask, number in left_out.items():
        names = feature_ranges(feature_set, mask)
        has, it = ("have", "them") if mask.bit_count() > 1 else ("has", "it")
        whose = "its skeleton" if number == 1 else "their skeletons"
        remarks.append(
            f"in {count(number, 'document')} {names} {has} no weight: {whose} can't tell {it}"
        )
    return remarks


def _ranked(area: Area, pattern: Pattern, accepted: tuple[Hit, ...] = ()) -> _Answer:
    ranking = rank(area, pattern)
    return _Answer(pattern, ranking, median_cost(area, pattern, ranking), accepted)


def _sharpened(
    area: Area,
    first: _Answer,
    shot: ExampleShot,
    signed: FloatArray,
    sigma: FloatArray,
    feature_set: FeatureSet,
) -> _Answer:
    """Rank again with what the example and its nearest hits have in common."""
    ranking = first.ranking
    chosen = accept(ranking.costs, ranking.documents, first.median)
    if not len(chosen) or not first.median:  # hits that differ in nothing have nothing to add
        return first
    others, trust = [], []
    for hit in chosen.tolist():
        placed = area.documents[int(ranking.documents[hit])]
        start, end = int(ranking.starts[hit]), int(ranking.ends[hit])
        other = read_shot(area.snapshot, placed, start, end, feature_set)
        others.append((other.bits, signed_distances(other, sigma)))
        # A hit at the very limit tells nothing.
        trust.append(1.0 - float(ranking.costs[hit]) / (ACCEPTED * first.median))
    joined = join_examples(shot.shot.bits, signed, others, trust)
    return _ranked(area, weigh(joined), _hits(area, ranking, chosen, shot.label))


def _hits(area: Area, ranking: Ranking, chosen: IndexArray | slice, label: str) -> tuple[Hit, ...]:
    columns = (ranking.documents, ranking.starts, ranking.ends, ranking.costs)
    rows = zip(*(column[chosen].tolist() for column in columns), strict=True)
    rate = area.snapshot.manifest.settings.rate
    return tuple(
        make_hit(area.documents[number].document, start, end, rate, cost, label)
        for number, start, end, cost in rows
    )


def _weights(pattern: Pattern, feature_set: FeatureSet) -> list[WeightShare]:
    rows = []
    for number, share in weight_shares(pattern):
        weights = pattern.weights[:, number]
        on = float(weights[pattern.ones[:, number]].sum() / weights.sum())
        feature = feature_set.features[number]
        rows.append(WeightShare(feature.id, feature.name, share, on))
    return rows
