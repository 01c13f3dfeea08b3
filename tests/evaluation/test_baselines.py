import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.alignment.subsequence import subsequence_costs
from mocapidx.errors import ParameterError
from mocapidx.evaluation.baselines import (
    dense_match,
    feature_costs,
    joint_quaternions,
    position_costs,
    quaternion_costs,
    relative_positions,
)
from mocapidx.features.words import pack_words
from mocapidx.skeleton.joints import INDEX, PARENTS


def random_poses(seed, frames=6):
    """Bones of fixed lengths that point anywhere, but hips and shoulders stay apart."""
    random = np.random.default_rng(seed)
    poses = np.zeros((frames, 24, 3))
    lengths = 0.2 + random.random(24)
    for joint in range(1, 24):
        direction = random.normal(size=(frames, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        poses[:, joint] = poses[:, PARENTS[joint]] + lengths[joint] * direction
    return poses


def turned_about_y(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


@pytest.mark.parametrize("derive", [relative_positions, joint_quaternions])
@given(seed=st.integers(0, 1000), angle=st.floats(0, 6), scale=st.floats(0.2, 3))
def test_place_heading_and_size_do_not_matter(derive, seed, angle, scale):
    poses = random_poses(seed)
    moved = scale * poses @ turned_about_y(angle).T + [1.0, 0.3, -2.0]
    one, other = derive(poses), derive(moved)
    if derive is joint_quaternions:  # opposite quaternions are the same rotation
        np.testing.assert_allclose(np.abs((one * other).sum(axis=2)), 1.0, atol=1e-6)
    else:
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_seen_from_above_the_hips_lie_along_x():
    positions = relative_positions(random_poses(5))
    across = positions[:, INDEX["lhip"]] - positions[:, INDEX["rhip"]]
    np.testing.assert_allclose(across[:, 2], 0.0, atol=1e-12)
    assert (across[:, 0] > 0).all()
    np.testing.assert_allclose(positions[:, 0], 0.0)


@pytest.mark.parametrize("pose", [0.0, np.nan])
def test_a_body_without_size_is_left_as_it_is(pose):
    poses = np.full((3, 24, 3), pose)
    np.testing.assert_array_equal(relative_positions(poses), poses)


def test_a_raised_arm_turns_the_shoulder_only():
    poses = np.repeat(random_poses(2, frames=1), 2, axis=0)
    joints = [INDEX[name] for name in ("relbow", "rwrist", "rfingers")]
    shoulder = poses[1, INDEX["rshoulder"]]
    # Turning the straight arm about the shoulder changes no joint further down.
    elbow = poses[1, INDEX["relbow"]] - shoulder
    for n, name in enumerate(joints, start=1):
        poses[:, name] = shoulder + n * elbow
    axis = np.cross(elbow, [0.3, 1.0, 0.2])
    axis /= np.linalg.norm(axis)
    moved = poses[1, joints] - shoulder
    c, s = np.cos(0.7), np.sin(0.7)
    poses[1, joints] = shoulder + c * moved + s * np.cross(axis, moved)
    one, other = joint_quaternions(poses)
    angles = 2 * np.arccos(np.clip(np.abs((one * other).sum(axis=1)), 0, 1))
    assert np.count_nonzero(angles > 1e-6) == 1


def test_quaternions_have_length_one_and_unknown_parts_are_nan():
    poses = random_poses(1)
    poses[:, INDEX["lfingers"]] = np.nan
    lengths = np.linalg.norm(joint_quaternions(poses), axis=2)
    known = np.isfinite(lengths)
    np.testing.assert_allclose(lengths[known], 1.0)
    assert (~known).sum() == len(poses)


def test_pose_distances_are_zero_to_itself_and_symmetric():
    poses = random_poses(4, frames=9)
    for costs, values in (
        (position_costs, relative_positions(poses)),
        (quaternion_costs, joint_quaternions(poses)),
        (feature_costs, np.random.default_rng(0).random((9, 5)) < 0.5),
    ):
        table = costs(values, values)
        np.testing.assert_allclose(np.diag(table), 0.0, atol=1e-6)
        np.testing.assert_allclose(table, table.T, atol=1e-12)
        assert (table >= 0).all()


def test_pose_distances_are_what_they_say():
    one, other = relative_positions(random_poses(1)), relative_positions(random_poses(2))
    expected = np.sqrt(((one[0] - other[3]) ** 2).sum() / 24)
    assert position_costs(one, other)[0, 3] == pytest.approx(expected)
    first, second = joint_quaternions(random_poses(1)), joint_quaternions(random_poses(2))
    angles = [np.arccos(min(1.0, abs(p @ q))) for p, q in zip(first[0], second[3], strict=True)]
    assert quaternion_costs(first, second)[0, 3] == pytest.approx(np.mean(angles) * 2 / np.pi)
    assert feature_costs(np.array([[1, 0, 1, 0]]) > 0, np.array([[1, 1, 0, 0]]) > 0) == 0.5


def test_joints_that_a_rig_lacks_are_left_out():
    poses = random_poses(3)
    lacking = poses.copy()
    lacking[:, INDEX["headtop"]] = np.nan
    costs = position_costs(relative_positions(poses), relative_positions(lacking))
    assert np.isfinite(costs).all()


@given(st.integers(0, 10_000), st.integers(1, 8), st.integers(1, 30), st.booleans())
def test_dense_matching_agrees_with_matching_of_words(seed, rows, frames, broken):
    random = np.random.default_rng(seed)
    query, features = random.random((rows, 5)) < 0.5, random.random((frames, 5)) < 0.5
    breaks = np.array([frames // 2, frames // 2 + 1]) if broken and frames > 3 else None
    distances, starts = dense_match(feature_costs(query, features), breaks)
    care = np.full(rows, 31, dtype=np.uint64)
    expected = subsequence_costs(pack_words(query), care, pack_words(features), breaks)
    np.testing.assert_allclose(distances, expected, rtol=1e-5)
    assert ((starts >= 0) == np.isfinite(expected)).all()


def test_the_start_of_a_match_is_where_the_query_begins():
    random = np.random.default_rng(0)
    motion = random.random((60, 20)) < 0.5
    distances, starts = dense_match(feature_costs(motion[20:40], motion))
    assert distances.argmin() == 39
    assert starts[39] == 20


def test_an_empty_query_is_refused():
    with pytest.raises(ParameterError, match="no frames"):
        dense_match(np.zeros((0, 4)))
