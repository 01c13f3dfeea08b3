"""Scenes: several progressions, and conditions between their stretches.

Each progression is answered by the index for itself. Its hits are in order of time, and so are
their stretches step by step; hence those that meet a condition with a given stretch are
neighbours, found by bisection, and those that meet several conditions are the common part of
such ranges. Nothing is ever compared pair by pair.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import IndexArray
from mocapidx.queries.pattern import Pattern
from mocapidx.queries.source import Source, expand_ranges

__all__ = [
    "RELATIONS",
    "Condition",
    "Place",
    "Scene",
    "join_scene",
    "scene_spans",
]

RELATIONS: Final = ("overlaps", "during", "before", "near")
MOST_COMBINATIONS: Final = 5_000_000


@dataclass(frozen=True, slots=True)
class Place:
    """A stretch of a progression.

    Parameters
    ----------
    progression : int
        From 0.
    step : int or None
        From 0, open steps not counted; None: the whole progression.
    """

    progression: int
    step: int | None = None


@dataclass(frozen=True, slots=True)
class Condition:
    """What must hold between two stretches of one document.

    Parameters
    ----------
    one, other : Place
    relation : {"overlaps", "during", "before", "near"}
        They share a frame; `one` lies within `other`; `one` ends before `other` starts, or as it
        starts; at most `within` frames lie between them.
    within : int or None
        In frames. None with ``before``: `other` is the next one of its kind after `one`.
    """

    one: Place
    relation: str
    other: Place
    within: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Progressions and the conditions between them.

    Parameters
    ----------
    names : tuple of str
        Of the progressions.
    progressions : tuple of Pattern
    conditions : tuple of Condition

    Raises
    ------
    ParameterError
        If a condition names a step that is not there, or a progression is linked to no other.
    """

    names: tuple[str, ...]
    progressions: tuple[Pattern, ...]
    conditions: tuple[Condition, ...]

    def __post_init__(self) -> None:
        for condition in self.conditions:
            for place in (condition.one, condition.other):
                count = len(self.progressions[place.progression].steps)
                if place.step is not None and not 0 <= place.step < count:
                    raise ParameterError(
                        f"'{self.names[place.progression]}' has {count} steps, no step "
                        f"{place.step + 1}"
                    )
        linked = {0}
        for _ in self.conditions:
            for condition in self.conditions:
                ends = {condition.one.progression, condition.other.progression}
                linked |= ends if ends & linked else set()
        if loose := [name for i, name in enumerate(self.names) if i not in linked]:
            raise ParameterError(
                f"no condition links '{loose[0]}' to '{self.names[0]}', not even by way of others"
            )


Interval: TypeAlias = tuple[IndexArray, IndexArray]
Ranges: TypeAlias = tuple[IndexArray, IndexArray]


def join_scene(scene: Scene, tables: Sequence[IndexArray], source: Source) -> IndexArray:
    """Find the combinations of hits, one of each progression, that meet all conditions.

    Parameters
    ----------
    scene : Scene
    tables : sequence of ndarray of int64, each of shape (H, S + B)
        The hits of each progression as `mocapidx.queries.pattern.pattern_hits` gives them.
    source : Source
        Where the documents lie.

    Returns
    -------
    ndarray of int64, shape (N, P)
        Rows of the tables; ascending by the first, then by the second, and so on.

    Raises
    ------
    ParameterError
        If there are too many combinations to be of use.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 6.3.
    """
    count = len(tables)
    order = _order(scene, [len(table) for table in tables])
    rows: dict[int, IndexArray] = {}
    bound: list[Condition] = []
    for progression in order:
        touching = [c for c in scene.conditions if progression in _ends(c) and c not in bound]
        ready = [c for c in touching if _ends(c) <= {*rows, progression}]
        bound += ready
        within = [c for c in ready if _ends(c) == {progression}]
        between = [c for c in ready if _ends(c) != {progression}]
        if not rows:
            rows[progression] = np.arange(len(tables[progression]))
        else:
            owners, found = _extend(scene, tables, rows, progression, between, source)
            rows = {known: numbers[owners] for known, numbers in rows.items()}
            rows[progression] = found
        for condition in within:
            kept = _hold(scene, tables, rows[progression], condition)
            rows = {known: numbers[kept] for known, numbers in rows.items()}
    joined = np.stack([rows[progression] for progression in range(count)], axis=1)
    return joined[np.lexsort(joined.T[::-1])]


def scene_spans(scene: Scene, tables: Sequence[IndexArray], joined: IndexArray) -> IndexArray:
    """Give the time that each combination covers: all stretches that conditions name.

    Parameters
    ----------
    scene, tables
        As for `join_scene`.
    joined : ndarray of int64, shape (N, P)
        What it found.

    Returns
    -------
    ndarray of int64, shape (N, 2)
        Start and end in positions.
    """
    places = {place for c in scene.conditions for place in (c.one, c.other)} or {Place(0)}
    spans = [_interval(scene, tables, place, joined[:, place.progression]) for place in places]
    return np.stack(
        [
            np.min([starts for starts, _ in spans], axis=0),
            np.max([ends for _, ends in spans], axis=0),
        ],
        axis=1,
    )


