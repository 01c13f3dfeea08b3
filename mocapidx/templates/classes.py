"""Everything that is learned of one motion class: its templates and its threshold."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mocapidx.features.words import unpack_words
from mocapidx.model import BoolArray, FloatArray
from mocapidx.templates.keyframes import learn_keyframes
from mocapidx.templates.learn import Learned, learn_template
from mocapidx.templates.quantise import Quantised, quantise
from mocapidx.templates.repetitions import learn_repetitions
from mocapidx.templates.template import MotionTemplate
from mocapidx.templates.thresholds import Clip, Threshold, learn_threshold

__all__ = ["ClassMotion", "LearnedClass", "learn_class"]

MOST_FOLDS: Final = 5
"""Groups that are held out apart from one another; of more, some are held out together."""


@dataclass(frozen=True, slots=True, eq=False)
class ClassMotion:
    """The motion that one class is learned from.

    Parameters
    ----------
    label : str
    examples : tuple of Clip
    names : tuple of str
        What the template says that each example was.
    groups : tuple of str
        The person or recording of each example; those of one group are held out together.
    others : tuple of Clip
        Labelled motion of other classes.
    background : tuple of Clip
        Unlabelled motion.
    features : int
        Number of features of the set.
    feature_set_digest : str
    rate : float
        Frames a second, in Hz.
    repetitions : {"none", "auto"}
        Each example is one repetition, or an unknown number of them.
    delta : float
        Entries below it count as 0, above ``1 - delta`` as 1.
    places : tuple of str
        Where the label of each example stands, for messages.
    """

    label: str
    examples: tuple[Clip, ...]
    names: tuple[str, ...]
    groups: tuple[str, ...]
    others: tuple[Clip, ...]
    background: tuple[Clip, ...]
    features: int
    feature_set_digest: str
    rate: float
    repetitions: str
    delta: float
    places: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class LearnedClass:
    """What was learned of one class.

    Parameters
    ----------
    templates : tuple of MotionTemplate
        The class's template, then one for each example where they hold repetitions.
    examples : int
        Labelled stretches.
    repetitions : int
        Repetitions found in them; the same number where each stands for one.
    threshold : Threshold
        What the template costs on its own class and elsewhere.
    """

    templates: tuple[MotionTemplate, ...]
    examples: int
    repetitions: int
    threshold: Threshold

    @property
    def template(self) -> MotionTemplate:
        """The class's template."""
        return self.templates[0]


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Templates of one class before their thresholds."""

    combined: Learned
    stretches: tuple[Learned, ...] = ()
    repetitions: int = 0


def learn_class(job: ClassMotion) -> LearnedClass:
    """Learn the templates and the threshold of one class.

    Parameters
    ----------
    job : ClassMotion

    Returns
    -------
    LearnedClass
        The threshold comes from templates learned without some of the groups, at most five
        times; of more groups some are held out together.

    Raises
    ------
    ParameterError
        If an example is too short or too long.
    FormatError
        If one should hold repetitions, has none, and is too long to be one.
    """
    found = _templates(job, range(len(job.examples)))
    held_out: list[tuple[Quantised, list[Clip]]] = []

    def learn(numbers: Sequence[int]) -> FloatArray:
        matrix = _templates(job, numbers).combined.matrix
        left = [clip for number, clip in enumerate(job.examples) if number not in numbers]
        held_out.append((quantise(matrix, job.delta), left))
        return matrix

    threshold = learn_threshold(
        found.combined.matrix,
        job.delta,
        job.examples,
        _folds(job.groups),
        job.others,
        job.background,
        learn,
    )
    keyframes = learn_keyframes(
        quantise(found.combined.matrix, job.delta), held_out, job.others + job.background
    )
    looping = job.repetitions == "auto"
    template = MotionTemplate(
        label=job.label,
        matrix=found.combined.matrix,
        feature_set_digest=job.feature_set_digest,
        rate=job.rate,
        delta=job.delta,
        mean_length=found.combined.mean_length,
        passes=found.combined.passes,
        documents=job.names,
        spread=found.combined.spread,
        positive_cost=threshold.positive_cost,
        background_cost=threshold.background_cost,
        tau=threshold.tau,
        looping=looping,
        keyframes=() if keyframes is None else keyframes.rows,
        keyframe_tolerance=0 if keyframes is None else keyframes.tolerance,
    )
    stretches = tuple(
        replace(
            template,
            matrix=learned.matrix,
            kind="stretch",
            documents=(name,),
            mean_length=learned.mean_length,
            passes=learned.passes,
            spread=learned.spread,
            positive_cost=None,
            background_cost=None,
            tau=None,
            keyframes=(),
            keyframe_tolerance=0,
        )
        for learned, name in zip(found.stretches, job.names, strict=False)
    )
    return LearnedClass((template, *stretches), len(job.examples), found.repetitions, threshold)


def _templates(job: ClassMotion, numbers: Sequence[int]) -> _Found:
    """Learn from some of the examples; features that some can't tell are undecided in those."""
    clips = [job.examples[number] for number in numbers]
    if job.repetitions == "none":
        learned = learn_template([_entries(clip, job.features) for clip in clips])
        return _Found(learned, (), len(clips))
    bits = [unpack_words(clip.words, job.features) for clip in clips]
    places = [job.places[number] for number in numbers] if job.places else ()
    found = learn_repetitions(bits, job.rate, places)
    unknown = np.array(
        [[clip.untrusted >> bit & 1 for bit in range(job.features)] for clip in clips], dtype=bool
    )
    return _Found(
        _undecided(found.combined, np.asarray(unknown.any(axis=0))),
        tuple(_undecided(one, row) for one, row in zip(found.stretches, unknown, strict=True)),
        sum(map(len, found.passes)),
    )


def _entries(clip: Clip, features: int) -> FloatArray:
    entries = unpack_words(clip.words, features).astype(np.float64)
    entries[:, [bit for bit in range(features) if clip.untrusted >> bit & 1]] = 0.5
    return entries


def _undecided(learned: Learned, unknown: BoolArray) -> Learned:
    return replace(learned, matrix=np.where(unknown, 0.5, learned.matrix))


def _folds(groups: Sequence[str]) -> list[str]:
    """Put groups together until there are few enough; one group alone is split."""
    distinct = list(dict.fromkeys(groups))
    if len(distinct) == 1:
        return [str(number % MOST_FOLDS) for number in range(len(groups))]
    return [str(distinct.index(group) % MOST_FOLDS) for group in groups]
