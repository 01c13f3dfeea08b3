"""Hold motion templates against simpler methods on the labelled clips of a store."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.evaluation.baselines import (
    dense_match,
    feature_costs,
    joint_quaternions,
    position_costs,
    quaternion_costs,
    relative_positions,
)
from mocapidx.evaluation.metrics import (
    TOPS,
    average_precision,
    recall_in_top,
    separation_quotient,
)
from mocapidx.evaluation.truth import Judged, Stretch, judge_hits
from mocapidx.features.words import unpack_words
from mocapidx.model import FloatArray, IndexArray, WordArray
from mocapidx.printable import meant, shown
from mocapidx.store.read import Snapshot, open_store
from mocapidx.tasks.labels import LabelFile, place_labels
from mocapidx.tasks.parallel import mapping
from mocapidx.tasks.records import Record
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.tasks.stored import pose_rows
from mocapidx.templates.learn import SHORTEST_EXAMPLE, learn_template
from mocapidx.templates.match import SHARED, end_padding, find_hits, local_minima, match_documents
from mocapidx.templates.quantise import quantise
from mocapidx.templates.template import DELTA

__all__ = ["COMPARE_COLUMNS", "METHODS", "compare_methods"]

METHODS: Final = ("MT", "RF", "Q", "3D")
"""Motion template; features, rotations, positions of one example."""

COMPARE_COLUMNS: Final = (
    "class",
    "method",
    "labels",
    *(f"found_top_{top}" for top in TOPS),
    "average_precision",
    "separation",
)

MOST_FOLDS: Final = 5

Hits: TypeAlias = tuple[FloatArray, list[Stretch]]


@dataclass(frozen=True, slots=True, eq=False)
class _Clip:
    """A labelled stretch with all that the methods compare."""

    name: str
    label: str
    group: str
    words: WordArray
    positions: FloatArray
    quaternions: FloatArray


@dataclass(frozen=True, slots=True)
class _Score:
    """How one method did for one class in one fold."""

    judged: Judged
    separation: float | None


def compare_methods(
    store: Path,
    labels: LabelFile,
    *,
    classes: Sequence[str] = (),
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> list[Record]:
    """Search labelled clips by motion templates and by one example, in three ways.

    The clips are divided into folds by their groups (persons or recordings), or one by one
    where labels have no group. For each fold and class a template is learned from the clips of
    the other folds, and the example nearest to it is the query of the other methods; the clips
    of the fold are searched.

    Parameters
    ----------
    store : Path
        A store that keeps poses.
    labels : LabelFile
        Each label is a clip.
    classes : sequence of str
        Only these are searched for; none: all.
    jobs : int
        Worker processes.
    progress : callable, optional
        Called with the number of searched classes done and of all.

    Returns
    -------
    list of mapping
        A record for each class and method, then for all classes: labels, how many of them were
        found among the best 5, 10 and 20 of each fold, mean average precision and median
        separation quotient over the folds.

    Raises
    ------
    FormatError
        If a label means no document or no frames of one.
    ParameterError
        If there is no such class, or only one fold.
    StoreError

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, section 5.5, table 4.
    """
    with open_store(store) as snapshot:
        clips = _read_clips(snapshot, labels)
        features = len(store_feature_set(snapshot).features)
    known = list(dict.fromkeys(clip.label for clip in clips))
    missing = [label for label in classes if label not in known]
    if missing:
        raise ParameterError(
            f"no label says '{shown(missing[0])}'; there are: {', '.join(map(shown, known))}"
            f"{meant(missing[0], known)}"
        )
    folds = _folds(clips)
    chosen = list(dict.fromkeys(classes)) or known
    searches = [(label, fold) for label in chosen for fold in folds]
    scores: dict[tuple[str, str], list[_Score]] = {}
    with mapping(min(jobs, len(searches))) as apply:
        outcomes = apply(partial(_fold_scores, clips, features), searches)
        for done, ((label, _), outcome) in enumerate(zip(searches, outcomes, strict=True), 1):
            for method, score in outcome.items():
                scores.setdefault((label, method), []).append(score)
            if progress is not None:
                progress(done, len(searches))
    return list(_records(chosen, scores))


def _read_clips(snapshot: Snapshot, labels: LabelFile) -> list[_Clip]:
    """Read words and poses of every labelled stretch, document by document."""
    places = snapshot.documents()
    documents = [placed.document for placed in places]
    rate = snapshot.manifest.settings.rate
    clips = []
    for example in place_labels(labels.labels, documents, rate, SHORTEST_EXAMPLE):
        placed = places[example.document]
        rows = (placed.frame_offset + example.start, placed.frame_offset + example.end)
        poses = pose_rows(snapshot, placed.file, *rows)
        clips.append(
            _Clip(
                name=example.label.where,
                label=example.label.label,
                group=example.label.group or example.label.where,
                words=snapshot.array(placed.file, "frames/words", *rows).astype(np.uint64),
                positions=relative_positions(poses),
                quaternions=joint_quaternions(poses),
            )
        )
    return clips


def _folds(clips: Sequence[_Clip]) -> list[frozenset[str]]:
    """Divide the groups: one part is searched, the others are learned from, in turn."""
    groups = sorted({clip.group for clip in clips})
    count = min(MOST_FOLDS, len(groups))
    if count < 2:
        raise ParameterError(
            "all labels are of one group; to learn from some and search the others takes two"
        )
    return [frozenset(groups[number::count]) for number in range(count)]


def _fold_scores(
    clips: Sequence[_Clip], features: int, search: tuple[str, frozenset[str]]
) -> Mapping[str, _Score]:
    """Search the clips of a fold for a class, by each method; runs in any process."""
    label, fold = search
    examples = [clip for clip in clips if clip.group not in fold and clip.label == label]
    searched = [clip for clip in clips if clip.group in fold]
    truth = [Stretch(clip.name, label, 0.0, np.inf) for clip in searched if clip.label == label]
    if not examples or not truth:
        return {}
    matrices = [unpack_words(clip.words, features) for clip in examples]
    learned = learn_template(matrices)
    nearest = int(np.argmin(learned.spread))
    example = examples[nearest]
    scores = {"MT": _score(*_match_template(learned.matrix, searched, label), truth)}
    costs: dict[str, Callable[[_Clip], FloatArray]] = {
        "RF": lambda clip: feature_costs(matrices[nearest], unpack_words(clip.words, features)),
        "Q": lambda clip: quaternion_costs(example.quaternions, clip.quaternions),
        "3D": lambda clip: position_costs(example.positions, clip.positions),
    }
    for method, table in costs.items():
        found = _match_costs([table(clip) for clip in searched], searched, label)
        scores[method] = _score(*found, truth)
    return scores


def _score(hits: Hits, distances: FloatArray, truth: Sequence[Stretch]) -> _Score:
    costs, stretches = hits
    judged = judge_hits(stretches, truth)
    finite = distances[np.isfinite(distances)]
    median = float(np.median(finite)) if len(finite) else np.inf
    return _Score(judged, separation_quotient(median, costs, judged))


def _match_template(
    matrix: FloatArray, clips: Sequence[_Clip], label: str
) -> tuple[Hits, FloatArray]:
    bounds = np.concatenate(([0], np.cumsum([len(clip.words) for clip in clips])))
    words = np.concatenate([clip.words for clip in clips])
    matching = match_documents(quantise(matrix, DELTA), words, bounds)
    found = find_hits(matching, np.inf)
    stretches = [
        Stretch(clips[number].name, label, float(start), float(end))
        for number, start, end in zip(
            found.documents.tolist(), found.starts.tolist(), found.ends.tolist(), strict=True
        )
    ]
    return (found.costs, stretches), matching.costs


def _match_costs(
    tables: Sequence[FloatArray], clips: Sequence[_Clip], label: str
) -> tuple[Hits, FloatArray]:
    """Match one example with all clips, their ends padded as for templates."""
    rows = len(tables[0])
    lengths = np.array([table.shape[1] for table in tables])
    padding = end_padding(lengths, rows)
    found: list[tuple[float, str, int, int]] = []
    everywhere = []
    for clip, table, own in zip(clips, tables, padding.tolist(), strict=True):
        length = table.shape[1]
        laid = np.clip(np.arange(-own, length + own), 0, length - 1)
        distances, starts = dense_match(table[:, laid])
        everywhere.append(distances[own : own + length])
        ends = local_minima(distances, np.array([0, len(distances)]))
        for end in _apart(distances, starts, ends):
            first = max(int(starts[end]) - own, 0)
            last = min(max(int(end) - own, 0), length - 1) + 1
            found.append((float(distances[end]), clip.name, min(first, last - 1), last))
    found.sort()
    stretches = [Stretch(name, label, float(start), float(end)) for _, name, start, end in found]
    return (np.array([cost for cost, *_ in found]), stretches), np.concatenate(everywhere)


def _apart(distances: FloatArray, starts: IndexArray, ends: IndexArray) -> Iterable[int]:
    """Choose the best matches, none of which shares more than half with a better one."""
    kept: list[tuple[int, int]] = []
    for end in ends[np.argsort(distances[ends], kind="stable")].tolist():
        start = int(starts[end])
        if all(
            min(end, other_end) - max(start, other_start) + 1
            <= SHARED * (min(end - start, other_end - other_start) + 1)
            for other_start, other_end in kept
        ):
            kept.append((start, end))
            yield end


def _records(
    classes: Sequence[str], scores: Mapping[tuple[str, str], Sequence[_Score]]
) -> Iterable[Record]:
    for label in classes:
        for method in METHODS:
            yield _record(label, method, [scores.get((label, method), ())])
    for method in METHODS:
        yield _record("all", method, [scores.get((label, method), ()) for label in classes])


def _record(label: str, method: str, by_class: Sequence[Sequence[_Score]]) -> Record:
    """Sum up over folds and classes; averages are over the classes' own."""
    scores = [score for own in by_class for score in own]
    found = {
        f"found_top_{top}": round(
            sum((recall_in_top(s.judged, top) or 0.0) * s.judged.labels for s in scores)
        )
        for top in TOPS
    }
    precisions = [
        np.mean([average_precision(s.judged) or 0.0 for s in own]) for own in by_class if own
    ]
    separations = [s.separation for s in scores if s.separation is not None]
    separation = float(np.median(separations)) if separations else None
    return {
        "class": label,
        "method": method,
        "labels": sum(score.judged.labels for score in scores),
        **found,
        "average_precision": round(float(np.mean(precisions)), 6) if precisions else None,
        "separation": separation if separation is None else _printable(separation),
    }


def _printable(value: float) -> float | str:
    """Give a number that JSON knows; a separation without any cost is infinite."""
    return round(value, 4) if np.isfinite(value) else "inf"
