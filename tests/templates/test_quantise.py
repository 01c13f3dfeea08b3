import numpy as np
import pytest

from mocapidx.errors import ParameterError
from mocapidx.features.words import unpack_words
from mocapidx.templates.quantise import quantise


def entries(quantised, features):
    ones, care = unpack_words(quantised.ones, features), unpack_words(quantised.care, features)
    return np.where(care, ones.astype(float), 0.5)


def test_both_comparisons_are_strict():
    matrix = np.array([[0.0, 0.0999, 0.1, 0.5, 0.9, 0.9001, 1.0]])
    assert entries(quantise(matrix, 0.1), 7).tolist() == [[0, 0, 0.5, 0.5, 0.5, 1, 1]]


def test_one_of_ten_examples_is_a_tenth_whatever_rounding_says():
    tenth = 1.0 - 0.9  # a little less than 0.1
    assert entries(quantise(np.array([[tenth, 1 - tenth]]), 0.1), 2).tolist() == [[0.5, 0.5]]


@pytest.mark.parametrize("delta", [0.05, 0.1, 0.3, 0.49])
def test_counts_and_words_agree_with_the_entries(delta):
    matrix = np.random.default_rng(0).random((20, 64))
    quantised = quantise(matrix, delta)
    expected = np.where(matrix < delta, 0.0, np.where(matrix > 1 - delta, 1.0, 0.5))
    np.testing.assert_array_equal(entries(quantised, 64), expected)
    np.testing.assert_array_equal(quantised.counts, (expected != 0.5).sum(axis=1))


def test_masked_features_are_undecided():
    matrix = np.array([[1.0, 0.0, 1.0]])
    assert entries(quantise(matrix, 0.1).without(0b101), 3).tolist() == [[0.5, 0.0, 0.5]]
    assert quantise(matrix, 0.1).without(0b101).counts.tolist() == [1]


@pytest.mark.parametrize("delta", [0.0, 0.5, -0.1, float("nan")])
def test_delta_out_of_range_is_refused(delta):
    with pytest.raises(ParameterError, match="delta"):
        quantise(np.zeros((2, 2)), delta)


def test_a_quarter_of_what_is_decided_is_enough_to_say_something():
    quantised = quantise(np.array([[0.0, 0.0, 1.0, 1.0, 0.5]]), 0.1)
    assert quantised.is_told_without(0)
    assert quantised.is_told_without(0b10111)
    assert not quantised.is_told_without(0b01111)


def test_a_template_that_decides_nothing_loses_nothing():
    assert quantise(np.full((3, 4), 0.5), 0.1).is_told_without(0b1111)
