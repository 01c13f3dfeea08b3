"""Change templates by hand: what a class means is up to people.

All of these leave entries at 0.5 where they say *undecided*: such an entry costs nothing in a
quantised match, whatever its delta, and the same whichever value a frame has along a path.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mocapidx.alignment.dtw import align
from mocapidx.errors import ParameterError
from mocapidx.features.words import unpack_words
from mocapidx.model import BoolArray, FloatArray, IndexArray
from mocapidx.printable import shown
from mocapidx.templates.learn import learn_template, warp
from mocapidx.templates.quantise import quantise
from mocapidx.templates.template import MotionTemplate

__all__ = [
    "UNDECIDED",
    "combine_templates",
    "decided_entries",
    "mask_template",
    "mirror_template",
    "new_template",
    "set_entries",
    "subtract_templates",
    "with_keyframes",
]

UNDECIDED = 0.5


def mirror_template(
    template: MotionTemplate, permutation: IndexArray, label: str
) -> MotionTemplate:
    """Exchange left and right: a template of left cartwheels becomes one of right ones.

    Keyframes, costs and threshold stay: mirrored examples cost as much as the examples did.

    Parameters
    ----------
    template : MotionTemplate
    permutation : ndarray of int64, shape (F,)
        The feature set's, which exchanges each feature with its mirror image.
    label : str
        Of the mirrored class.

    Returns
    -------
    MotionTemplate

    Raises
    ------
    ParameterError
        If the permutation is not one of the template's features.

    References
    ----------
    .. [1] Mueller, Roeder, "Motion templates for automatic classification and retrieval of
       motion capture data", SCA 2006, section 5.4.
    """
    features = template.matrix.shape[1]
    if sorted(permutation.tolist()) != list(range(features)):
        raise ParameterError(f"a permutation of {features} features is needed to mirror")
    return replace(
        template, label=label, matrix=np.ascontiguousarray(template.matrix[:, permutation])
    )


def combine_templates(templates: Sequence[MotionTemplate], label: str) -> MotionTemplate:
    """Learn one template from the templates of several classes.

    What tells the classes apart becomes undecided: arms that turn forwards in one class and
    backwards in the other just turn.

    Parameters
    ----------
    templates : sequence of MotionTemplate
        At least two, of one feature set, rate and delta.
    label : str
        Of the combined class.

    Returns
    -------
    MotionTemplate
        Each template counts as one example; the documents are those of all of them.

    Raises
    ------
    ParameterError
        If there are fewer than two, they do not go together, or one is shorter than 3 frames.

    References
    ----------
    .. [1] Mueller, Roeder, SCA 2006, section 4.2, figure 5 (c).
    """
    if len(templates) < 2:
        raise ParameterError("at least two templates are needed to combine")
    kinds = {(each.feature_set_digest, each.rate, each.delta) for each in templates}
    if len(kinds) > 1:
        raise ParameterError(
            "templates of different feature sets, rates or deltas can't be combined"
        )
    learned = learn_template([template.matrix for template in templates])
    first = templates[0]
    return MotionTemplate(
        label=label,
        matrix=learned.matrix,
        feature_set_digest=first.feature_set_digest,
        rate=first.rate,
        delta=first.delta,
        mean_length=learned.mean_length,
        passes=learned.passes,
        documents=tuple(dict.fromkeys(name for each in templates for name in each.documents)),
        looping=all(template.looping for template in templates),
    )


def mask_template(
    template: MotionTemplate, features: int, start: int = 0, end: int | None = None
) -> MotionTemplate:
    """Make a block of entries undecided: some features over some frames of the template.

    Parameters
    ----------
    template : MotionTemplate
    features : int
        Mask of the features; bit i stands for feature i.
    start, end : int
        Frames of the template, half open; default all.

    Returns
    -------
    MotionTemplate
        See `set_entries`.

    Raises
    ------
    ParameterError
        If the frames are not some of the template's, or no feature is meant.
    """
    return set_entries(template, UNDECIDED, features, start, end)


def set_entries(
    template: MotionTemplate,
    value: float,
    features: int,
    start: int = 0,
    end: int | None = None,
) -> MotionTemplate:
    """Give a block of entries one value.

    Costs, threshold and spread were measured on the template as it was, so they are dropped;
    so are keyframes that have no decided entry left.

    Parameters
    ----------
    template : MotionTemplate
    value : float
        From 0 to 1; 0.5 is undecided.
    features : int
        Mask of the features; bit i stands for feature i.
    start, end : int
        Frames of the template, half open; default all.

    Returns
    -------
    MotionTemplate

    Raises
    ------
    ParameterError
        If the frames are not some of the template's, no feature is meant, or the value is out
        of range.
    """
    frames, count = template.matrix.shape
    end = frames if end is None else end
    if not 0 <= start < end <= frames:
        raise ParameterError(
            f"template '{shown(template.label)}' has frames 0 to {frames}, not {start} to {end}"
        )
    if not 0 < features < 1 << count:
        raise ParameterError(f"a mask of some of {count} features is needed, got {features:#x}")
    if not 0.0 <= value <= 1.0:
        raise ParameterError(f"an entry lies between 0 and 1, got {value}")
    chosen = [bit for bit in range(count) if features >> bit & 1]
    matrix = template.matrix.copy()
    matrix[start:end, chosen] = value
    return _changed(template, matrix)


def new_template(
    label: str, frames: int, features: int, feature_set_digest: str, rate: float
) -> MotionTemplate:
    """Begin a template without any examples: all of it is undecided.

    Parameters
    ----------
    label : str
    frames : int
        Length; what it matches lasts from about half to twice as long.
    features : int
        Number of features of the set.
    feature_set_digest : str
    rate : float
        In Hz.

    Returns
    -------
    MotionTemplate

    References
    ----------
    .. [1] Mueller, Roeder, SCA 2006, section 5.4, "sweeping with a hand brush".
    """
    return MotionTemplate(
        label=label,
        matrix=np.full((max(frames, 0), features), UNDECIDED),
        feature_set_digest=feature_set_digest,
        rate=rate,
        mean_length=float(frames),
    )


def subtract_templates(
    template: MotionTemplate, others: Sequence[MotionTemplate]
) -> MotionTemplate:
    """Emphasise what separates a class from others that are much like it.

    Each of the others is warped onto the template. A decided entry on which all of them are
    decided the same way says nothing about which of the classes it is: it becomes undecided.
    What is left then weighs more, as the cost of a frame is the share of its decided entries
    that disagree. The price: less is left to tell the class from all else.

    Parameters
    ----------
    template : MotionTemplate
    others : sequence of MotionTemplate
        Of the same feature set, quantised by the delta of `template`.

    Returns
    -------
    MotionTemplate
        See `set_entries`.

    Raises
    ------
    ParameterError
        If there are no others, one is of another feature set, or nothing would be left.
    """
    if not others or any(
        (other.feature_set_digest, other.rate) != (template.feature_set_digest, template.rate)
        for other in others
    ):
        raise ParameterError("templates to subtract must be of the same feature set and rate")
    delta = template.delta
    ones, zeros = decided_entries(template.matrix, delta)
    in_common = ones | zeros
    matrices = [other.matrix for other in others]
    for matrix, (_, rows, columns) in zip(matrices, align(template.matrix, matrices), strict=True):
        warped, _ = warp(matrix, np.ones(len(matrix)), rows, columns)
        other_ones, other_zeros = decided_entries(warped, delta)
        in_common &= (ones & other_ones) | (zeros & other_zeros)
    if not ((ones | zeros) & ~in_common).any():
        raise ParameterError(
            f"all that is decided in '{shown(template.label)}' is so in "
            f"{', '.join(shown(other.label) for other in others)} too; nothing would be left"
        )
    return _changed(template, np.where(in_common, UNDECIDED, template.matrix))


def with_keyframes(
    template: MotionTemplate, keyframes: Sequence[int], tolerance: int = 0
) -> MotionTemplate:
    """Choose the rows that stand for the whole in a preselection.

    Parameters
    ----------
    template : MotionTemplate
    keyframes : sequence of int
        Frames of the template, in any order; none: no preselection.
    tolerance : int
        Entries of a keyframe that may disagree.

    Returns
    -------
    MotionTemplate

    Raises
    ------
    ParameterError
        If a keyframe stands twice, is no frame of the template, or has no decided entry.
    """
    decided = _decided(template.matrix, template.delta)
    for row in keyframes:
        if 0 <= row < len(decided) and not decided[row].any():
            raise ParameterError(
                f"template '{shown(template.label)}': nothing is decided in frame {row}, "
                "so it can be no keyframe"
            )
    return replace(template, keyframes=tuple(sorted(keyframes)), keyframe_tolerance=tolerance)


def decided_entries(matrix: FloatArray, delta: float) -> tuple[BoolArray, BoolArray]:
    """Tell which entries count as 1 and which as 0, as in a quantised match.

    Parameters
    ----------
    matrix : ndarray of float64, shape (K, F)
    delta : float

    Returns
    -------
    ones, zeros : ndarray of bool, shape (K, F)
        Where both are False an entry is undecided.
    """
    quantised = quantise(matrix, delta)
    ones = unpack_words(quantised.ones, matrix.shape[1])
    return ones, unpack_words(quantised.care, matrix.shape[1]) & ~ones


def _changed(template: MotionTemplate, matrix: FloatArray) -> MotionTemplate:
    """Replace the entries, and drop what was only true of the entries as they were."""
    decided = _decided(matrix, template.delta)
    return replace(
        template,
        matrix=matrix,
        spread=(),
        keyframes=tuple(row for row in template.keyframes if decided[row].any()),
        positive_cost=None,
        background_cost=None,
        tau=None,
    )


def _decided(matrix: FloatArray, delta: float) -> BoolArray:
    ones, zeros = decided_entries(matrix, delta)
    return ones | zeros
