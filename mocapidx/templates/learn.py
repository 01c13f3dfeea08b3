"""Learn one motion template from examples of a motion class.

All examples are warped onto one of them, averaged, and unwarped back to real time. Each example
is the reference once, or 64 of them where there are more; the averages are the examples of the next
pass, until they stay the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocapidx.alignment.dtw import align
from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, FloatArray, IndexArray

__all__ = ["SHORTEST_EXAMPLE", "Learned", "average", "learn_template", "unwarp", "warp"]

SHORTEST_EXAMPLE = 3  # frames
SETTLED = 0.01  # mean absolute change of an entry below which a pass has changed nothing
MOST_PASSES = 20
MOST_REFERENCES = 64  # more would cost the square of their number and change nothing to speak of


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """What was learned from the examples of one class.

    Parameters
    ----------
    matrix : ndarray of float64, shape (K, F)
        The share of the examples in which a feature holds at a time, from 0 to 1.
    mean_length : float
        Mean length of the examples in frames; K is the next whole number.
    passes : int
        Rounds of mutual warping; 0 if there was only one example.
    spread : tuple of float
        How far each example is from the template: cost of their alignment, divided by the
        length of its path and the number of features. 0 is equal, 1 the opposite.
    """

    matrix: FloatArray
    mean_length: float
    passes: int
    spread: tuple[float, ...]


def learn_template(matrices: Sequence[BoolArray | FloatArray]) -> Learned:
    """Learn a motion template by mutual warping, averaging and unwarping.

    Parameters
    ----------
    matrices : sequence of ndarray, shape (T, F)
        The examples: bool, or float between 0 and 1; each of its own length, at least 3 and at
        most 4,096 frames.

    Returns
    -------
    Learned

    Raises
    ------
    ParameterError
        If there is no example, or one is too short, too long or of another shape.

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, section 4.1.
    """
    examples = [np.asarray(matrix, dtype=np.float64) for matrix in matrices]
    if not examples:
        raise ParameterError("there is no example to learn from")
    shortest = min(len(example) for example in examples)
    if shortest < SHORTEST_EXAMPLE:
        raise ParameterError(
            f"an example must have at least {SHORTEST_EXAMPLE} frames, got {shortest}"
        )
    matrix, passes = (examples[0], 0) if len(examples) == 1 else _iterate(examples)
    return Learned(
        matrix=matrix,
        mean_length=sum(map(len, examples)) / len(examples),
        passes=passes,
        spread=tuple(
            cost / (len(path) * matrix.shape[1]) for cost, path, _ in align(matrix, examples)
        ),
    )


def _iterate(examples: Sequence[FloatArray]) -> tuple[FloatArray, int]:
    """Pass after pass until the templates settle; their medoid and the number of passes."""
    templates = list(examples)
    weights: list[FloatArray] = [np.ones(len(example)) for example in examples]
    references = _references(len(examples))
    for passes in range(1, MOST_PASSES + 1):
        before = templates
        pairs = [unwarp(*average(reference, templates, weights)) for reference in references]
        references = range(len(pairs))
        templates = [matrix for matrix, _ in pairs]
        weights = [weight for _, weight in pairs]
        # After the first pass all have one length, and not before.
        if passes > 1 and all(
            np.abs(new - old).mean() < SETTLED for new, old in zip(templates, before, strict=True)
        ):
            break
    everything = np.array(templates)
    distances = [np.abs(everything - template).sum() for template in templates]
    return templates[int(np.argmin(np.round(distances, 9)))], passes


def _references(examples: int) -> Sequence[int]:
    """Choose the examples that all are warped onto: each of them, or enough of very many."""
    if examples <= MOST_REFERENCES:
        return range(examples)
    chosen: list[int] = np.linspace(0, examples - 1, MOST_REFERENCES).round().astype(int).tolist()
    return chosen


def average(
    reference: int, matrices: Sequence[FloatArray], weights: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Warp sequences onto one of them and take the weighted mean.

    Parameters
    ----------
    reference : int
        Which of the sequences the others are warped onto.
    matrices : sequence of ndarray of float64, shape (T, F)
    weights : sequence of ndarray of float64, shape (T,)
        How much time each row stands for, in frames.

    Returns
    -------
    matrix : ndarray of float64, shape (K, F)
        K is the length of the reference.
    weights : ndarray of float64, shape (K,)
        The mean of the warped weights; their sum is the mean of the sums.
    """
    alignments = align(matrices[reference], matrices)
    _, rows, columns = zip(*alignments, strict=True)
    # One sequence behind the other, and each onto a reference of its own: one call warps all.
    first_rows = np.arange(len(matrices)) * len(matrices[reference])
    first_columns = np.cumsum([0, *map(len, matrices)])
    warped, warped_weights = warp(
        np.concatenate(matrices),
        np.concatenate(weights),
        np.concatenate([own + first for own, first in zip(rows, first_rows, strict=True)]),
        np.concatenate([own + first for own, first in zip(columns, first_columns, strict=False)]),
    )
    of_each = (len(matrices), len(matrices[reference]))
    total = (warped * warped_weights[:, None]).reshape(*of_each, -1).sum(axis=0)
    weight = warped_weights.reshape(of_each).sum(axis=0)
    return total / weight[:, None], weight / len(matrices)


