from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.alignment import dtw
from mocapidx.alignment.dtw import align
from mocapidx.errors import ParameterError
from tests import naive_alignment as naive


def random_bits(rng, length, features=5):
    return (rng.random((length, features)) < 0.5).astype(np.float64)


def as_path(rows, columns):
    return list(zip(rows.tolist(), columns.tolist(), strict=True))


@given(st.integers(0, 2**32), st.lists(st.integers(1, 12), min_size=1, max_size=5))
def test_costs_and_paths_match_the_cell_by_cell_version_for_every_tie(seed, lengths):
    rng = np.random.default_rng(seed)
    reference = random_bits(rng, int(rng.integers(1, 12)), 2)  # two features tie all the time
    others = [random_bits(rng, length, 2) for length in lengths]
    for found, other in zip(align(reference, others), others, strict=True):
        cost, path = naive.dtw(reference.tolist(), other.tolist())
        assert found[0] == cost
        assert as_path(*found[1:]) == path


@pytest.mark.parametrize("seed", range(3))
def test_real_entries_align_at_the_same_cost(seed):
    rng = np.random.default_rng(seed)
    reference, other = rng.random((9, 4)), rng.random((13, 4))
    ((cost, rows, columns),) = align(reference, [other])
    expected, path = naive.dtw(reference.tolist(), other.tolist())
    assert cost == pytest.approx(float(expected), abs=1e-5)
    assert as_path(rows, columns) == path


def test_ties_of_fractions_are_ties_whatever_their_last_bits_say():
    reference = np.array([[1 / 3], [2 / 3]])
    other = np.array([[0.1 + 0.2 + 1 / 30], [1 - 1 / 3]])  # the same up to rounding
    ((cost, rows, columns),) = align(reference, [other])
    assert cost == 0.0
    assert as_path(rows, columns) == [(0, 0), (1, 1)]


def test_a_sequence_aligns_with_itself_frame_by_frame():
    sequence = np.repeat(random_bits(np.random.default_rng(1), 6), 3, axis=0)
    ((cost, rows, columns),) = align(sequence, [sequence])
    assert cost == 0
    np.testing.assert_array_equal(rows, columns)


def test_small_batches_change_nothing(monkeypatch):
    rng = np.random.default_rng(2)
    reference, others = random_bits(rng, 8), [random_bits(rng, n) for n in (3, 9, 1, 20, 5)]
    together = list(align(reference, others))
    monkeypatch.setattr(dtw, "CELLS_AT_ONCE", 100)
    for one, other in zip(together, align(reference, others), strict=True):
        assert one[0] == other[0]
        np.testing.assert_array_equal(one[1], other[1])
        np.testing.assert_array_equal(one[2], other[2])


def test_nothing_to_align_gives_nothing():
    assert list(align(np.zeros((3, 2)), [])) == []


@pytest.mark.parametrize(
    ("other", "complaint"),
    [
        (np.zeros((0, 2)), "1 to 4096 frames, got 0"),
        (np.zeros((4097, 2)), "1 to 4096 frames, got 4097"),
        (np.zeros((3, 3)), r"shape \(T, 2\)"),
        (np.zeros(3), r"shape \(T, 2\)"),
    ],
)
def test_a_sequence_of_a_wrong_shape_is_refused(other, complaint):
    with pytest.raises(ParameterError, match=complaint):
        list(align(np.zeros((3, 2)), [other]))


def test_the_oracle_itself_gives_the_textbook_cost():
    cost, path = naive.dtw([[0], [1], [1]], [[0], [0], [1]])
    assert cost == Fraction(0)
    assert path == [(0, 0), (0, 1), (1, 2), (2, 2)]
