"""Precision, recall and what can be read off a ranking."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mocapidx.evaluation.truth import NOTHING, Judged
from mocapidx.model import FloatArray

__all__ = [
    "TAUS",
    "TOPS",
    "ClassTime",
    "Counted",
    "average_precision",
    "class_times",
    "counted_below",
    "recall_in_top",
    "separation_quotient",
]

TAUS = (0.01, 0.02, 0.04, 0.06, 0.08, 0.1)
TOPS = (5, 10, 20)
BEST = 10
"""Hits among which the correct ones count for the separation quotient."""


@dataclass(frozen=True, slots=True)
class Counted:
    """Hits, counted.

    Parameters
    ----------
    hits : int
        How many there are.
    relevant : int
        How many of them are right.
    found : int
        How many labels have a hit.
    labels : int
        How many labels there are.
    """

    hits: int
    relevant: int
    found: int
    labels: int

    def __add__(self, other: "Counted") -> "Counted":
        return Counted(
            self.hits + other.hits,
            self.relevant + other.relevant,
            self.found + other.found,
            self.labels + other.labels,
        )

    @property
    def precision(self) -> float | None:
        """Share of the hits that is right; None without hits."""
        return self.relevant / self.hits if self.hits else None

    @property
    def recall(self) -> float | None:
        """Share of the labels that has a hit; None without labels."""
        return self.found / self.labels if self.labels else None

    @property
    def f1(self) -> float | None:
        """Harmonic mean of precision and recall; None without labels, 0 without hits."""
        if self.recall is None:
            return None
        total = (self.precision or 0.0) + self.recall
        return 2 * (self.precision or 0.0) * self.recall / total if total else 0.0


def counted_below(costs: FloatArray, judged: Judged, tau: float = np.inf) -> Counted:
    """Count the hits that cost less than a threshold.

    Parameters
    ----------
    costs : ndarray of float, shape (H,)
        Of the hits of one class, ascending.
    judged : Judged
        Of the same hits.
    tau : float

    Returns
    -------
    Counted
    """
    hits = int(np.searchsorted(costs, tau, side="left"))
    return Counted(
        hits, int(judged.relevant[:hits].sum()), int(judged.fresh[:hits].sum()), judged.labels
    )


def average_precision(judged: Judged) -> float | None:
    """Mean over the labels of the precision at the rank of their first hit, 0 where none is.

    Parameters
    ----------
    judged : Judged

    Returns
    -------
    float or None
        None without labels.
    """
    if not judged.labels:
        return None
    precisions = np.cumsum(judged.relevant) / np.arange(1, len(judged.relevant) + 1)
    return float(precisions[judged.fresh].sum() / judged.labels)


def recall_in_top(judged: Judged, top: int) -> float | None:
    """Share of the labels that have a hit among the best; None without labels.

    Parameters
    ----------
    judged : Judged
    top : int
        How many of the hits count.

    Returns
    -------
    float or None
    """
    return int(judged.fresh[:top].sum()) / judged.labels if judged.labels else None


def separation_quotient(median_distance: float, costs: FloatArray, judged: Judged) -> float | None:
    """Median of the distance function over the median cost of the correct hits among the top 10.

    Parameters
    ----------
    median_distance : float
        Over all frames in which a match can end.
    costs : ndarray of float, shape (H,)
        Of the hits, ascending.
    judged : Judged
        Of the same hits.

    Returns
    -------
    float or None
        The larger, the better a threshold separates; infinite where correct hits cost nothing;
        None without correct hits.

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, section 5.5.
    """
    correct = costs[:BEST][judged.relevant[:BEST]]
    if not len(correct):
        return None
    cost = float(np.median(correct))
    return median_distance / cost if cost > 0 else np.inf


@dataclass(frozen=True, slots=True)
class ClassTime:
    """How long a class was labelled and annotated.

    Parameters
    ----------
    labelled, annotated, right : float
        Seconds: of its labels, of its annotations, and of both at once.
    """

    labelled: float
    annotated: float
    right: float

    @property
    def precision(self) -> float | None:
        """Share of the annotated time that is right."""
        return self.right / self.annotated if self.annotated else None

    @property
    def recall(self) -> float | None:
        """Share of the labelled time that is right: for all classes together, the accuracy."""
        return self.right / self.labelled if self.labelled else None

    @property
    def f1(self) -> float | None:
        """Harmonic mean of the two; None where the class is not labelled."""
        total = self.labelled + self.annotated
        return 2 * self.right / total if self.labelled else None


def class_times(
    confusion: Mapping[tuple[str, str], float], classes: Sequence[str]
) -> dict[str, ClassTime]:
    """Sum a table of confusions up by class.

    Parameters
    ----------
    confusion : mapping
        Seconds for each pair of label and annotation.
    classes : sequence of str

    Returns
    -------
    dict
        By class, in the order given.
    """
    return {
        label: ClassTime(
            labelled=sum((time for (truth, _), time in confusion.items() if truth == label), 0.0),
            annotated=sum((time for (_, said), time in confusion.items() if said == label), 0.0),
            right=confusion.get((label, label), 0.0),
        )
        for label in classes
        if label != NOTHING
    }
