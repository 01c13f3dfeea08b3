"""The best of overlapping hits, all at once, against one hit after the other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.templates.match import Hits, merge_hits
from mocapidx.templates.overlaps import best_of_overlapping


@given(
    st.lists(st.tuples(st.integers(0, 2), st.integers(0, 40), st.integers(1, 15)), max_size=40),
    st.sampled_from([0.0, 0.3, 0.5, 0.9]),
)
def test_as_one_after_the_other(rows, shared):
    documents, starts, lengths = np.array(rows, dtype=np.int64).reshape(-1, 3).T
    costs = np.arange(len(rows), dtype=np.float32)
    hits = Hits(documents, starts, starts + lengths, costs)
    expected = merge_hits([hits], shared).costs.astype(np.int64)
    kept = best_of_overlapping(documents, starts, starts + lengths, shared)
    np.testing.assert_array_equal(kept, expected)


def test_a_dropped_hit_drops_nobody():
    # The second overlaps the first and the third, which do not overlap each other.
    starts, ends = np.array([0, 6, 12]), np.array([10, 16, 22])
    kept = best_of_overlapping(np.zeros(3, dtype=np.int64), starts, ends, 0.3)
    assert kept.tolist() == [0, 2]


def test_a_flight_of_stairs_takes_no_longer():
    # Each is better than the next, so that whole rounds would decide two of them only.
    starts = np.arange(5000) * 4
    kept = best_of_overlapping(np.zeros(5000, dtype=np.int64), starts, starts + 10, 0.5)
    assert kept.tolist() == list(range(0, 5000, 2))


@pytest.mark.parametrize("count", [0, 1, 3000])
def test_any_number_of_hits(count):
    starts = np.random.default_rng(1).permutation(count) * 2
    kept = best_of_overlapping(np.zeros(count, dtype=np.int64), starts, starts + 40, 0.5)
    order = np.sort(starts[kept])
    assert (np.diff(order) >= 20).all()
