"""Automatic selection: which features are asked for, and in which order."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.features.words import pack_words
from mocapidx.queries.relax import FEWEST_STEPS, relaxations


def example(columns):
    """Words of an example, given as one string of 0 and 1 a feature."""
    return pack_words(np.array([[digit == "1" for digit in column] for column in columns]).T)


def test_the_least_important_feature_goes_first():
    words = example(["01010101", "00110011", "00001111"])
    found = [(step.left_out, step.masks) for step in relaxations(words, [7], np.array([3, 1, 2]))]
    assert found == [(0, (0b111,)), (1, (0b101,)), (2, (0b001,))]


def test_of_equally_important_features_the_last_goes_first():
    words = example(["01010101", "01100110"])
    assert [step.masks for step in relaxations(words, [3], np.ones(2))] == [(0b11,), (0b01,)]


def test_a_family_ends_where_the_example_is_no_sequence_any_more():
    words = example(["00001111", "01010101"])
    found = list(relaxations(words, [3], np.array([2.0, 1.0])))
    assert [step.masks for step in found] == [(0b11,)]  # feature 0 alone has two steps


def test_smaller_families_join_in_when_the_larger_are_as_small():
    words = example(["0101", "0110", "1010", "1001"])
    found = list(relaxations(words, [0b1111, 0b1100], np.array([4.0, 3.0, 2.0, 1.0])))
    assert [step.masks for step in found] == [
        (0b1111,),
        (0b0111,),
        (0b0011, 0b1100),
        (0b0001, 0b0100),
    ]


def test_an_example_in_which_nothing_happens_asks_for_nothing():
    assert list(relaxations(example(["0000", "1111"]), [3], np.ones(2))) == []
    assert list(relaxations(example(["01"]), [], np.ones(1))) == []


@given(st.integers(0, 2**32), st.lists(st.integers(0, 2**8 - 1), max_size=4))
def test_selections_only_shrink_and_are_never_asked_for_twice(seed, families):
    rng = np.random.default_rng(seed)
    words = rng.integers(0, 2**8, 12, dtype=np.uint64)
    steps = list(relaxations(words, families, rng.random(8)))
    masks = [mask for step in steps for mask in step.masks]
    assert len(masks) == len(set(masks))
    sizes = [{mask.bit_count() for mask in step.masks} for step in steps]
    assert all(len(size) == 1 for size in sizes)
    assert [step.left_out for step in steps] == sorted({step.left_out for step in steps})
    for mask in masks:
        assert any(mask & family == mask for family in families)
        selected = words & np.uint64(mask)
        assert 1 + (selected[1:] != selected[:-1]).sum() >= FEWEST_STEPS
