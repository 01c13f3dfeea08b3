"""Keyframes: a few rows of a template that stand for the whole in a preselection.

Only where frames that agree with the keyframes, but for a few entries, follow one another within
the times that a match allows is the template matched. That can lose hits: a match may violate a
keyframe, or pass it over.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, IndexArray, WordArray
from mocapidx.queries.stretches import Stretches, intersect_stretches
from mocapidx.templates.match import end_padding
from mocapidx.templates.quantise import Quantised
from mocapidx.templates.thresholds import Clip

__all__ = ["TOLERANCE", "Keyframes", "Pieces", "choose_keyframes", "learn_keyframes", "preselect"]

TOLERANCE: Final = 3
"""Disagreeing entries at which most hits are kept; exact agreement loses most of them."""

BLOCK: Final = 1 << 14  # frames that are compared together
USUAL_COUNT: Final = 2
CANDIDATES: Final = 8  # rows among which keyframes are learned
TOLERANCES: Final = range(6)
MARGIN: Final = 1  # entries by which unseen people may disagree more than the examples left out


@dataclass(frozen=True, slots=True)
class Keyframes:
    """Rows of a template for a preselection.

    Parameters
    ----------
    rows : tuple of int
        From 0, ascending.
    tolerance : int
        Consistent entries of each row that may disagree.
    """

    rows: tuple[int, ...]
    tolerance: int = TOLERANCE


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Parts of documents in which a template can match.

    Parameters
    ----------
    documents : ndarray of int64, shape (P,)
        Number of the document, from 0.
    starts, ends : ndarray of int64, shape (P,)
        In frames of the document, half open; ascending, no two of a document touch.
    """

    documents: IndexArray
    starts: IndexArray
    ends: IndexArray

    def of(self, documents: IndexArray) -> "Pieces":
        """Leave the pieces of some documents."""
        kept = np.isin(self.documents, documents)
        return Pieces(self.documents[kept], self.starts[kept], self.ends[kept])


def choose_keyframes(
    quantised: Quantised, count: int = USUAL_COUNT, tolerance: int = TOLERANCE
) -> Keyframes:
    """Choose rows with many ones and few undecided entries, apart from one another.

    Parameters
    ----------
    quantised : Quantised
    count : int
        Rows to choose; a short template has fewer.
    tolerance : int
        Goes into the result.

    Returns
    -------
    Keyframes

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, section 5.4.
    """
    return Keyframes(_best_rows(quantised, count), tolerance)


