import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mocapidx.errors import ParameterError
from mocapidx.synthesis.timewarps import MonotoneCurve, slope_limited_path, smooth_timewarp
from tests import naive_blending


def paths(draw_steps):
    """Cells from (0, 0) by steps of at most one frame."""
    steps = np.array([[(1, 1), (1, 0), (0, 1)][s] for s in draw_steps] + [(1, 1)])
    return np.concatenate(([[0, 0]], np.cumsum(steps, axis=0)))


@given(arrays(float, st.tuples(st.integers(2, 5), st.integers(2, 5)), elements=st.floats(0, 9)))
def test_the_path_costs_what_the_best_of_all_paths_costs(costs):
    path = slope_limited_path(costs, 3)
    expected = naive_blending.slope_limited_total(costs.tolist(), 3)
    assert costs[path[:, 0], path[:, 1]].sum() == pytest.approx(expected)


@given(arrays(float, st.tuples(st.integers(4, 12), st.integers(4, 12)), elements=st.floats(0, 9)))
def test_a_path_joins_the_corners_and_keeps_to_the_slope(costs):
    path = slope_limited_path(costs)
    if path is None:
        assert max(costs.shape) > 3 * min(costs.shape)
        return
    assert path[0].tolist() == [0, 0]
    assert path[-1].tolist() == [n - 1 for n in costs.shape]
    steps = np.diff(path, axis=0)
    assert ((steps == 0) | (steps == 1)).all()
    assert steps.any(axis=1).all()
    for axis in (0, 1):
        assert np.bincount(path[:, axis]).max() <= 3


def test_a_motion_too_long_for_another_has_no_path():
    assert slope_limited_path(np.zeros((3, 10))) is None
    assert slope_limited_path(np.zeros((3, 9))) is not None
    assert slope_limited_path(np.zeros((1, 1))) is not None


@given(st.lists(st.integers(0, 2), min_size=1, max_size=60), st.integers(0, 8))
def test_timewarps_increase_strictly_and_keep_their_ends(steps, width):
    path = paths(steps)
    curve = smooth_timewarp(path, width)
    at = np.linspace(0, path[-1, 0], 200)
    values = curve(at)
    assert (np.diff(values) > 0).all()
    assert (values[0], values[-1]) == (0, path[-1, 1])
    # whichever motion comes first
    other = smooth_timewarp(path[:, ::-1], width)
    np.testing.assert_array_equal(curve.x, other.y)
    np.testing.assert_array_equal(curve.y, other.x)


def test_a_straight_path_is_a_straight_curve():
    curve = smooth_timewarp(np.repeat(np.arange(20)[:, None], 2, axis=1), 5)
    at = np.linspace(0, 19, 77)
    np.testing.assert_allclose(curve(at), at, atol=1e-12)
    np.testing.assert_allclose(curve.inverse()(at), at, atol=1e-12)


def test_curves_go_through_their_points_and_stay_at_their_ends():
    curve = MonotoneCurve(np.array([0.0, 1.0, 4.0]), np.array([0.0, 10.0, 11.0]))
    np.testing.assert_allclose(curve(np.array([-5.0, 0.0, 1.0, 4.0, 9.0])), [0, 0, 10, 11, 11])


def test_what_does_not_increase_is_no_timewarp():
    with pytest.raises(ParameterError, match="increase"):
        MonotoneCurve(np.array([0.0, 1.0]), np.array([1.0, 1.0]))
    with pytest.raises(ParameterError, match="two points"):
        MonotoneCurve(np.zeros(1), np.zeros(1))
    with pytest.raises(ParameterError, match="single frame"):
        smooth_timewarp(np.array([[0, 0], [0, 1]]), 2)
