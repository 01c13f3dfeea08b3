"""Subsequence dynamic time warping of quantised templates against packed feature words.

The steps are (1, 1), (2, 1), (1, 2), so a row of the cost matrix depends on the two rows before
it only: one pass of whole-array operations for each row of the template. The compiled kernel
``matching.c`` does the same with the same bits.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.kernels.choice import compiled
from mocapidx.model import IndexArray, WordArray

__all__ = [
    "CostArray",
    "Steps",
    "many_subsequence_costs",
    "shortest_match",
    "subsequence_costs",
    "subsequence_starts",
]

Steps: TypeAlias = Literal["weighted", "printed"]
"""Whether the step (2, 1), which passes over a row of the template, pays twice or once."""

CostArray: TypeAlias = NDArray[np.float32]

BLOCK = 32768  # frames; three rows of costs and the words stay in the second-level cache
INFINITE = np.float32(np.inf)
NO_FRAMES = np.empty(0, dtype=np.int64)

LEVEL: str | None = None
"""The instructions that the kernel uses: by default the fastest that this processor has."""

MOST_TRACED: Final = 1024
"""Rows of a template whose sums the kernel keeps to find the way back through them."""

FRAMES_A_THREAD: Final = 1 << 15
"""With fewer, a thread takes longer to start than to do its share."""


def shortest_match(rows: int) -> int:
    """Return the fewest frames that a template of so many rows can match."""
    return rows // 2 + 1


def subsequence_costs(
    ones: WordArray,
    care: WordArray,
    words: WordArray,
    breaks: IndexArray | None = None,
    steps: Steps = "weighted",
    threads: int = 1,
) -> CostArray:
    """Cost of the best match of a template that ends at each frame.

    The local cost is the share of the consistent features of a row that disagree, 0 where a row
    has none. All arithmetic is float32 in the fixed order c + min(diagonal, one row and two
    frames, two rows and one frame), so that every implementation gives the same bits, whatever
    blocks it works in.

    Parameters
    ----------
    ones, care : ndarray of uint64, shape (K,)
        The features that are consistently 1, and those that are consistent at all.
    words : ndarray of uint64, shape (L,)
        Feature words; several documents may stand end to end.
    breaks : ndarray of int64, optional
        Frames that no match touches, ascending; two in a row keep documents apart.
    steps : {"weighted", "printed"}
        Whether the step (2, 1) pays twice for the cell that it leads to, or once as printed in
        the paper, where it passes over rows of the template for nothing.
    threads : int
        Share the frames among so many threads; changes nothing in the result.

    Returns
    -------
    ndarray of float32, shape (L,)
        Total cost divided by K; infinite where no match can end.

    Raises
    ------
    ParameterError
        If `steps` is neither of the two, or the template has no rows.

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, section 5.2, equations (1) and (2).
    """
    return many_subsequence_costs([(ones, care)], words, [breaks], steps, threads).ravel()


def many_subsequence_costs(
    templates: Sequence[tuple[WordArray, WordArray]],
    words: WordArray,
    breaks: Sequence[IndexArray | None],
    steps: Steps = "weighted",
    threads: int = 1,
) -> CostArray:
    """Costs of the best matches of several templates that end at each frame.

    All templates go over a block of frames while its words lie in the processor's cache.

    Parameters
    ----------
    templates : sequence of pair of ndarray of uint64, each of its own shape (K,)
        `ones` and `care` as for `subsequence_costs`.
    words : ndarray of uint64, shape (L,)
    breaks : sequence of ndarray of int64 or None
        Of each template.
    steps : {"weighted", "printed"}
    threads : int
        As for `subsequence_costs`.

    Returns
    -------
    ndarray of float32, shape (M, L)
        One row a template.

    Raises
    ------
    ParameterError
        As `subsequence_costs`.
    """
    for ones, _ in templates:
        _check(ones, steps)
    costs = np.empty((len(templates), len(words)), dtype=np.float32)
    without_none = [NO_FRAMES if each is None else each for each in breaks]
    fill = _filling(templates, words, without_none, steps == "weighted", costs)
    shares = min(threads, len(words) // FRAMES_A_THREAD)
    if shares < 2:
        fill(0, len(words))
        return costs
    # Imported where it pays: it takes longer than a short match.
    from concurrent.futures import ThreadPoolExecutor

    cuts = [len(words) * share // shares for share in range(shares + 1)]
    with ThreadPoolExecutor(shares) as pool:
        list(pool.map(fill, cuts[:-1], cuts[1:]))
    return costs


def _filling(
    templates: Sequence[tuple[WordArray, WordArray]],
    words: WordArray,
    breaks: Sequence[IndexArray],
    weighted: bool,
    costs: CostArray,
) -> Callable[[int, int], None]:
    """Give what fills the costs of all templates from one frame up to another."""
    kernel = compiled("matching")
    if kernel is None:
        return partial(_fill, templates, words, breaks, weighted, costs)
    ones, care = (
        np.concatenate([template[side] for template in templates], dtype=np.uint64)
        for side in range(2)
    )
    rows, ends = (
        np.cumsum([0, *map(len, each)], dtype=np.int64)
        for each in ([one for one, _ in templates], breaks)
    )
    laid_breaks = np.concatenate(breaks, dtype=np.int64)
    words = np.ascontiguousarray(words, dtype=np.uint64)

    def fill(begin: int, end: int) -> None:
        kernel.match(ones, care, rows, words, laid_breaks, ends, weighted, costs, begin, end, LEVEL)

    return fill


def _fill(
    templates: Sequence[tuple[WordArray, WordArray]],
    words: WordArray,
    breaks: Sequence[IndexArray],
    weighted: bool,
    costs: CostArray,
    first: int,
    last: int,
) -> None:
    for (ones, care), own_breaks, own_costs in zip(templates, breaks, costs, strict=True):
        overlap = 2 * (len(ones) - 1)  # no match is longer
        for begin in range(first, last, BLOCK):
            low, high = max(0, begin - overlap), min(last, begin + BLOCK)
            inside = _within(own_breaks, low, high)
            row = _last_row(ones, care, words[low:high], inside, weighted)[begin - low :]
            np.divide(row, np.float32(len(ones)), out=own_costs[begin:high])


def _check(ones: WordArray, steps: str) -> None:
    if steps not in ("weighted", "printed"):
        raise ParameterError(f"steps must be 'weighted' or 'printed', got '{steps}'")
    if not len(ones):
        raise ParameterError("the template has no rows")


def _within(breaks: IndexArray, low: int, high: int) -> IndexArray:
    first, last = np.searchsorted(breaks, (low, high))
    return breaks[first:last] - low


def _last_row(
    ones: WordArray, care: WordArray, words: WordArray, breaks: IndexArray, weighted: bool
) -> CostArray:
    """Last row of the accumulated costs over one block of frames."""
    # Two infinite frames before the first stand for everything that lies before the block.
    two_rows_up, one_row_up, row = np.full((3, len(words) + 2), INFINITE, dtype=np.float32)
    gaps = np.empty_like(words)
    differing = np.empty(len(words), dtype=np.uint8)
    cost = np.zeros(len(words), dtype=np.float32)
    skipping = np.empty_like(cost)
    counts = np.bitwise_count(care)
    for k in range(len(ones)):
        if k == 0 or ones[k] != ones[k - 1] or care[k] != care[k - 1]:
            np.bitwise_xor(words, ones[k], out=gaps)
            np.bitwise_and(gaps, care[k], out=gaps)
            np.bitwise_count(gaps, out=differing)
            cost[:] = differing
            np.divide(cost, np.float32(max(counts[k], 1)), out=cost)
        here = row[2:]
        if k == 0:
            here[:] = cost
        else:
            skipped = two_rows_up[1:-1]
            if weighted:
                skipped = np.add(skipped, cost, out=skipping)
            np.minimum(one_row_up[1:-1], one_row_up[:-2], out=here)
            np.minimum(here, skipped, out=here)
            np.add(here, cost, out=here)
        here[breaks] = INFINITE
        two_rows_up, one_row_up, row = one_row_up, row, two_rows_up
    return one_row_up[2:]


def subsequence_starts(
    ones: WordArray,
    care: WordArray,
    words: WordArray,
    ends: IndexArray,
    breaks: IndexArray | None = None,
    steps: Steps = "weighted",
) -> IndexArray:
    """First frame of a best match for each of some last frames.

    Many paths tie; the one is taken that prefers, going back from the end, one row and one
    frame, then one row and two frames, then two rows and one frame.

    Parameters
    ----------
    ones, care, words, breaks, steps
        As in `subsequence_costs`.
    ends : ndarray of int64, shape (H,)
        Frames at which a match ends.

    Returns
    -------
    ndarray of int64, shape (H,)
        -1 where no match ends.

    Raises
    ------
    ParameterError
        As `subsequence_costs`.
    """
    _check(ones, steps)
    kernel = compiled("matching")
    if kernel is not None and len(ones) <= MOST_TRACED:
        given = [np.ascontiguousarray(each, dtype=np.uint64) for each in (ones, care, words)]
        frames = [
            np.ascontiguousarray(each, dtype=np.int64)
            for each in (NO_FRAMES if breaks is None else breaks, ends)
        ]
        traced = np.empty(len(ends), dtype=np.int64)
        kernel.starts(*given, frames[0], steps == "weighted", frames[1], traced, LEVEL)
        return traced
    window = 2 * len(ones) - 1
    # Only the frames that matches with these ends can touch; what else comes to stand side by
    # side there is farther from every end than a match is long.
    changes = np.zeros(len(words) + 1, dtype=np.int64)
    np.add.at(changes, np.maximum(ends - window + 1, 0), 1)
    np.add.at(changes, ends + 1, -1)
    touched = np.flatnonzero(np.cumsum(changes[:-1]))
    breaks = (
        NO_FRAMES
        if breaks is None
        else np.flatnonzero(np.isin(touched, breaks, assume_unique=True))
    )
    wanted = np.searchsorted(touched, ends)
    starts = np.full(len(ends), -1, dtype=np.int64)
    for begin in range(0, len(touched), BLOCK):
        low, high = max(0, begin - window + 1), min(len(touched), begin + BLOCK)
        here = np.flatnonzero((wanted >= begin) & (wanted < high))
        if not len(here):
            continue
        inside = _within(breaks, low, high)
        origins = _origins(ones, care, words[touched[low:high]], inside, steps == "weighted")
        found = origins[wanted[here] - low]
        starts[here] = np.where(found < 0, -1, touched[np.maximum(found, 0) + low])
    return starts


def _origins(
    ones: WordArray, care: WordArray, words: WordArray, breaks: IndexArray, weighted: bool
) -> NDArray[np.int32]:
    """First frames of the best matches that end at each frame of a block, -1 for none."""
    two_rows_up, one_row_up, row = np.full((3, len(words) + 2), INFINITE, dtype=np.float32)
    from_two_up, from_one_up, origin = np.full((3, len(words) + 2), -1, dtype=np.int32)
    counts = np.bitwise_count(care)
    for k in range(len(ones)):
        cost = np.bitwise_count((words ^ ones[k]) & care[k]).astype(np.float32)
        cost /= np.float32(max(counts[k], 1))
        here, source = row[2:], origin[2:]
        if k == 0:
            here[:], source[:] = cost, np.arange(len(words))
        else:
            skipped = two_rows_up[1:-1] + cost if weighted else two_rows_up[1:-1]
            here[:], source[:] = one_row_up[1:-1], from_one_up[1:-1]
            for other, other_source in (
                (one_row_up[:-2], from_one_up[:-2]),
                (skipped, from_two_up[1:-1]),
            ):
                better = other < here
                np.minimum(here, other, out=here)
                source += (other_source - source) * better  # far faster than a masked copy
            np.add(here, cost, out=here)
        here[breaks] = INFINITE
        two_rows_up, one_row_up, row = one_row_up, row, two_rows_up
        from_two_up, from_one_up, origin = from_one_up, origin, from_two_up
    return np.where(np.isfinite(one_row_up[2:]), from_one_up[2:], -1)
