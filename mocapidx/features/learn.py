"""Thresholds from examples: of where a feature should be on, and of where it should be off."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.features.relations import robust_threshold
from mocapidx.model import FloatArray

__all__ = ["Separation", "Wanted", "learn_thresholds"]

Wanted: TypeAlias = NDArray[np.int8]
"""What a feature should be, frame by frame: 1 on, -1 off, 0 either."""

GAPS: Final = 32
"""Distances between the two thresholds that are tried."""

ALLOWED_LOSS: Final = 0.005
"""Of the share of frames that come out right, for a feature that changes less often."""


@dataclass(frozen=True, slots=True)
class Separation:
    """Two thresholds, and how well they separate the examples.

    Parameters
    ----------
    threshold : float
        The single threshold that is right most often.
    on, off : float
        The stronger and the weaker threshold around it.
    positive_on : float
        Share of the frames that should be on in which the feature is on.
    negative_off : float
        Share of the frames that should be off in which it is off.
    single_right : float
        The mean of both shares with the single threshold.
    area : float
        How often the value of a frame that should be on is above that of one that should be
        off (the area under the ROC curve): 0.5 says nothing, 1 separates fully.
    changes, single_changes : int
        How often the feature changes within the examples, with two thresholds and with one.
    """

    threshold: float
    on: float
    off: float
    positive_on: float
    negative_off: float
    single_right: float
    area: float
    changes: int
    single_changes: int

    @property
    def right(self) -> float:
        """The mean of the two shares: 0.5 is chance."""
        return (self.positive_on + self.negative_off) / 2


def learn_thresholds(values: Sequence[FloatArray], wanted: Sequence[Wanted]) -> Separation:
    """Choose the thresholds above which a feature should be on.

    A search over all values finds the single threshold that is right most often, the positive
    frames together weighing as much as the negative ones. Two more searches move first the
    weaker and then the stronger threshold away from there: of those that are right as often,
    but for half a per cent, to where the feature changes least.

    Parameters
    ----------
    values : sequence of ndarray of float, each of shape (T,)
        The values in each document, larger where the feature should be on; NaN where unknown.
    wanted : sequence of ndarray of int8, each of shape (T,)

    Returns
    -------
    Separation

    Raises
    ------
    ParameterError
        If there is no frame of either kind whose value is known.

    References
    ----------
    .. [1] Mueller, Roeder, "A relational approach to content-based analysis of motion capture
       data", section 4.3.
    """
    joined, kinds = np.concatenate([np.zeros(0), *values]), np.concatenate([*wanted, [0]])[:-1]
    known = np.isfinite(joined)
    above, below = (np.sort(joined[known & (kinds == kind)]) for kind in (1, -1))
    if not (len(above) and len(below)):
        which = "negative" if len(above) else "positive"
        raise ParameterError(f"the value of the feature is known in no {which} example")
    threshold, single_right = _best_threshold(above, below)
    reach = abs(float(np.median(above)) - float(np.median(below))) / 2
    gaps = np.linspace(0.0, reach, GAPS + 1).tolist()
    off = _calmest([(threshold, threshold - gap) for gap in gaps], values, wanted)[1]
    on = _calmest([(threshold + gap, off) for gap in gaps], values, wanted)[0]
    shares, changes = _outcome(values, wanted, on, off)
    return Separation(
        threshold,
        on,
        off,
        *shares,
        single_right,
        _area(above, below),
        changes,
        _outcome(values, wanted, threshold, threshold)[1],
    )


def _calmest(
    pairs: Sequence[tuple[float, float]], values: Sequence[FloatArray], wanted: Sequence[Wanted]
) -> tuple[float, float]:
    """Choose, of pairs that are about as often right as the first, one that changes least."""
    found = [(pair, *_outcome(values, wanted, *pair)) for pair in pairs]
    least = sum(found[0][1]) - 2 * ALLOWED_LOSS
    good = [(changes, pair) for pair, shares, changes in found if sum(shares) >= least]
    fewest = min(changes for changes, _ in good)
    calm = [pair for changes, pair in good if changes == fewest]
    return calm[len(calm) // 2]  # not the edge: the next example may differ


def _best_threshold(above: FloatArray, below: FloatArray) -> tuple[float, float]:
    """Return the single threshold that is right most often, and how often it is."""
    values = np.unique(np.concatenate((above, below)))
    middles = values[:1] if len(values) == 1 else (values[1:] + values[:-1]) / 2
    passed = 1 - np.searchsorted(above, middles, side="right") / len(above)
    failed = np.searchsorted(below, middles, side="right") / len(below)
    right = (passed + failed) / 2
    # Of equally good thresholds the one with the most room around it.
    room = np.diff(values) if len(values) > 1 else np.zeros(1)
    ties = np.flatnonzero(right >= right.max() - 1e-12)
    best = int(ties[np.argmax(room[ties])])
    return float(middles[best]), float(right[best])


def _outcome(
    values: Sequence[FloatArray], wanted: Sequence[Wanted], on: float, off: float
) -> tuple[tuple[float, float], int]:
    """Return the shares of positive frames on and negative frames off, and the changes."""
    right, total, changes = {1: 0, -1: 0}, {1: 0, -1: 0}, 0
    for own, kinds in zip(values, wanted, strict=True):
        state = robust_threshold(own[None] > on, own[None] <= off, np.zeros(1, dtype=np.bool_))[0]
        for kind in (1, -1):
            total[kind] += int((kinds == kind).sum())
            right[kind] += int((state[kinds == kind] == (kind == 1)).sum())
        within = (kinds[1:] == kinds[:-1]) & (kinds[1:] != 0)
        changes += int((within & (state[1:] != state[:-1])).sum())
    return (right[1] / total[1], right[-1] / total[-1]), changes


def _area(above: FloatArray, below: FloatArray) -> float:
    lower, upper = (np.searchsorted(below, above, side=side) for side in ("left", "right"))
    return float((lower + upper).sum() / (2 * len(above) * len(below)))
