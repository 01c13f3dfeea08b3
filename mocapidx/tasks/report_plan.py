"""How much of the documents a report holds, so that its page stays as small as asked for."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

__all__ = ["Plan", "Wanted", "plan_pieces"]

Wanted: TypeAlias = tuple[str, int, int]
"""A document, and a half-open stretch of its frames."""

POSE_BYTES: Final = 192
"""Of a frame on the page: 24 joints, 3 coordinates, 2 bytes, and a third more for base64."""

WORD_BYTES: Final = 8
HIT_BYTES: Final = 3000
"""Of a hit on the page but for its frames: still picture, names, alignment."""

BASE_BYTES: Final = 700_000
"""Of a page without hits: the library that draws, above all."""

AROUND: Final = 0.5
"""Seconds that are kept before and after a hit."""

JOINED: Final = 2.0
"""Seconds between two hits that are kept, too."""

WHOLE_SHARE: Final = 0.5
"""Takes are kept whole where they need at most this share of the page."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What a page holds.

    Parameters
    ----------
    hits : int
        How many, from the first.
    pieces : mapping of str to sequence of (int, int)
        For each document half-open stretches of its frames, ascending and apart.
    step : int
        Every so many poses are kept.
    whole : bool
        Whether every document is kept whole.
    """

    hits: int
    pieces: Mapping[str, Sequence[tuple[int, int]]]
    step: int
    whole: bool


def plan_pieces(
    wanted: Sequence[Wanted], frames: Mapping[str, int], rate: float, most_bytes: int
) -> Plan:
    """Choose what is kept: whole takes, else hits, else every other pose, else fewer hits.

    Parameters
    ----------
    wanted : sequence of (str, int, int)
        The hits, those that matter most first.
    frames : mapping of str to int
        How many each document has.
    rate : float
        In Hz.
    most_bytes : int
        Of the page.

    Returns
    -------
    Plan
        With at least one hit, if there is any.
    """
    room = most_bytes - BASE_BYTES - HIT_BYTES * len(wanted)
    documents = {name: [(0, frames[name])] for name, _, _ in wanted}
    if _bytes(documents, 1) <= WHOLE_SHARE * room:
        return Plan(len(wanted), documents, 1, whole=True)
    pieces = _pieces(wanted, frames, rate)
    for step in (1, 2):
        if _bytes(pieces, step) <= room:
            return Plan(len(wanted), pieces, step, whole=pieces == documents)
    low, high = 1, len(wanted)  # the first `low` fit, or are kept all the same
    while high - low > 1:
        middle = (low + high) // 2
        taken = _bytes(_pieces(wanted[:middle], frames, rate), 2) + HIT_BYTES * middle
        low, high = (middle, high) if taken <= most_bytes - BASE_BYTES else (low, middle)
    return Plan(low, _pieces(wanted[:low], frames, rate), 2, whole=False)


def _bytes(pieces: Mapping[str, Iterable[tuple[int, int]]], step: int) -> float:
    count = sum(end - start for own in pieces.values() for start, end in own)
    return count * (POSE_BYTES / step + WORD_BYTES)


def _pieces(
    wanted: Iterable[Wanted], frames: Mapping[str, int], rate: float
) -> dict[str, list[tuple[int, int]]]:
    around, joined = round(AROUND * rate), round(JOINED * rate)
    pieces: dict[str, list[tuple[int, int]]] = {}
    for name, start, end in sorted(wanted):
        own = pieces.setdefault(name, [])
        low, high = max(0, start - around), min(frames[name], end + around)
        if own and low - own[-1][1] <= joined:
            own[-1] = (own[-1][0], max(own[-1][1], high))
        else:
            own.append((low, high))
    return pieces