def _ends(condition: Condition) -> set[int]:
    return {condition.one.progression, condition.other.progression}


def _order(scene: Scene, sizes: list[int]) -> list[int]:
    """Begin with the rarest progression; each other one has a condition with one before it."""
    order = [int(np.argmin(sizes))]
    while len(order) < len(sizes):
        linked = {p for c in scene.conditions for p in _ends(c) if _ends(c) & set(order)}
        order.append(min(linked - set(order), key=lambda progression: sizes[progression]))
    return order


def _interval(
    scene: Scene, tables: Sequence[IndexArray], place: Place, rows: IndexArray
) -> Interval:
    """Give start and end of a stretch of some hits of a progression, in positions."""
    table = tables[place.progression]
    if place.step is None:
        return table[rows, 0], table[rows, -1]
    stretches = scene.progressions[place.progression].stretches(table)[:, place.step]
    return stretches[rows, 0], stretches[rows, 1]


def _extend(
    scene: Scene,
    tables: Sequence[IndexArray],
    rows: dict[int, IndexArray],
    progression: int,
    conditions: Sequence[Condition],
    source: Source,
) -> tuple[IndexArray, IndexArray]:
    """Join the hits of one more progression: places of combinations, and rows of its table."""
    everyone = np.arange(len(tables[progression]))
    count = len(next(iter(rows.values())))
    low, high = np.zeros(count, np.int64), np.full(count, len(everyone))
    for condition in conditions:
        mine, yours = condition.one, condition.other
        if turned := mine.progression == progression:
            mine, yours = yours, mine
        known = _interval(scene, tables, mine, rows[mine.progression])
        fresh = _interval(scene, tables, yours, everyone)
        kin = _interval(scene, tables, mine, np.arange(len(tables[mine.progression])))
        first, last = _range(condition, turned, known, fresh, kin[0], source)
        low, high = np.maximum(low, first), np.minimum(high, last)
    high = np.maximum(low, high)
    if (high - low).sum() > MOST_COMBINATIONS:
        raise ParameterError(
            f"more than {MOST_COMBINATIONS} combinations of '{scene.names[progression]}' with the "
            "others meet the conditions; narrow them, such as by 'within'"
        )
    return expand_ranges(low, high)


def _range(
    condition: Condition,
    turned: bool,
    known: Interval,
    fresh: Interval,
    kin: IndexArray,
    source: Source,
) -> Ranges:
    """Find the fresh stretches, a range in their order, that meet a condition with each known one.

    `turned` says that the fresh one comes first in the condition; `kin` are the starts of all
    stretches of the same kind as the known ones.
    """
    starts, ends = known
    documents = source.document_at(starts)
    first = source.first[documents]
    last = first + source.lengths[documents]
    if condition.relation == "overlaps":
        return _search(fresh[1], starts, "right"), _search(fresh[0], ends, "left")
    if condition.relation == "during" and turned:
        return _search(fresh[0], starts, "left"), _search(fresh[1], ends, "right")
    if condition.relation == "during":
        return _search(fresh[1], ends, "left"), _search(fresh[0], starts, "right")
    if condition.relation == "near":
        reach = condition.within or 0
        low = _search(fresh[1], np.maximum(starts - reach, first), "left")
        return low, _search(fresh[0], np.minimum(ends + reach, last), "right")
    if turned:  # the fresh one ends before the known one starts
        if condition.within is None:  # and no other known one starts in between
            earliest = np.append(-1, kin)[_search(kin, starts, "left")] + 1
        else:
            earliest = starts - condition.within
        low = _search(fresh[1], np.maximum(earliest, first), "left")
        return low, _search(fresh[1], starts, "right")
    low = _search(fresh[0], ends, "left")
    if condition.within is not None:
        return low, _search(fresh[0], np.minimum(ends + condition.within, last), "right")
    following = np.append(fresh[0], np.iinfo(np.int64).max)[low]
    high = _search(fresh[0], following, "right")
    return low, np.where(following <= last, high, low)


def _search(ascending: IndexArray, values: IndexArray, side: str) -> IndexArray:
    found: IndexArray = np.searchsorted(ascending, values, "left" if side == "left" else "right")
    return found


def _hold(
    scene: Scene, tables: Sequence[IndexArray], rows: IndexArray, condition: Condition
) -> IndexArray:
    """Find the combinations whose two stretches of one progression meet a condition."""
    (start, end), (from_, to) = (
        _interval(scene, tables, place, rows) for place in (condition.one, condition.other)
    )
    apart = np.maximum(from_ - end, start - to)
    if condition.relation == "overlaps":
        return np.flatnonzero((start < to) & (from_ < end))
    if condition.relation == "during":
        return np.flatnonzero((from_ <= start) & (end <= to))
    if condition.relation == "near":
        return np.flatnonzero(apart <= (condition.within or 0))
    in_time = True if condition.within is None else from_ - end <= condition.within
    return np.flatnonzero((end <= from_) & in_time)
