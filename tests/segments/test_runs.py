"""Runs of equal words."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.segments.runs import find_runs


@given(
    st.lists(st.integers(0, 3), min_size=1, max_size=60),
    st.sampled_from([np.uint64, np.uint32, np.int8]),
)
def test_runs_are_those_of_a_walk_over_the_frames(words, dtype):
    values, bounds = find_runs(np.array(words, dtype=dtype))
    expected = [(word, len(list(group))) for word, group in itertools.groupby(words)]
    assert values.dtype == dtype
    assert values.tolist() == [word for word, _ in expected]
    assert bounds.dtype == np.int64
    assert bounds[0] == 0
    assert np.diff(bounds).tolist() == [length for _, length in expected]


@pytest.mark.parametrize("words", [np.zeros(0, np.uint64), np.zeros(2), np.zeros((2, 2), int)])
def test_no_frames_or_no_integers_have_no_runs(words):
    with pytest.raises(ParameterError):
        find_runs(words)
