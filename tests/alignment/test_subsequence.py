import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.alignment import subsequence
from mocapidx.alignment.subsequence import shortest_match, subsequence_costs, subsequence_starts
from mocapidx.errors import ParameterError
from tests import naive_alignment as naive

STEPS = {"weighted": 2, "printed": 1}  # how often the step (2, 1) pays


def random_match(seed, rows, frames, bits=6):
    rng = np.random.default_rng(seed)
    ones, care, words = (
        rng.integers(0, 1 << bits, n, dtype=np.uint64) for n in (rows, rows, frames)
    )
    return ones & care, care, words


def local_costs(ones, care, words):
    """Equation (1), bit by bit."""
    table = []
    for one, consistent in zip(ones.tolist(), care.tolist(), strict=True):
        count = consistent.bit_count()
        table.append(
            [
                ((word ^ one) & consistent).bit_count() / count if count else 0.0
                for word in words.tolist()
            ]
        )
    return table


@pytest.mark.parametrize("steps", STEPS)
@given(st.integers(0, 2**32), st.integers(1, 9), st.integers(0, 40))
def test_costs_match_the_cell_by_cell_version(steps, seed, rows, frames):
    ones, care, words = random_match(seed, rows, frames)
    expected = naive.subsequence(local_costs(ones, care, words), STEPS[steps])[0] if frames else []
    np.testing.assert_allclose(
        subsequence_costs(ones, care, words, steps=steps), expected, rtol=1e-5, atol=1e-6
    )


@pytest.mark.parametrize("steps", STEPS)
@given(st.integers(0, 2**32), st.integers(1, 8), st.integers(1, 40))
def test_each_start_attains_the_cost_of_its_end(steps, seed, rows, frames):
    ones, care, words = random_match(seed, rows, frames, bits=3)
    costs = subsequence_costs(ones, care, words, steps=steps)
    starts = subsequence_starts(ones, care, words, np.arange(frames), steps=steps)
    table = local_costs(ones, care, words)
    for end, (start, cost) in enumerate(zip(starts.tolist(), costs.tolist(), strict=True)):
        if math.isinf(cost):
            assert start == -1
        else:
            attained = naive.path_cost(table, start, end, STEPS[steps])
            assert attained == pytest.approx(cost, abs=1e-6)


@pytest.mark.parametrize("steps", STEPS)
def test_blocks_change_no_bit(steps, monkeypatch):
    ones, care, words = random_match(1, 12, 500)
    breaks = np.array([100, 101, 333, 334])
    ends = np.array([480, 30, 200, 31, 340, 370, 111, 200])
    costs = subsequence_costs(ones, care, words, breaks, steps)
    starts = subsequence_starts(ones, care, words, ends, breaks, steps)
    monkeypatch.setattr(subsequence, "BLOCK", 37)
    again = subsequence_costs(ones, care, words, breaks, steps)
    np.testing.assert_array_equal(costs.view(np.uint32), again.view(np.uint32))
    np.testing.assert_array_equal(
        subsequence_starts(ones, care, words, ends, breaks, steps), starts
    )


@pytest.mark.parametrize("steps", STEPS)
@given(seed=st.integers(0, 2**32), cut=st.integers(1, 29), rows=st.integers(1, 6))
def test_two_documents_with_breaks_between_are_two_documents(steps, seed, cut, rows):
    ones, care, words = random_match(seed, rows, 30)
    both = np.concatenate((words[:cut], words[:2], words[cut:]))
    breaks = np.array([cut, cut + 1])
    costs = subsequence_costs(ones, care, both, breaks, steps)
    assert np.isinf(costs[breaks]).all()
    first = subsequence_costs(ones, care, words[:cut], steps=steps)
    second = subsequence_costs(ones, care, words[cut:], steps=steps)
    np.testing.assert_array_equal(np.delete(costs, breaks), np.concatenate((first, second)))
    starts = subsequence_starts(ones, care, both, np.arange(32), breaks, steps)
    assert (starts[cut + 2 :] != cut + 1).all()
    assert ((starts[cut + 2 :] >= cut + 2) | (starts[cut + 2 :] == -1)).all()


def test_weighted_costs_are_means_and_never_above_one():
    for seed in range(20):
        ones, care, words = random_match(seed, 7, 50)
        costs = subsequence_costs(ones, care, words)
        assert costs[np.isfinite(costs)].max() <= 1 + 1e-6


@pytest.mark.parametrize("rows", range(1, 12))
def test_the_shortest_match_is_the_shortest_that_has_a_cost(rows):
    ones, care, words = random_match(2, rows, 30)
    finite = np.flatnonzero(np.isfinite(subsequence_costs(ones, care, words)))
    assert finite[0] + 1 == shortest_match(rows)


def test_printed_steps_pass_over_a_row_for_nothing_and_weighted_ones_do_not():
    ones, care = np.array([0, 1, 0], dtype=np.uint64), np.ones(3, dtype=np.uint64)
    words = np.zeros(2, dtype=np.uint64)
    assert subsequence_costs(ones, care, words, steps="printed").tolist()[1] == 0
    # The diagonal through all rows needs a third frame, so two frames skip the row that differs.
    ones = np.array([0, 0, 1], dtype=np.uint64)
    printed = subsequence_costs(ones, care, words, steps="printed")
    weighted = subsequence_costs(ones, care, words, steps="weighted")
    assert printed[1] == np.float32(1 / 3)
    assert weighted[1] == np.float32(2 / 3)


def test_rows_without_a_consistent_feature_cost_nothing():
    zero = np.zeros(3, dtype=np.uint64)
    words = np.arange(8, dtype=np.uint64)
    assert subsequence_costs(zero, zero, words).tolist() == [math.inf] + [0.0] * 7


@pytest.fixture
def quiet_import():
    """Import a peer without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield pytest.importorskip


@pytest.mark.parametrize("steps", STEPS)
def test_librosa_computes_the_same_costs(steps, quiet_import):
    librosa = quiet_import("librosa")
    for seed in range(3):
        ones, care, words = random_match(seed, 9, 120)
        theirs = librosa.sequence.dtw(
            C=np.array(local_costs(ones, care, words)),
            step_sizes_sigma=np.array([[1, 1], [2, 1], [1, 2]]),
            weights_mul=np.array([1.0, STEPS[steps], 1.0]),
            weights_add=np.zeros(3),
            subseq=True,
            backtrack=False,
        )
        ours = subsequence_costs(ones, care, words, steps=steps)
        np.testing.assert_allclose(ours, theirs[-1] / 9, rtol=1e-5, atol=1e-6)


def test_libfmp_computes_the_same_printed_costs(quiet_import):
    c7 = quiet_import("libfmp.c7")
    ones, care, words = random_match(4, 9, 120)
    table = np.array(local_costs(ones, care, words))
    theirs = c7.compute_accumulated_cost_matrix_subsequence_dtw_21(table)
    ours = subsequence_costs(ones, care, words, steps="printed")
    np.testing.assert_allclose(ours, theirs[-1] / 9, rtol=1e-5, atol=1e-6)


def test_wrong_arguments_are_refused():
    one = np.zeros(1, dtype=np.uint64)
    with pytest.raises(ParameterError, match="'weighted' or 'printed', got 'long'"):
        subsequence_costs(one, one, one, steps="long")
    with pytest.raises(ParameterError, match="no rows"):
        subsequence_costs(one[:0], one[:0], one)
