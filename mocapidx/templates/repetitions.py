"""Learn from labels that cover several repetitions of a movement.

"Squats from 12 s to 19 s" says neither where a squat begins nor how long one is. The period of
such a stretch is found by comparing it with itself; a first template, one period long, is looped
along the stretch, the stretch is cut where the loop begins again, and the cuts are the examples
from which the next template is learned.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocapidx.alignment.dtw import LONGEST_SEQUENCE
from mocapidx.alignment.loops import align_loops, byte_tables, join_loops
from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.words import pack_words, unpack_words
from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray
from mocapidx.templates.learn import Learned, learn_template
from mocapidx.templates.path import surprise_tables

__all__ = [
    "Repetitions",
    "cut_passes",
    "find_period",
    "learn_repetitions",
    "learn_stretch",
    "loop_align",
    "self_distances",
]

SHORTEST_PERIOD = 0.4  # seconds
LONGEST_PERIOD = 5.0  # seconds
MOST_CANDIDATES = 12
TOLERATED_FACTOR, TOLERATED_GAP = 1.15, 0.003  # a shorter period may be this much worse
MOST_LEFT = 0.6  # share of the differences within a motion that its period may leave unexplained
SHORTEST_PASS = 4  # frames
LEAST_PHASES = 0.6  # share of the template that a pass must cover
MOST_EXAMPLES = 100  # passes that a template is learned from; work grows with their square
ROUNDS = 3
CLASS_ROUNDS = 2


@dataclass(frozen=True, slots=True, eq=False)
class Repetitions:
    """What was learned from stretches of one class.

    Parameters
    ----------
    stretches : tuple of Learned
        One template for each stretch: one period of it, or all of it where it has none.
    combined : Learned
        One template from the repetitions of all stretches.
    periods : tuple of (int or None)
        In frames; None where a stretch has no period and counts as one repetition.
    passes : tuple of tuple of (int, int)
        For each stretch the repetitions found in it: start and end in frames, end exclusive.
    """

    stretches: tuple[Learned, ...]
    combined: Learned
    periods: tuple[int | None, ...]
    passes: tuple[tuple[tuple[int, int], ...], ...]


def self_distances(words: WordArray, longest: int) -> FloatArray:
    """Mean number of features in which a motion differs from itself, shifted.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
    longest : int
        Longest shift in frames, less than T.

    Returns
    -------
    ndarray of float64, shape (longest + 1,)
        At index p for a shift by p frames.
    """
    shifts = range(1, longest + 1)
    return np.array([0.0] + [np.bitwise_count(words[p:] ^ words[:-p]).mean() for p in shifts])


def find_period(words: WordArray, features: int, rate: float = 30.0) -> int | None:
    """Find the time after which a motion repeats itself.

    Candidates are the shifts at which the motion is most like itself; for each the stretch that
    agrees best with what follows it is looped along all of the motion. The shortest that
    explains the motion about as well as the best is the period.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
    features : int
        Number of features in a word.
    rate : float
        Frames a second, in Hz; periods are looked for between 0.4 s and 5 s.

    Returns
    -------
    int or None
        In frames; None if there is no candidate, or if looping explains less than two fifths of
        the differences between any two frames.
    """
    longest = min(round(LONGEST_PERIOD * rate), 2 * len(words) // 3)
    candidates = _candidates(words, longest, round(SHORTEST_PERIOD * rate))
    if not candidates:
        return None
    seeds = [_best_seed(words, period) for period in candidates]
    patterns = [words[seed : seed + period] for seed, period in zip(seeds, candidates, strict=True)]
    columns = np.concatenate(patterns)
    bits = columns[:, None] >> np.arange(features, dtype=np.uint64) & np.uint64(1)
    tables = byte_tables(bits.astype(np.float64), 1.0 - bits)
    paths = align_loops(words, tables, join_loops(candidates))
    costs = []
    for path, seed, period in zip(paths, seeds, candidates, strict=True):
        differences = np.bitwise_count(words ^ columns[path])
        outside = np.delete(differences, np.s_[seed : seed + period])
        costs.append(outside.mean() / features)
    limit = TOLERATED_FACTOR * min(costs) + TOLERATED_GAP
    period, cost = min((p, c) for p, c in zip(candidates, costs, strict=True) if c <= limit)
    ones = unpack_words(words, features).mean(axis=0)
    return period if cost <= MOST_LEFT * np.mean(2 * ones * (1 - ones)) else None


def _candidates(words: WordArray, longest: int, shortest: int) -> list[int]:
    """Return the deepest local minima of the self distances; plateaus by where they begin."""
    if longest <= shortest:
        return []
    distances = self_distances(words, longest)
    starts = np.flatnonzero(np.diff(distances, prepend=-1.0))  # of plateaus
    levels = distances[starts]
    inner = np.flatnonzero((levels[1:-1] < levels[:-2]) & (levels[1:-1] < levels[2:])) + 1
    minima = [int(p) for p in starts[inner] if p >= shortest]
    return sorted(minima, key=lambda p: (distances[p], p))[:MOST_CANDIDATES]


def _best_seed(words: WordArray, period: int) -> int:
    """Return the start of the window of one period that agrees best with the period after it.

    Where the motion is shorter than two periods, with as much of it as there is.
    """
    differences = np.bitwise_count(words[period:] ^ words[:-period]).astype(np.int64)
    window = min(period, len(differences))
    sums = np.concatenate(([0], np.cumsum(differences)))
    return int(np.argmin(sums[window:] - sums[:-window]))


def loop_align(words: WordArray, matrix: FloatArray) -> IndexArray:
    """Loop one template along a motion as cheaply as it can be.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
    matrix : ndarray of float, shape (K, F)
        A template.

    Returns
    -------
    ndarray of int64, shape (T,)
        The template's column at each frame: the phase.
    """
    phases: IndexArray = align_loops(words, surprise_tables(matrix), join_loops([len(matrix)]))[0]
    return phases


def cut_passes(phases: IndexArray, length: int) -> list[tuple[int, int]]:
    """Cut a motion where its phase falls: where a loop begins again.

    Parameters
    ----------
    phases : ndarray of int64, shape (T,)
        Column of the template at each frame.
    length : int
        Columns of the template.

    Returns
    -------
    list of (int, int)
        Start and end of each pass in frames, end exclusive. Those that cover less than 60 % of
        the template or have less than four frames are left out.
    """
    cuts = np.flatnonzero(np.diff(phases) < -length / 2) + 1
    edges = [0, *cuts.tolist(), len(phases)]
    return [
        (start, end)
        for start, end in itertools.pairwise(edges)
        if end - start >= SHORTEST_PASS
        and phases[end - 1] - phases[start] + 1 >= LEAST_PHASES * length
    ]


def learn_stretch(
    features: BoolArray, rate: float = 30.0, where: str = "the stretch"
) -> tuple[Learned, int | None, tuple[tuple[int, int], ...]]:
    """Learn one repetition from a stretch that holds several.

    Parameters
    ----------
    features : ndarray of bool, shape (T, F)
        At least three frames.
    rate : float
        Frames a second, in Hz.
    where : str
        What an error calls the stretch.

    Returns
    -------
    template : Learned
        Of one period; of the whole stretch where there is none.
    period : int or None
        In frames.
    passes : tuple of (int, int)
        The repetitions found: start and end in frames, end exclusive.

    Raises
    ------
    ParameterError
        If there are fewer than three frames.
    FormatError
        If it has no period and is too long to be one repetition.
    """
    words = pack_words(features)
    period = find_period(words, features.shape[1], rate)
    if period is None:
        return _one_repetition(features, rate, where)
    seed = _best_seed(words, period)
    matrix: FloatArray = features[seed : seed + period].astype(np.float64)
    learned, passes = None, None
    for _ in range(ROUNDS):
        found = cut_passes(loop_align(words, matrix), len(matrix))
        if not found or found == passes:
            break
        passes = found
        learned = learn_template(_examples([features[start:end] for start, end in passes]))
        matrix = learned.matrix
    if learned is None or passes is None:
        return _one_repetition(features, rate, where)
    return learned, period, tuple(passes)


def _one_repetition(
    features: BoolArray, rate: float, where: str
) -> tuple[Learned, None, tuple[tuple[int, int], ...]]:
    if len(features) > LONGEST_SEQUENCE:
        raise FormatError(
            f"{where}: no repetitions were found in {len(features) / rate:.0f} s, and one "
            f"repetition lasts at most {LONGEST_SEQUENCE / rate:.0f} s; label shorter parts of it"
        )
    return learn_template([features]), None, ((0, len(features)),)


def _examples(passes: Sequence[BoolArray]) -> list[BoolArray]:
    """Choose from very many passes some that are spread evenly over all."""
    wanted = min(len(passes), MOST_EXAMPLES)
    return [passes[number * len(passes) // wanted] for number in range(wanted)]


def learn_repetitions(
    stretches: Sequence[BoolArray], rate: float = 30.0, where: Sequence[str] = ()
) -> Repetitions:
    """Learn a class from stretches that hold unknown numbers of repetitions.

    Each stretch gives a template; the one that explains all stretches most cheaply is looped
    along all of them, and one more template is learned from all the repetitions that it cuts.

    Parameters
    ----------
    stretches : sequence of ndarray of bool, shape (T, F)
        At least one; each at least three frames long.
    rate : float
        Frames a second, in Hz.
    where : sequence of str
        What an error calls each stretch.

    Returns
    -------
    Repetitions

    Raises
    ------
    ParameterError
        If there is no stretch, or one has fewer than three frames.
    FormatError
        If one has no period and is too long to be one repetition.
    """
    if not stretches:
        raise ParameterError("there is no stretch to learn from")
    named = where or [f"stretch {number}" for number in range(len(stretches))]
    learned, periods, passes = zip(
        *(learn_stretch(each, rate, name) for each, name in zip(stretches, named, strict=True)),
        strict=True,
    )
    words = [pack_words(features) for features in stretches]
    combined = min(learned, key=lambda one: sum(_loop_cost(w, one.matrix) for w in words))
    for _ in range(CLASS_ROUNDS if len(stretches) > 1 else 0):
        length = len(combined.matrix)
        cut = [
            features[start:end]
            for features, own in zip(stretches, words, strict=True)
            for start, end in cut_passes(loop_align(own, combined.matrix), length)
            if end - start <= LONGEST_SEQUENCE
        ]
        if not cut:
            break
        combined = learn_template(_examples(cut))
    return Repetitions(learned, combined, periods, passes)


def _loop_cost(words: WordArray, matrix: FloatArray) -> float:
    """Total surprise of a motion along one looping template."""
    tables = surprise_tables(matrix)
    phases = align_loops(words, tables, join_loops([len(matrix)]))[0]
    octets = words.astype("<u8").view(np.uint8).reshape(-1, 8)
    return float(
        sum(
            table[o, phases].sum(dtype=np.float64)
            for table, o in zip(tables, octets.T, strict=False)
        )
    )
