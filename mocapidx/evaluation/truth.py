"""What people say occurs where, and which hits agree with it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mocapidx.model import BoolArray, FloatArray

__all__ = ["Judged", "Stretch", "confusion_seconds", "judge_hits"]

SHARED = 0.5
NOTHING = ""
"""Stands for no label in a table of confusions."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of a document that shows a class, or is said to.

    Parameters
    ----------
    document : str
    label : str
        The class.
    start, end : float
        In seconds; an end that is not known is infinite.
    """

    document: str
    label: str
    start: float
    end: float

    def common(self, other: "Stretch") -> float:
        """Return the seconds that two stretches of one document share."""
        return max(0.0, min(self.end, other.end) - max(self.start, other.start))


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """Hits of one class, best first, held against the labels.

    Parameters
    ----------
    relevant : ndarray of bool, shape (H,)
        Whether the hit counts as right.
    fresh : ndarray of bool, shape (H,)
        Whether it is the first hit on a label.
    labels : int
        How many labels the class has.
    """

    relevant: BoolArray
    fresh: BoolArray
    labels: int


def judge_hits(
    hits: Sequence[Stretch], truth: Sequence[Stretch], *, repeated: bool = False
) -> Judged:
    """Tell which hits of a class are right.

    A hit is on a label of its class if they share more than half of the shorter of the two. The
    best hit on a label is right; of several labels it takes the one that it shares most with.

    Parameters
    ----------
    hits : sequence of Stretch
        Of one class, best first.
    truth : sequence of Stretch
        Of the same class.
    repeated : bool
        Whether a label may cover several repetitions, so that further hits on it are right too;
        otherwise they are wrong.

    Returns
    -------
    Judged
    """
    by_document: dict[str, list[int]] = {}
    for number, label in enumerate(truth):
        by_document.setdefault(label.document, []).append(number)
    taken: set[int] = set()
    relevant = np.zeros(len(hits), dtype=np.bool_)
    fresh = np.zeros(len(hits), dtype=np.bool_)
    for place, hit in enumerate(hits):
        on = [
            number
            for number in by_document.get(hit.document, ())
            if hit.common(truth[number]) > SHARED * _shorter(hit, truth[number])
        ]
        free = [number for number in on if number not in taken]
        if free:
            taken.add(max(free, key=lambda number: (hit.common(truth[number]), -number)))
            fresh[place] = True
        relevant[place] = bool(free) or (repeated and bool(on))
    return Judged(relevant, fresh, len(truth))


def _shorter(hit: Stretch, label: Stretch) -> float:
    return min(hit.end - hit.start, label.end - label.start)


def confusion_seconds(
    found: Sequence[Stretch], truth: Sequence[Stretch], lengths: Mapping[str, float]
) -> dict[tuple[str, str], float]:
    """Measure for how long each class was taken for which.

    Parameters
    ----------
    found, truth : sequence of Stretch
        Annotations and labels. Where annotations overlap, a moment counts for the right one if
        there is one, else in equal shares; labels do not overlap.
    lengths : mapping of str to float
        Seconds of documents, for labels whose end is not known and for time without labels;
        where a document is not in it, it is taken to last as long as its annotation and labels.

    Returns
    -------
    dict
        Seconds for each pair of label and annotation; the empty text is none.
    """
    spent: dict[tuple[str, str], float] = {}
    own_found, own_truth = _by_document(found), _by_document(truth)
    for document in sorted({*own_found, *own_truth}):
        said, labels = own_found.get(document, []), own_truth.get(document, [])
        ends = [each.end for each in (*said, *labels) if math.isfinite(each.end)]
        length = lengths.get(document, max(ends, default=0.0))
        times = [time for each in (*said, *labels) for time in (each.start, each.end)]
        cuts = np.unique(np.clip([0.0, length, *times], 0.0, length))
        moments = zip(
            np.diff(cuts).tolist(), _active(labels, cuts), _active(said, cuts), strict=True
        )
        for seconds, true, annotated in moments:
            for pair, share in _pairs(true, annotated):
                spent[pair] = spent.get(pair, 0.0) + share * seconds
    return spent


def _by_document(stretches: Sequence[Stretch]) -> dict[str, list[Stretch]]:
    grouped: dict[str, list[Stretch]] = {}
    for each in stretches:
        grouped.setdefault(each.document, []).append(each)
    return grouped


def _active(stretches: Sequence[Stretch], cuts: FloatArray) -> list[set[str]]:
    """Classes that go on between each two cuts."""
    active: list[set[str]] = [set() for _ in cuts[1:]]
    firsts = np.searchsorted(cuts, [each.start for each in stretches])
    lasts = np.searchsorted(cuts, [each.end for each in stretches])
    for each, first, last in zip(stretches, firsts.tolist(), lasts.tolist(), strict=True):
        for labels in active[first:last]:
            labels.add(each.label)
    return active


def _pairs(labels: set[str], said: set[str]) -> list[tuple[tuple[str, str], float]]:
    """Pairs of label and annotation at a moment, with their shares of it."""
    pairs = []
    for label in sorted(labels) or [NOTHING]:
        chosen = [label] if label in said else sorted(said) or [NOTHING]
        share = 1.0 / (max(len(labels), 1) * len(chosen))
        pairs += [((label, one), share) for one in chosen]
    return pairs
