import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.graphs.frame_distance import METRES_A_STEP, distance_grid, frame_clouds
from tests.naive_webs import frame_distance

ALL = np.ones(24, dtype=bool)


def walk(seed, frames=30):
    random = np.random.default_rng(seed)
    pose = random.normal(size=(24, 3)) * 0.3 + [0.0, 1.0, 0.0]
    return pose + np.cumsum(random.normal(size=(frames, 24, 3)) * 0.03, axis=0)


def grid_of(one, other, reach=3, **options):
    clouds = frame_clouds(one, ALL, reach), frame_clouds(other, ALL, reach)
    return distance_grid(*clouds, **options) * METRES_A_STEP


def moved(poses, angle, east, north):
    turned = poses.copy()
    turned[..., 0] = np.cos(angle) * poses[..., 0] - np.sin(angle) * poses[..., 2] + east
    turned[..., 2] = np.sin(angle) * poses[..., 0] + np.cos(angle) * poses[..., 2] + north
    return turned


@pytest.mark.parametrize(("i", "k"), [(0, 0), (0, 12), (5, 29), (17, 8), (29, 29)])
def test_it_is_the_least_over_all_places_and_turns(i, k):
    one, other = walk(1), walk(2)
    expected = frame_distance(one, other, i, k, reach=3)
    assert grid_of(one, other)[i, k] == pytest.approx(expected, abs=1e-4)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 99), st.floats(-7, 7), st.floats(-20, 20), st.floats(-20, 20))
def test_moving_and_turning_a_motion_on_the_floor_changes_nothing(seed, angle, east, north):
    one, other = walk(seed), walk(seed + 100)
    before = grid_of(one, other)
    np.testing.assert_allclose(grid_of(one, moved(other, angle, east, north)), before, atol=3e-4)
    np.testing.assert_allclose(grid_of(moved(one, angle, east, north), other), before, atol=3e-4)


def test_it_is_symmetric():
    one, other = walk(3), walk(4)
    np.testing.assert_allclose(grid_of(one, other), grid_of(other, one).T, atol=1.1e-4)


def test_height_counts():
    one = walk(5)
    assert grid_of(one, one + np.array([0.0, 0.5, 0.0]))[7, 7] == pytest.approx(0.5, abs=1e-3)


def test_a_frame_is_at_no_distance_from_itself():
    one = walk(6)
    assert not grid_of(one, one, diagonal=0).diagonal().any()
    clouds = frame_clouds(one, ALL, 3), frame_clouds(one, ALL, 3, slice(10, 30))
    grid = distance_grid(*clouds, diagonal=10)
    assert not grid[np.arange(10, 30), np.arange(20)].any()


def test_tiles_join_without_seams(monkeypatch):
    one, other = walk(7, 50), walk(8, 40)
    whole = grid_of(one, other)
    monkeypatch.setattr("mocapidx.graphs.frame_distance.TILE", 16)
    np.testing.assert_allclose(grid_of(one, other), whole, atol=1.1e-4)


def test_only_joints_that_both_have_are_compared():
    one, other = walk(9), walk(10)
    some = ALL.copy()
    some[[3, 8, 20]] = False
    one[:, ~some] = np.nan
    grid = distance_grid(frame_clouds(one, some, 3), frame_clouds(other, some, 3))
    expected = frame_distance(one[:, some], other[:, some], 12, 20, reach=3)
    assert grid[12, 20] * METRES_A_STEP == pytest.approx(expected, abs=1e-4)
    with pytest.raises(ParameterError, match="no joint in common"):
        frame_clouds(one, np.zeros(24, dtype=bool), 3)


def test_clouds_at_a_stride_are_those_of_the_thinned_motion():
    one = walk(11, 60)
    thin = frame_clouds(one[::2], ALL, 3)
    strided = frame_clouds(one, ALL, 3, np.arange(0, 60, 2), stride=2)
    inner = slice(4, -4)  # at the ends, the last frames repeated differ
    np.testing.assert_array_equal(strided.floor[inner], thin.floor[inner])
