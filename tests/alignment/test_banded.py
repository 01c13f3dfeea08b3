import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.alignment import banded
from mocapidx.alignment.banded import align_inside, refine_match
from mocapidx.alignment.coarse import SegmentMatch, full_region, widened_region
from mocapidx.alignment.dtw import align
from mocapidx.errors import ParameterError
from tests import naive_warping as naive


def from_matrix(costs):
    matrix = np.array(costs, dtype=np.float64)
    return lambda rows, columns: matrix[rows, columns]


def match_of(lengths, others):
    bounds, other_bounds = (np.concatenate(([0], np.cumsum(x))) for x in (lengths, others))
    return SegmentMatch(1, np.arange(len(lengths), dtype=np.uint64) % 2, bounds, other_bounds)


@given(st.data(), st.integers(0, 4))
def test_the_path_is_the_cheapest_inside_the_region(data, margin):
    count = data.draw(st.integers(1, 4))
    sizes = st.lists(st.integers(1, 5), min_size=count, max_size=count)
    match = match_of(data.draw(sizes), data.draw(sizes))
    rows, columns = match.bounds[-1], match.other_bounds[-1]
    row = st.lists(st.integers(0, 3), min_size=int(columns), max_size=int(columns))
    costs = data.draw(st.lists(row, min_size=int(rows), max_size=int(rows)))
    allowed = naive.in_widened_segments(match.bounds, match.other_bounds, margin)
    expected, path = naive.warp(costs, allowed)
    region = widened_region(match, np.full(count, margin))
    found = align_inside(region, from_matrix(costs))
    assert found.cost == expected
    assert list(zip(found.rows.tolist(), found.columns.tolist(), strict=True)) == path
    assert found.costs.tolist() == [costs[k][column] for k, column in path]


def test_distances_are_asked_for_inside_the_region_only():
    match = match_of([4, 4, 4], [5, 3, 6])
    region = widened_region(match, np.array([1, 1, 1]))
    asked = set()

    def distance(rows, columns):
        asked.update(zip(rows.tolist(), columns.tolist(), strict=True))
        return np.zeros(len(rows))

    align_inside(region, distance)
    inside = {(k, c) for k in range(12) for c in range(region.lows[k], region.highs[k])}
    assert asked == inside


def test_the_full_region_gives_classical_time_warping():
    rng = np.random.default_rng(0)
    one, other = rng.integers(0, 2, (30, 5)) * 1.0, rng.integers(0, 2, (41, 5)) * 1.0
    cost, rows, columns = next(align(one, [other]))

    def distance(k, column):
        return np.abs(one[k] - other[column]).sum(axis=1)

    found = align_inside(full_region(30, 41), distance)
    assert found.cost == cost
    assert found.rows.tolist() == rows.tolist()
    assert found.columns.tolist() == columns.tolist()


def test_a_region_that_is_too_narrow_is_widened_where_the_path_needs_it():
    # The cheap way is a slope of one; the matched segments stand two frames beside it.
    size = 40
    costs = np.abs(np.subtract.outer(np.arange(size), np.arange(size))) * 1.0
    match = match_of([10, 10, 20], [10, 14, 16])
    refined = refine_match(match, from_matrix(costs), 0)
    assert refined.path.cost == 0
    assert refined.rounds > 1
    assert refined.region.share < 0.9


def test_a_region_that_is_wide_enough_is_looked_at_once():
    costs = np.abs(np.subtract.outer(np.arange(30), np.arange(30))) * 1.0
    refined = refine_match(match_of([10, 10, 10], [10, 10, 10]), from_matrix(costs), 2)
    assert refined.rounds == 1
    assert refined.path.cost == 0


def test_one_frame_can_be_aligned_with_many():
    found = align_inside(full_region(1, 3), from_matrix([[1, 2, 3]]))
    assert found.columns.tolist() == [0, 1, 2]
    assert found.cost == 6


def test_a_region_that_would_exhaust_memory_is_refused(monkeypatch):
    monkeypatch.setattr(banded, "MOST_CELLS", 100)
    with pytest.raises(ParameterError, match="align shorter stretches"):
        align_inside(full_region(11, 10), from_matrix(np.zeros((11, 10))))
