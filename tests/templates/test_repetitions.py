import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.extract import extract_features
from mocapidx.features.words import pack_words
from mocapidx.tasks.read import read_motion
from mocapidx.templates.path import annotate_words, loop_bank
from mocapidx.templates.repetitions import (
    cut_passes,
    find_period,
    learn_repetitions,
    learn_stretch,
    loop_align,
    self_distances,
)


def movement(seed, length, features=20):
    """One repetition: smooth signals of one or two waves, each above a threshold or not."""
    rng = np.random.default_rng(seed)
    phase = np.arange(length)[:, None] / length + rng.random(features)
    second = 0.5 * np.sin(4 * np.pi * (phase + rng.random(features)))
    return np.sin(2 * np.pi * phase) + second > rng.normal(0, 0.3, features)


def repeated(one, counts, rng=None, noise=0.0):
    """Repetitions with lengths of their own, some bits flipped."""
    parts = [one[np.linspace(0, len(one) - 1, n).round().astype(int)] for n in counts]
    motion = np.concatenate(parts)
    return motion ^ (rng.random(motion.shape) < noise) if rng is not None else motion


def test_self_distances_are_those_of_the_definition():
    features = np.random.default_rng(0).random((30, 9)) < 0.5
    distances = self_distances(pack_words(features), 20)
    for p in range(1, 21):
        assert distances[p] == pytest.approx((features[p:] != features[:-p]).sum(axis=1).mean())


@given(st.integers(0, 10**6), st.integers(14, 70), st.floats(2.3, 9))
@settings(max_examples=40, deadline=None)
def test_the_period_of_an_exact_repetition_is_found(seed, length, repetitions):
    one = movement(seed, length)
    motion = np.tile(one, (10, 1))[: round(length * repetitions)]
    period = find_period(pack_words(motion), one.shape[1])
    assert period is not None
    words = pack_words(motion)
    assert (words[period:] == words[:-period]).all()
    assert length % period == 0


@pytest.mark.parametrize("seed", range(6))
def test_the_period_is_found_in_spite_of_noise_and_tempo(seed):
    rng = np.random.default_rng(seed)
    one = movement(seed, 40)
    counts = rng.integers(36, 45, size=7)
    period = find_period(pack_words(repeated(one, counts, rng, 0.03)), one.shape[1])
    assert period == pytest.approx(40, abs=5)


def test_periods_scale_with_the_rate():
    one = movement(1, 40).repeat(4, axis=0)
    assert find_period(pack_words(np.tile(one, (5, 1))), one.shape[1], rate=120.0) == 160


def test_motion_without_a_period_has_none():
    constant = np.zeros((200, 8), dtype=bool)
    assert find_period(pack_words(constant), 8) is None
    once = np.arange(60)[:, None] > np.arange(0, 60, 6)
    assert find_period(pack_words(once), 10) is None
    assert find_period(pack_words(once[:15]), 10) is None


def test_phases_run_through_the_template_again_and_again():
    one = movement(2, 30)
    motion = np.tile(one, (4, 1))[7:]
    phases = loop_align(pack_words(motion), one.astype(float))
    expected = (np.arange(len(motion)) + 7) % 30
    np.testing.assert_array_equal(one[phases], motion)
    np.testing.assert_array_equal(phases[:-1], expected[:-1])  # the last may still be held


def test_cuts_stand_where_the_phase_falls():
    phases = np.array([5, 6, 7, 8, 9, 0, 1, 3, 5, 7, 9, 9, 1, 2, 4, 3, 5, 6, 8, 0, 1, 2, 3])
    assert cut_passes(phases, 10) == [(5, 12), (12, 19)]  # the first and the last are too short


@pytest.mark.parametrize("seed", range(4))
def test_repetitions_of_a_stretch_are_found(seed):
    rng = np.random.default_rng(seed)
    one = movement(seed + 10, 40)
    counts = rng.integers(36, 45, size=6)
    template, period, passes = learn_stretch(repeated(one, counts, rng, 0.02))
    assert period == pytest.approx(40, abs=5)
    assert len(template.matrix) == pytest.approx(40, abs=5)
    assert len(passes) in (5, 6)
    lengths = np.diff(passes, axis=1)
    assert lengths.min() >= 24
    assert lengths.max() <= 50


