"""The hits of a query that are shown: ordered, and each stretch once."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocapidx.model import Hit
from mocapidx.queries.rank import ranking_order
from mocapidx.tasks.answers import Answer, Archive
from mocapidx.tasks.hits import make_hit

__all__ = ["Chosen", "best"]


@dataclass(frozen=True, slots=True, eq=False)
class Chosen:
    """A hit that is shown, and where it comes from.

    Parameters
    ----------
    hit : Hit
    answer : Answer
    row : int
        Its place in the answer.
    """

    hit: Hit
    answer: Answer
    row: int


def best(
    archive: Archive, answers: Sequence[Answer], top: int | None, *, apart: bool = False
) -> list[Chosen]:
    """Order hits by cost, document name and time; keep one of those that are the same.

    Parameters
    ----------
    archive : Archive
    answers : sequence of Answer
        Of two that hold the same stretch the better one is kept, of equal costs the first.
    top : int, optional
        Keep the best only.
    apart : bool
        Keep only the best of hits that overlap.

    Returns
    -------
    list of Chosen
        Best first.
    """
    if not answers:
        return []
    names = [
        answer.place.file.documents[number].name
        for answer in answers
        for number in answer.documents.tolist()
    ]
    spans = np.concatenate([answer.spans for answer in answers])
    costs = np.concatenate([answer.costs for answer in answers])
    ends = np.cumsum([len(answer.documents) for answer in answers])
    chosen: list[Chosen] = []
    seen = _Apart() if apart else _Different()
    for place in ranking_order(costs, names, spans[:, 0], spans[:, 1]):
        if top is not None and len(chosen) >= top:
            break
        start, end = spans[place].tolist()
        if seen.takes(names[place], start, end):
            owner = int(np.searchsorted(ends, place, "right"))
            answer = answers[owner]
            row = int(place - ends[owner]) + len(answer.documents)
            document = answer.place.file.documents[answer.documents[row]]
            cost = float(costs[place])
            hit = make_hit(document, start, end, archive.rate, cost, answer.label)
            chosen.append(Chosen(hit, answer, row))
    return chosen


class _Different:
    """Takes each stretch once."""

    def __init__(self) -> None:
        self.seen: set[tuple[str, int, int]] = set()

    def takes(self, document: str, start: int, end: int) -> bool:
        count = len(self.seen)
        self.seen.add((document, start, end))
        return len(self.seen) > count


class _Apart:
    """Takes stretches that overlap none that was taken before."""

    def __init__(self) -> None:
        self.taken: dict[str, list[tuple[int, int]]] = {}

    def takes(self, document: str, start: int, end: int) -> bool:
        taken = self.taken.setdefault(document, [])
        place = bisect_left(taken, (end, 0))
        if place and taken[place - 1][1] > start:
            return False
        taken.insert(place, (start, end))
        return True