def _best_rows(quantised: Quantised, count: int) -> tuple[int, ...]:
    score = np.bitwise_count(quantised.ones).astype(np.int64) + quantised.counts
    distance = max(1, len(score) // (2 * count))
    free = np.ones(len(score), dtype=bool)
    rows: list[int] = []
    while len(rows) < count and free.any():
        best = np.flatnonzero(free & (score == score[free].max()))
        row = int(best[len(best) // 2])  # the middle of equals is the safest
        free[max(0, row - distance) : row + distance + 1] = False
        rows.append(row)
    return tuple(sorted(rows))


def preselect(
    quantised: Quantised,
    keyframes: Keyframes,
    words: WordArray,
    bounds: IndexArray,
    padded: bool,
) -> Pieces:
    """Find the parts of documents where the keyframes follow one another in time.

    Neighbouring keyframes lie between half and twice as far apart as in the template, since a
    match is between half and twice as fast.

    Parameters
    ----------
    quantised : Quantised
    keyframes : Keyframes
        At least one row.
    words : ndarray of uint64, shape (T,)
        The feature words of the documents, end to end.
    bounds : ndarray of int64, shape (D + 1,)
        Where documents begin and end; none is empty.
    padded : bool
        Whether matching will repeat the first and the last frame of a document.

    Returns
    -------
    Pieces

    Raises
    ------
    ParameterError
        If a row is not one of the template's, or there is none.
    """
    rows, last = keyframes.rows, len(quantised.ones) - 1
    if not rows or list(rows) != sorted({*rows} & {*range(last + 1)}):
        raise ParameterError(
            f"keyframes must be different, ascending and from 0 to {last}, got {list(rows)}"
        )
    room = 8 * (last + 1)  # more than a match and its padding reach beyond a document
    lengths = np.diff(bounds)
    padding = end_padding(lengths, last + 1) if padded else np.zeros_like(lengths)
    held = [
        _roomy(_agreeing(quantised, row, keyframes.tolerance, words, bounds), bounds, padding, room)
        for row in rows
    ]
    gaps = [((b - a + 1) // 2, 2 * (b - a)) for a, b in itertools.pairwise(rows)]
    for place, (least, most) in enumerate(gaps):
        held[place + 1] = intersect_stretches(held[place + 1], _moved(held[place], least, most))
    for place, (least, most) in reversed(list(enumerate(gaps))):
        held[place] = intersect_stretches(held[place], _moved(held[place + 1], -most, -least))
    around = [
        _moved(stretches, -2 * row, 2 * (last - row))
        for row, stretches in zip(rows, held, strict=True)
    ]
    whole = around[0]
    for other in around[1:]:
        whole = intersect_stretches(whole, other)
    return _pieces(whole, bounds, room)


def _agreeing(
    quantised: Quantised, row: int, tolerance: int, words: WordArray, bounds: IndexArray
) -> Stretches:
    """Stretches of frames, each of one document, that disagree with a row in few entries only."""
    ones, care = quantised.ones[row], quantised.care[row]
    agrees = np.empty(len(words), np.bool_)
    for begin in range(0, len(words), BLOCK):
        block = slice(begin, begin + BLOCK)
        np.less_equal(np.bitwise_count((words[block] ^ ones) & care), tolerance, out=agrees[block])
    opens = np.diff(agrees, prepend=False)
    closes = np.diff(agrees, append=False)
    opens[bounds[:-1]] = agrees[bounds[:-1]]
    closes[bounds[1:] - 1] = agrees[bounds[1:] - 1]
    return Stretches(np.flatnonzero(opens & agrees), np.flatnonzero(closes & agrees) + 1)


def _roomy(stretches: Stretches, bounds: IndexArray, padding: IndexArray, room: int) -> Stretches:
    """Move documents apart, and let what holds at their ends hold in the padding too."""
    document = np.searchsorted(bounds, stretches.starts, "right") - 1
    at_start = stretches.starts == bounds[document]
    at_end = stretches.ends == bounds[document + 1]
    starts = stretches.starts - np.where(at_start, padding[document], 0)
    ends = stretches.ends + np.where(at_end, padding[document], 0)
    return Stretches(starts + room * document, ends + room * document)


def _moved(stretches: Stretches, least: int, most: int) -> Stretches:
    """Where frames lie that are `least` to `most` after a frame of the stretches."""
    starts, ends = stretches.starts + least, np.maximum.accumulate(stretches.ends + most)
    apart = np.flatnonzero(starts[1:] > ends[:-1])
    if not len(starts):
        return stretches
    return Stretches(starts[np.append(0, apart + 1)], ends[np.append(apart, len(ends) - 1)])


def _pieces(whole: Stretches, bounds: IndexArray, room: int) -> Pieces:
    spread = bounds[:-1] + room * np.arange(len(bounds) - 1)
    document = np.searchsorted(spread - room // 2, whole.starts, "right") - 1
    starts = np.maximum(whole.starts - spread[document], 0)
    ends = np.minimum(whole.ends - spread[document], np.diff(bounds)[document])
    kept = starts < ends
    return Pieces(document[kept], starts[kept], ends[kept])


def learn_keyframes(
    quantised: Quantised,
    held_out: Iterable[tuple[Quantised, Sequence[Clip]]],
    background: Sequence[Clip],
) -> Keyframes | None:
    """Choose the keyframes that keep the examples and cut the background most.

    Parameters
    ----------
    quantised : Quantised
        The template.
    held_out : iterable of (Quantised, sequence of Clip)
        Templates learned without some of the examples, each with the examples left out.
    background : sequence of Clip
        Motion of other classes.

    Returns
    -------
    Keyframes or None
        One or two rows; None where there is nothing to judge them by. First counts how many
        examples are lost, then the share of the background that is kept, in hundredths, then
        the tolerance (a larger one is safer).
    """
    gap = 2 * len(quantised.ones)
    examples = [
        (own, _lay_out(clips, 2 * max(len(own.ones), len(quantised.ones))))
        for own, clips in held_out
        if len(clips)
    ]
    if not examples or not len(background):
        return None
    others = _lay_out(background, gap)
    rows = _candidates(quantised)
    numbers = range(len(rows))
    choices = [*itertools.combinations(numbers, 1), *itertools.combinations(numbers, 2)]
    best: tuple[tuple[float, ...], Keyframes] | None = None
    for tolerance in TOLERANCES:
        kept = np.zeros(len(choices), dtype=np.int64)
        for own, clips in examples:
            scaled = [_scaled(row, len(quantised.ones), len(own.ones)) for row in rows]
            kept += (_kept_frames(own, scaled, choices, tolerance, clips) > 0).sum(axis=1)
        left = _kept_frames(quantised, rows, choices, tolerance + MARGIN, others).sum(axis=1)
        shares = np.round(left / others.real.sum(), 2)
        for choice, held, share in zip(choices, kept.tolist(), shares.tolist(), strict=True):
            merit = (-held, share, -tolerance, len(choice))
            if best is None or merit < best[0]:
                picked = tuple(rows[number] for number in choice)
                best = merit, Keyframes(picked, tolerance + MARGIN)
    return best[1] if best else None


def _candidates(quantised: Quantised) -> list[int]:
    """Give the best row of each stretch of the template."""
    bounds = np.unique(np.linspace(0, len(quantised.ones), CANDIDATES + 1).astype(np.int64))
    rows = []
    for low, high in itertools.pairwise(bounds.tolist()):
        piece = Quantised(
            quantised.ones[low:high], quantised.care[low:high], quantised.counts[low:high]
        )
        rows.append(low + _best_rows(piece, 1)[0])
    return rows


def _scaled(row: int, length: int, other_length: int) -> int:
    """Give the row of a template of another length that stands at the same time."""
    return round(row * (other_length - 1) / max(length - 1, 1))


@dataclass(frozen=True, slots=True, eq=False)
class _Laid:
    """Clips end to end, so far apart that no match reaches from one to the next.

    `words` and `untrusted` have one entry a frame; clip ``n`` begins at ``firsts[n]``, and frames
    outside of clips are not `real`.
    """

    words: WordArray
    untrusted: WordArray
    real: BoolArray
    firsts: IndexArray


def _lay_out(clips: Sequence[Clip], gap: int) -> _Laid:
    lengths = np.array([len(clip.words) for clip in clips])
    firsts = np.cumsum(lengths + gap) - lengths - gap
    real = np.zeros(int((lengths + gap).sum()), dtype=bool)
    words, untrusted = np.zeros((2, len(real)), dtype=np.uint64)
    for clip, first, length in zip(clips, firsts.tolist(), lengths.tolist(), strict=True):
        here = slice(first, first + length)
        real[here], words[here], untrusted[here] = True, clip.words, np.uint64(clip.untrusted)
    return _Laid(words, untrusted, real, firsts)


def _kept_frames(
    quantised: Quantised,
    rows: Sequence[int],
    choices: Sequence[tuple[int, ...]],
    tolerance: int,
    clips: _Laid,
) -> IndexArray:
    """Frames of each clip that each choice among the rows keeps, shape (choices, clips)."""
    last = len(quantised.ones) - 1
    agreeing = []
    for row in rows:
        care = quantised.care[row] & ~clips.untrusted
        differing = np.bitwise_count((clips.words ^ quantised.ones[row]) & care)
        agreeing.append((differing <= tolerance) & clips.real)
    counts = np.zeros((len(choices), len(clips.firsts)), dtype=np.int64)
    for place, choice in enumerate(choices):
        held = agreeing[choice[0]]
        if len(choice) > 1:
            gap = rows[choice[1]] - rows[choice[0]]
            held = held & _within(agreeing[choice[1]], (gap + 1) // 2, 2 * gap)
        around = _within(held, -2 * (last - rows[choice[0]]), 2 * rows[choice[0]]) & clips.real
        counts[place] = np.add.reduceat(around, clips.firsts, dtype=np.int64)
    return counts


def _within(held: BoolArray, least: int, most: int) -> BoolArray:
    """Tell for each frame whether one that is `least` to `most` after it is held."""
    # One more than there are frames, and the ends repeated so that no place lies outside.
    before, after = max(-least, -most - 1, 0), max(least, most + 1, 0)
    sums = np.zeros(before + 1 + len(held) + after, dtype=np.int32)
    np.cumsum(held, out=sums[before + 1 : before + 1 + len(held)])
    sums[before + 1 + len(held) :] = sums[before + len(held)]
    low, high = before + least, before + most + 1
    return np.asarray(sums[high : high + len(held)] > sums[low : low + len(held)])