def warp(
    matrix: FloatArray, weights: FloatArray, rows: IndexArray, columns: IndexArray
) -> tuple[FloatArray, FloatArray]:
    """Stretch and contract a sequence along a warping path.

    A frame that is matched to n frames of the reference gives each of them 1/n of its weight; a
    frame of the reference gets the weighted mean of what is matched to it.

    Parameters
    ----------
    matrix : ndarray of float64, shape (T, F)
    weights : ndarray of float64, shape (T,)
        In frames.
    rows, columns : ndarray of int64, shape (M,)
        The path: frames of the reference and of `matrix`.

    Returns
    -------
    matrix : ndarray of float64, shape (K, F)
    weights : ndarray of float64, shape (K,)
    """
    shares = (weights / np.bincount(columns))[columns]
    firsts = np.flatnonzero(np.diff(rows, prepend=-1))
    new_weights = np.add.reduceat(shares, firsts)
    sums = np.add.reduceat(shares[:, None] * matrix[columns], firsts, axis=0)
    return sums / new_weights[:, None], new_weights


def unwarp(matrix: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bring a sequence back to real time: rows that stand for one frame each.

    The rows are read as constant over the time they stand for, and integrated over one frame
    after the other; the last frame may be a part of one.

    Parameters
    ----------
    matrix : ndarray of float64, shape (K, F)
    weights : ndarray of float64, shape (K,)
        In frames, all positive.

    Returns
    -------
    matrix : ndarray of float64, shape (K', F)
        K' is the sum of the weights, rounded up.
    weights : ndarray of float64, shape (K',)
        One, but for the last.

    Examples
    --------
    >>> unwarp(np.array([[0.0], [1.0]]), np.array([1.5, 1.0]))[0].ravel().tolist()
    [0.0, 0.5, 1.0]
    """
    ends = np.cumsum(weights)
    whole = int(np.ceil(ends[-1] - 1e-9))  # a sum that rounding puts above a whole number
    edges = np.minimum(np.arange(whole + 1), ends[-1])
    integral = np.vstack((np.zeros(matrix.shape[1]), np.cumsum(matrix * weights[:, None], axis=0)))
    row = np.minimum(np.searchsorted(ends, edges, side="right"), len(ends) - 1)
    rest = edges - np.where(row > 0, ends[row - 1], 0.0)
    lengths = np.diff(edges)
    means = np.diff(integral[row] + rest[:, None] * matrix[row], axis=0) / lengths[:, None]
    return np.clip(means, matrix.min(), matrix.max()), lengths  # rounding leaves the range
