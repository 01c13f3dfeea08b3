"""Explain a whole motion as one path through templates that loop.

The cost of a frame is its surprise: how unlikely its features are, were the entries of a template
column probabilities. Changes of template have a fixed price, and motion that no template explains
well has a constant cost of its own. There are no hits and no thresholds.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocapidx.alignment.loops import UNKNOWN, Loops, byte_tables, cheapest_path, join_loops
from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray

__all__ = [
    "SWITCH_PRICE",
    "UNKNOWN_COST",
    "LoopBank",
    "Occurrence",
    "Path",
    "annotate_words",
    "find_path",
    "loop_bank",
    "occurrences",
    "surprise_tables",
]

SWITCH_PRICE = 7.0  # for a jump, in units of a frame's cost at 30 frames/s
UNKNOWN_COST = 0.44  # of a frame that no template explains
SURE = 0.05  # no entry is taken for more certain than this
PRICE_RATE = 30.0  # Hz


@dataclass(frozen=True, slots=True, eq=False)
class LoopBank:
    """Templates made ready to be walked through.

    Parameters
    ----------
    labels : tuple of str
        The class of each of the M templates; several may have one class.
    loops : Loops
        Their C columns end to end.
    tables : ndarray of float32, shape (B, 256, C)
        Surprise of a frame in each column, from the bytes of its word.
    switch_price : float
        Of a jump, in units of a frame's cost.
    """

    labels: tuple[str, ...]
    loops: Loops
    tables: NDArray[np.float32]
    switch_price: float


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """The way of a motion through a bank of templates.

    Parameters
    ----------
    columns : ndarray of int64, shape (T,)
        The column that each frame lies in, or -1 where no template explains it.
    jumps : ndarray of bool, shape (T,)
        Whether the path jumped to get to this frame; true for the first.
    costs : ndarray of float32, shape (T,)
        Surprise of each frame.
    """

    columns: IndexArray
    jumps: BoolArray
    costs: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Occurrence:
    """A stretch of a motion in which one class goes on.

    Parameters
    ----------
    label : str
        The class.
    start, end : int
        In frames from 0, end exclusive.
    cost : float
        Mean surprise of its frames, in nats a feature; small where the templates fit.
    repetitions : float
        How often the class's movement was gone through, parts counted as parts.
    """

    label: str
    start: int
    end: int
    cost: float
    repetitions: float


def surprise_tables(matrix: FloatArray, trusted: int | None = None) -> NDArray[np.float32]:
    """Tabulate the surprise of feature words: the mean of ``-ln P`` over the features.

    ``P`` is the entry of a column, or one less the entry where the feature is 0, kept between
    0.05 and 0.95.

    Parameters
    ----------
    matrix : ndarray of float, shape (C, F)
        Template columns, time first, entries from 0 to 1.
    trusted : int, optional
        Mask of the features that count; by default all.

    Returns
    -------
    ndarray of float32, shape (B, 256, C)
        As `mocapidx.alignment.loops.byte_tables` has them.
    """
    features = matrix.shape[1]
    mask = (1 << features) - 1 if trusted is None else trusted
    weights = np.array([mask >> i & 1 for i in range(features)], dtype=np.float64)
    weights /= max(weights.sum(), 1.0)
    likely = np.clip(matrix, SURE, 1 - SURE)
    return byte_tables(-weights * np.log(1 - likely), -weights * np.log(likely))


def loop_bank(
    matrices: Sequence[FloatArray],
    labels: Sequence[str],
    *,
    rate: float = PRICE_RATE,
    trusted: int | None = None,
) -> LoopBank:
    """Make templates ready to be walked through.

    Parameters
    ----------
    matrices : sequence of ndarray of float, shape (K, F)
        Real-valued templates, time first; at least one, all with the same features.
    labels : sequence of str
        The class of each.
    rate : float
        Frames a second, in Hz; the price of a jump is that of the same time at any rate.
    trusted : int, optional
        Mask of the features that the motion can be trusted in; by default all.

    Returns
    -------
    LoopBank

    Raises
    ------
    ParameterError
        If there is no template, one has no columns, or labels and templates differ in number.
    """
    if len(matrices) != len(labels):
        raise ParameterError(f"{len(matrices)} templates have {len(labels)} labels")
    loops = join_loops([len(matrix) for matrix in matrices])
    tables = surprise_tables(np.concatenate(matrices), trusted)
    return LoopBank(tuple(labels), loops, tables, SWITCH_PRICE * rate / PRICE_RATE)


def find_path(
    words: WordArray, bank: LoopBank, *, unknown_cost: float | None = UNKNOWN_COST
) -> Path:
    """Find the cheapest path of a motion through a bank of templates.

    Memory does not grow with the motion, but for a few numbers a frame.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        Feature words, at least one.
    bank : LoopBank
    unknown_cost : float or None
        Of a frame that lies in no template; None: every frame lies in one.

    Returns
    -------
    Path

    Raises
    ------
    ParameterError
        If there is no frame.
    """
    unknown = np.inf if unknown_cost is None else unknown_cost
    columns, jumps = cheapest_path(
        words, bank.tables, bank.loops, jump_price=bank.switch_price, unknown_price=unknown
    )
    octets = words.astype("<u8").view(np.uint8).reshape(-1, 8)
    costs = np.zeros(len(words), dtype=np.float32)
    for table, octet in zip(bank.tables, octets.T, strict=False):
        costs += table[octet, columns]
    costs[columns == UNKNOWN] = unknown
    return Path(columns, jumps, costs)


def occurrences(path: Path, bank: LoopBank) -> list[Occurrence]:
    """Join the frames of a path that belong to one class into stretches.

    Frames that no template explains are in none of them. Changes between templates of one
    class do not end a stretch.

    Parameters
    ----------
    path : Path
    bank : LoopBank
        The one that the path leads through.

    Returns
    -------
    list of Occurrence
        In the order of time; they don't overlap.
    """
    templates = np.searchsorted(bank.loops.bounds, path.columns, side="right") - 1
    names = sorted(set(bank.labels))
    classes = np.array([names.index(label) for label in bank.labels] + [UNKNOWN])[templates]
    progress = _progress(path, bank.loops, templates)
    cuts = np.flatnonzero(np.diff(classes)) + 1
    edges = [0, *cuts.tolist(), len(classes)]
    return [
        Occurrence(
            label=names[classes[start]],
            start=start,
            end=end,
            cost=float(path.costs[start:end].mean(dtype=np.float64)),
            repetitions=float(progress[start:end].sum()),
        )
        for start, end in itertools.pairwise(edges)
        if classes[start] != UNKNOWN
    ]


def annotate_words(
    words: WordArray, bank: LoopBank, *, unknown_cost: float | None = UNKNOWN_COST
) -> list[Occurrence]:
    """Say which class occurs when: `find_path`, then `occurrences`.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        Feature words, at least one.
    bank : LoopBank
    unknown_cost : float or None
        Of a frame that lies in no template; None: every frame lies in one.

    Returns
    -------
    list of Occurrence
        In the order of time; they don't overlap.

    Raises
    ------
    ParameterError
        If there is no frame.
    """
    return occurrences(find_path(words, bank, unknown_cost=unknown_cost), bank)


def _progress(path: Path, loops: Loops, templates: IndexArray) -> FloatArray:
    """Return the share of its template that the path newly goes through at each frame."""
    lengths = np.diff(loops.bounds)[templates]
    steps = np.diff(path.columns, prepend=0) % lengths
    return np.where(path.jumps, 1, steps) / lengths
