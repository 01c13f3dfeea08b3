import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.alignment.loops import UNKNOWN, align_loops, byte_tables, cheapest_path, join_loops
from mocapidx.errors import ParameterError
from tests import naive_loops as naive


def random_case(seed, frames=14, features=11):
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 7, size=rng.integers(1, 4))
    zeros = [rng.random((n, features)) for n in lengths]
    ones = [rng.random((n, features)) for n in lengths]
    words = rng.integers(0, 1 << features, size=frames, dtype=np.uint64)
    return lengths, zeros, ones, words


def tables_of(zeros, ones):
    return byte_tables(np.concatenate(zeros), np.concatenate(ones))


@given(
    st.integers(0, 10**6), st.sampled_from([0.3, 1.0, 2.5]), st.sampled_from([1.8, 4.5, math.inf])
)
@settings(max_examples=60, deadline=None)
def test_path_is_as_cheap_as_the_best_of_all_pairs_of_states(seed, jump_price, unknown_price):
    lengths, zeros, ones, words = random_case(seed)
    columns, jumps = cheapest_path(
        words,
        tables_of(zeros, ones),
        join_loops(lengths),
        jump_price=jump_price,
        unknown_price=unknown_price,
    )
    bits = [int(word) for word in words]
    best = naive.best_total(bits, zeros, ones, jump_price, unknown_price)
    attained = naive.path_total(bits, columns, jumps, zeros, ones, jump_price, unknown_price)
    assert attained == pytest.approx(best, abs=1e-4)


@pytest.mark.parametrize("seed", range(8))
def test_templates_by_themselves_get_their_own_best_alignment(seed):
    lengths, zeros, ones, words = random_case(seed)
    loops = join_loops(lengths)
    paths = align_loops(words, tables_of(zeros, ones), loops)
    bits = [int(word) for word in words]
    for m, path in enumerate(paths):
        alone = path - loops.bounds[m]
        assert alone.min() >= 0
        assert alone.max() < lengths[m]
        no_jumps = np.zeros(len(words), dtype=bool)
        attained = naive.path_total(bits, alone, no_jumps, [zeros[m]], [ones[m]], math.inf)
        best = naive.best_total(bits, [zeros[m]], [ones[m]], math.inf)
        assert attained == pytest.approx(best, abs=1e-4)


@pytest.mark.parametrize("frames", [1, 63, 64, 65, 500])
def test_blocks_of_bounded_memory_change_nothing(frames):
    lengths, zeros, ones, words = random_case(3, frames=frames)
    arguments = words, tables_of(zeros, ones), join_loops(lengths)
    prices = {"jump_price": 1.5, "unknown_price": 3.5}
    whole = cheapest_path(*arguments, **prices)
    in_blocks = cheapest_path(*arguments, **prices, pointer_bytes=1)
    for expected, found in zip(whole, in_blocks, strict=True):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("features", [1, 8, 39, 64])
def test_tables_add_up_to_the_cost_of_every_word(features):
    rng = np.random.default_rng(features)
    zero, one = rng.random((5, features)), rng.random((5, features))
    tables = byte_tables(zero, one)
    for word in rng.integers(0, 1 << min(features, 63), size=20).tolist():
        found = sum(tables[b, word >> 8 * b & 255] for b in range(len(tables)))
        expected = [naive.frame_cost(word, zero[c], one[c]) for c in range(5)]
        np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_a_dear_template_is_left_for_the_unknown():
    zero, one = np.zeros((2, 1)), np.ones((2, 1))
    words = np.array([0] * 20 + [1] * 20 + [0] * 20, dtype=np.uint64)
    columns, jumps = cheapest_path(
        words, byte_tables(zero, one), join_loops([2]), jump_price=3.0, unknown_price=0.4
    )
    np.testing.assert_array_equal(columns == UNKNOWN, words == 1)
    assert np.flatnonzero(jumps).tolist() == [0, 20, 40]


def test_long_sums_keep_their_precision():
    zero, one = np.array([[0.30], [0.3001]]), np.zeros((2, 1))
    words = np.zeros(200_000, dtype=np.uint64)
    columns, jumps = cheapest_path(words, byte_tables(zero, one), join_loops([1, 1]), jump_price=9)
    assert not columns.any()
    assert np.flatnonzero(jumps).tolist() == [0]


def test_nothing_to_walk_through_or_along_is_refused():
    with pytest.raises(ParameterError, match="at least one column"):
        join_loops([3, 0])
    with pytest.raises(ParameterError, match="at least one column"):
        join_loops([])
    tables, loops = np.zeros((1, 256, 1), np.float32), join_loops([1])
    with pytest.raises(ParameterError, match="at least one frame"):
        cheapest_path(np.zeros(0, np.uint64), tables, loops, jump_price=1.0)
    with pytest.raises(ParameterError, match="at least one frame"):
        align_loops(np.zeros(0, np.uint64), tables, loops)
