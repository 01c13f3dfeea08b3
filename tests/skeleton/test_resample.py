import numpy as np
import pytest

from mocapidx.errors import ParameterError
from mocapidx.model import Motion
from mocapidx.skeleton.resample import kept_frames, resample_motion, resampled_frames


def motion(frames, rate, rest=None):
    positions = np.random.default_rng(0).normal(size=(frames, 2, 3))
    return Motion(("a", "b"), positions, rate, rest, ("b",))


def test_a_quarter_of_the_rate_is_every_fourth_frame_unchanged():
    source = motion(10, 120.0, np.zeros((2, 3)))
    found = resample_motion(source, 30.0)
    np.testing.assert_array_equal(found.positions, source.positions[::4])
    assert found.rate == 30.0
    assert found.made == ("b",)
    assert found.rest is source.rest


@pytest.mark.parametrize(
    ("frames", "source", "rate", "expected"),
    [(1, 120, 30, 1), (4, 120, 30, 1), (5, 120, 30, 2), (3, 30, 60, 5), (241, 120, 30, 61),
     (31, 30, 29.97, 30), (4, 3, 1, 2)],
)  # fmt: skip
def test_the_last_frame_is_not_after_the_last_time(frames, source, rate, expected):
    assert resampled_frames(frames, source, rate) == expected
    assert len(resample_motion(motion(frames, source), rate).positions) == expected


@pytest.mark.parametrize("rate", [30.0, 24.0, 100.0, 50.1, 7.0])
def test_between_frames_the_line_is_followed(rate):
    source = motion(50, 60.0)
    found = resample_motion(source, rate)
    times = np.arange(len(found.positions)) / rate
    for joint in range(2):
        for axis in range(3):
            expected = np.interp(times, np.arange(50) / 60.0, source.positions[:, joint, axis])
            np.testing.assert_allclose(found.positions[:, joint, axis], expected, atol=1e-9)


def test_the_same_rate_changes_nothing():
    source = motion(5, 30.0)
    assert resample_motion(source, 30.0) is source


@pytest.mark.parametrize("rate", [0, -1, np.nan, np.inf])
def test_a_rate_must_be_positive(rate):
    with pytest.raises(ParameterError, match="rate"):
        resample_motion(motion(5, 30.0), rate)


def test_nothing_can_not_be_resampled():
    with pytest.raises(ParameterError, match="no frames"):
        resample_motion(motion(0, 30.0), 10.0)


@pytest.mark.parametrize(
    ("source_rate", "rate", "step"),
    [(120, 30, 4), (30, 30, 1), (119.88, 29.97, 4), (60, 20, 3), (1 / 0.0083333, 30.00012, 4)],
)
def test_frames_are_kept_where_the_rates_divide(source_rate, rate, step):
    kept = kept_frames(26, source_rate, rate)
    assert kept.tolist() == list(range(0, 26, step))
    positions = np.random.default_rng(0).normal(size=(26, 1, 3))
    resampled = resample_motion(Motion(("root",), positions, source_rate), rate)
    np.testing.assert_array_equal(resampled.positions, positions[kept])


@pytest.mark.parametrize(("source_rate", "rate"), [(100, 30), (30, 120), (24, 25), (0.1, 1e4)])
def test_no_frames_are_kept_where_others_lie_between(source_rate, rate):
    assert kept_frames(1_000_000, source_rate, rate) is None