def test_a_stretch_without_a_period_is_one_repetition():
    features = np.arange(60)[:, None] > np.arange(0, 60, 6)
    template, period, passes = learn_stretch(features)
    np.testing.assert_array_equal(template.matrix, features)
    assert period is None
    assert passes == ((0, 60),)


def test_a_stretch_that_is_too_long_for_one_repetition_is_told_by_its_place():
    still = np.zeros((4097, 5), dtype=bool)
    with pytest.raises(FormatError, match=r"labels.csv:3: no repetitions .* in 137 s"):
        learn_repetitions([movement(3, 40), still], where=("labels.csv:2", "labels.csv:3"))
    with pytest.raises(FormatError, match="stretch 1: no repetitions"):
        learn_repetitions([movement(3, 40), still])


def test_a_take_of_minutes_is_learned_from_some_of_its_repetitions_and_all_are_counted(monkeypatch):
    monkeypatch.setattr("mocapidx.templates.repetitions.MOST_EXAMPLES", 10)
    rng = np.random.default_rng(4)
    one = movement(8, 30)
    learned, period, passes = learn_stretch(repeated(one, [30] * 150, rng, 0.02))
    assert period == 30
    assert 148 <= len(passes) <= 150
    assert len(learned.spread) == 10
    assert len(learned.matrix) == pytest.approx(30, abs=1)


def test_a_class_learns_from_the_repetitions_of_all_its_stretches():
    rng = np.random.default_rng(1)
    one = movement(21, 36)
    stretches = [repeated(one, rng.integers(32, 40, size=n), rng, 0.02) for n in (4, 6, 5)]
    learned = learn_repetitions(stretches)
    assert len(learned.stretches) == len(learned.periods) == len(learned.passes) == 3
    assert len(learned.combined.matrix) == pytest.approx(36, abs=4)
    phases = loop_align(pack_words(np.tile(one, (3, 1))), learned.combined.matrix)
    agreement = (learned.combined.matrix[phases] > 0.5) == np.tile(one, (3, 1))
    assert agreement.mean() > 0.95


def test_learning_twice_gives_the_same():
    rng = np.random.default_rng(2)
    stretches = [repeated(movement(5, 30), rng.integers(26, 34, size=4), rng, 0.05)] * 2
    first, second = learn_repetitions(stretches), learn_repetitions(stretches)
    np.testing.assert_array_equal(first.combined.matrix, second.combined.matrix)
    assert first.passes == second.passes


def test_nothing_to_learn_from_is_refused():
    with pytest.raises(ParameterError, match="no stretch"):
        learn_repetitions([])
    with pytest.raises(ParameterError, match="at least 3 frames"):
        learn_repetitions([np.zeros((2, 4), dtype=bool)])


EXERCISES = [
    "JumpJack",
    "Jog",
    "Squat",
    "KneeRaise",
    "ArmCircle",
    "Twist",
    "SideReach",
    "Box",
    "UpDown",
    "ToeTouchOneHand",
    "SideBend",
    "ToeTouchTwoHands",
]


def exercise(real_data, name):
    """Features of a take at 30 Hz, and the label of each frame."""
    path = real_data / "exercises" / f"{name}.amc"
    if not path.is_file():
        pytest.skip("the exercise takes are not there")
    numbers = path.with_suffix(".labels.txt").read_text().split()
    features = extract_features(read_motion(path))
    labels = np.repeat([EXERCISES[int(number) - 1] for number in numbers], 3)
    return features[: len(labels)], labels[: len(features)]


@pytest.mark.parametrize(("train", "test"), [("13_29", "13_30"), ("13_30", "13_29")])
def test_a_take_is_annotated_by_what_was_learned_from_another(real_data, train, test):
    features, labels = exercise(real_data, train)
    matrices, names = [], []
    edges = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist(), len(labels)]
    for start, end in itertools.pairwise(edges):
        learned = learn_repetitions([features[start:end]])
        for one in (*learned.stretches, learned.combined):
            matrices.append(one.matrix)
            names.append(labels[start])
    features, labels = exercise(real_data, test)
    found = np.full(len(labels), "", dtype=object)
    bank = loop_bank(matrices, names)
    for occurrence in annotate_words(pack_words(features), bank, unknown_cost=None):
        found[occurrence.start : occurrence.end] = occurrence.label
    learnable = np.isin(labels, names)
    assert (found == labels)[learnable].mean() >= 0.93
