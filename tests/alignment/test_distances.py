import numpy as np
import pytest

from mocapidx.alignment.distances import common_joints, pose_distance, word_distance
from mocapidx.errors import ParameterError
from tests.naive_warping import pose_distance as naive_distance

ZERO = np.zeros(1, dtype=np.int64)


def bodies(seed, frames=3, joints=6):
    return np.random.default_rng(seed).normal(size=(frames, joints, 3))


def turned(positions, angle):
    c, s = np.cos(angle), np.sin(angle)
    return positions @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])


@pytest.mark.parametrize("seed", range(4))
def test_the_closed_form_is_the_best_of_all_turns(seed):
    one, other = bodies(seed), bodies(seed + 100)
    rows, columns = np.array([0, 1, 2]), np.array([2, 0, 1])
    found = pose_distance(one, other)(rows, columns)
    expected = [naive_distance(one[k], other[c]) for k, c in zip(rows, columns, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("angle", [0.3, 2.0, -3.1])
def test_where_a_body_stands_and_faces_makes_no_difference(angle):
    one = bodies(1)
    other = turned(one, angle) + np.array([4.0, 0.0, -2.0])
    np.testing.assert_allclose(pose_distance(one, other)(ZERO, ZERO), 0.0, atol=1e-7)


def test_a_body_that_is_lifted_by_half_a_metre_is_half_a_metre_away():
    one = bodies(2)
    found = pose_distance(one, one + np.array([0.0, 0.5, 0.0]))(ZERO, ZERO)
    np.testing.assert_allclose(found, 0.5)


def test_a_mirror_image_is_not_the_same_pose():
    one = bodies(3)
    assert pose_distance(one, one * np.array([-1.0, 1.0, 1.0]))(ZERO, ZERO)[0] > 0.1


def test_joints_must_be_known_in_all_frames_of_both():
    one, other = bodies(4), bodies(5)
    one[1, 2] = np.nan
    other[:, 4] = np.nan
    assert common_joints(one, other).tolist() == [True, True, False, True, False, True]


def test_poses_need_the_same_joints():
    for other in (bodies(1, joints=5), bodies(1, joints=0)):
        with pytest.raises(ParameterError, match="same joints"):
            pose_distance(bodies(0), other)
    with pytest.raises(ParameterError, match="same joints"):
        pose_distance(bodies(1, joints=0), bodies(1, joints=0))


def test_words_differ_in_the_selected_features_only():
    one, other = np.array([0b1011], np.uint64), np.array([0b0110, 0b1011], np.uint64)
    distance = word_distance(one, other, 0b0111)
    assert distance(np.array([0, 0]), np.array([0, 1])).tolist() == [2.0, 0.0]
