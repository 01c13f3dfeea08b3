"""Short gaps are filled so that motion stays smooth, long ones are left and counted."""

import numpy as np
import pytest

from mocapidx.skeleton.gaps import GapCounts, fill_gaps, find_gaps, stretches


def wave(frames=200, rate=100.0):
    times = np.arange(frames) / rate
    return np.stack((np.sin(3 * times), np.cos(2 * times), times), axis=1)[:, None]


def test_stretches_are_half_open():
    mask = np.array([True, False, True, True, False, True])
    assert stretches(mask).tolist() == [[0, 1], [2, 4], [5, 6]]
    assert stretches(np.zeros(3, dtype=bool)).shape == (0, 2)


def test_a_short_gap_is_filled_closely_and_a_long_one_is_left():
    points = wave()
    holed = points.copy()
    holed[50:70] = np.nan
    holed[100:121] = np.nan
    filled, counts = fill_gaps(holed, 100.0, 0.2)
    np.testing.assert_allclose(filled[50:70], points[50:70], atol=0.01)
    assert np.isnan(filled[100:121]).all()
    assert counts == GapCounts(1, 20, 1, 21, 0.21)
    assert np.isnan(holed[50:70]).all()  # the input is left as it was


def test_nothing_is_filled_at_the_ends_or_when_told_so():
    points = wave()
    points[:5] = points[-5:] = points[60:62] = np.nan
    assert fill_gaps(points, 100.0, 0.2)[1] == GapCounts(1, 2, 2, 10, 0.05)
    filled, counts = fill_gaps(points, 100.0, 0.0)
    assert filled is points
    assert counts.filled == 0


def test_a_straight_line_stays_one_even_between_single_frames():
    points = np.outer(np.arange(20.0), [1.0, -2.0, 0.5])[:, None]
    holed = points.copy()
    holed[[1, 2, 4, 5, 7]] = np.nan
    np.testing.assert_allclose(fill_gaps(holed, 100.0, 0.2)[0], points, atol=1e-12)


def test_points_without_gaps_cost_nothing():
    points = wave()
    filled, counts = fill_gaps(points, 100.0, 0.2)
    assert filled is points
    assert counts == GapCounts()
    assert [len(g) for g in find_gaps(points)] == [0]


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_points_never_seen_are_one_gap(frames):
    assert fill_gaps(np.full((frames, 2, 3), np.nan), 100.0, 5.0)[1].left == 2
