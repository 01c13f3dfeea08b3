"""Feature words: bits in, bits out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mocapidx.errors import ParameterError
from mocapidx.features.words import pack_words, part_words, squeeze_mask, unpack_words

features = st.tuples(st.integers(0, 20), st.integers(0, 64)).flatmap(lambda s: arrays(np.bool_, s))
masks = st.sets(st.integers(0, 63), max_size=32).map(lambda bits: sum(1 << bit for bit in bits))
words = st.lists(st.integers(0, 2**64 - 1), max_size=20)


def naive_squeeze(value, mask):
    kept = [value >> bit & 1 for bit in range(64) if mask >> bit & 1]
    return sum(bit << place for place, bit in enumerate(kept))


@given(features)
def test_bit_i_is_feature_i_and_unpacking_gives_the_features_back(matrix):
    packed = pack_words(matrix)
    assert packed.dtype == np.uint64
    expected = [sum(1 << i for i, bit in enumerate(row) if bit) for row in matrix.tolist()]
    assert packed.tolist() == expected
    np.testing.assert_array_equal(unpack_words(packed, matrix.shape[1]), matrix)


@given(words, masks)
def test_a_part_is_its_bits_squeezed_together_lowest_first(values, mask):
    squeezed = part_words(np.array(values, dtype=np.uint64), mask)
    assert squeezed.dtype == np.uint32
    assert squeezed.tolist() == [naive_squeeze(value, mask) for value in values]
    assert [squeeze_mask(value, mask) for value in values] == squeezed.tolist()


def test_a_whole_part_of_32_features_fits():
    top = np.array([2**64 - 1], dtype=np.uint64)
    assert part_words(top, 0xFFFFFFFF << 32).tolist() == [0xFFFFFFFF]


@pytest.mark.parametrize(
    "wrong",
    [np.zeros(3, bool), np.zeros((3, 65), bool), np.zeros((3, 4), np.uint8)],
    ids=["vector", "65 features", "integers"],
)
def test_only_boolean_rows_of_at_most_64_features_are_packed(wrong):
    with pytest.raises(ParameterError, match="F at most 64"):
        pack_words(wrong)


@pytest.mark.parametrize("mask", [-1, 1 << 64, (1 << 33) - 1])
def test_a_part_beyond_32_of_64_bits_is_refused(mask):
    with pytest.raises(ParameterError, match="at most 32 of 64 bits"):
        part_words(np.zeros(1, dtype=np.uint64), mask)


def test_words_of_another_shape_or_count_are_refused():
    with pytest.raises(ParameterError, match="words must be uint64"):
        unpack_words(np.zeros((2, 2), dtype=np.uint64), 3)
    with pytest.raises(ParameterError, match="count must be"):
        unpack_words(np.zeros(2, dtype=np.uint64), 65)
