"""Subsequence warping with weights: exact against the plain version, whatever the blocks."""

import numpy as np
import pytest

from mocapidx.alignment import weighted
from mocapidx.alignment.weighted import LARGEST_WEIGHT, match_rows
from mocapidx.errors import ParameterError
from mocapidx.features.words import pack_words
from tests import naive_weighted


def random_case(seed, rows, frames, features=5):
    rng = np.random.default_rng(seed)
    ones = rng.random((rows, features)) < 0.5
    weights = rng.integers(0, 6, (rows, features)).astype(float)
    return ones, weights, rng.random((frames, features)) < 0.5


@pytest.mark.parametrize("seed", range(8))
def test_costs_and_starts_are_those_of_the_plain_version(seed):
    ones, weights, frames = random_case(seed, rows=1 + seed, frames=30)
    costs, starts = match_rows(ones, weights, pack_words(frames))
    expected = naive_weighted.matches(ones, weights, frames)
    assert list(zip(costs.tolist(), starts.tolist(), strict=True)) == expected


def test_a_match_with_itself_has_its_own_tempo():
    ones = np.repeat(np.eye(3, dtype=bool), 5, axis=0)
    costs, starts = match_rows(ones, np.full(ones.shape, 7.0), pack_words(ones))
    assert (costs[-1], starts[-1]) == (0, 0)


def test_blocks_change_nothing(monkeypatch):
    ones, weights, frames = random_case(1, rows=9, frames=400)
    breaks = np.array([100, 101, 250, 251])
    whole = match_rows(ones, weights, pack_words(frames), breaks)
    monkeypatch.setattr(weighted, "BLOCK", 37)
    monkeypatch.setattr(weighted, "ROWS_AT_ONCE", 2)
    parts = match_rows(ones, weights, pack_words(frames), breaks)
    np.testing.assert_array_equal(whole, parts)


def test_no_match_crosses_two_breaks():
    ones, weights, frames = random_case(2, rows=4, frames=30)
    words = pack_words(frames)
    costs, starts = match_rows(ones, weights, words, np.array([14, 15]))
    for part in (slice(0, 14), slice(16, 30)):
        own_costs, own_starts = match_rows(ones, weights, words[part])
        np.testing.assert_array_equal(costs[part], own_costs)
        shifted = np.where(own_starts < 0, -1, own_starts + part.start)
        np.testing.assert_array_equal(starts[part], shifted)
    assert np.isinf(costs[14:16]).all()


def test_the_largest_pattern_is_still_exact():
    ones = np.ones((4096, 64), dtype=bool)
    weights = np.full((4096, 64), float(LARGEST_WEIGHT))
    costs, starts = match_rows(ones, weights, np.zeros(4200, dtype=np.uint64))
    # The fewest frames: one step of one row, then every second row, each paid twice.
    assert costs[2048] == 4096 * 64 * LARGEST_WEIGHT + 2047
    assert starts[2048] == 0
    assert np.isinf(costs[2047])
    assert starts[2047] == -1


@pytest.mark.parametrize(
    ("ones", "weights"),
    [
        (np.zeros((0, 3), bool), np.zeros((0, 3))),
        (np.zeros((4097, 1), bool), np.zeros((4097, 1))),
        (np.zeros((2, 3), bool), np.zeros((2, 4))),
        (np.zeros((2, 65), bool), np.zeros((2, 65))),
        (np.zeros((2, 3), bool), np.full((2, 3), 0.5)),
        (np.zeros((2, 3), bool), np.full((2, 3), -1.0)),
        (np.zeros((2, 3), bool), np.full((2, 3), np.nan)),
        (np.zeros((2, 3), bool), np.full((2, 3), LARGEST_WEIGHT + 1.0)),
    ],
)
def test_odd_patterns_are_refused(ones, weights):
    with pytest.raises(ParameterError):
        match_rows(ones, weights, np.zeros(9, dtype=np.uint64))
