import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.formats.registry import read_recording
from mocapidx.model import Recording
from mocapidx.skeleton import kinematics
from mocapidx.skeleton.kinematics import node_positions, zero_pose
from mocapidx.skeleton.rotations import multiplied, times_vector, turned, upright
from tests import naive_kinematics as naive
from tests.made_recordings import random_recording
from tests.small_files import AMC, ASF, BVH


def recording_of(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    (tmp_path / "small.asf").write_text(ASF)
    return read_recording(tmp_path / name)


def test_a_bvh_leg_stands_where_it_does_by_hand(tmp_path):
    # frame 1: the hip turns by 90 degrees about z, so the thigh points along +x; the knee turns
    # by 90 degrees about x, which takes the shank (0, -1, 0) to (0, 0, -1), left so by z
    positions = node_positions(recording_of(tmp_path, "take.bvh", BVH), range(3))
    np.testing.assert_allclose(positions[0], [[0, 3, 0], [0, 1, 0], [0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(positions[1], [[1, 3, 0], [3, 3, 0], [3, 3, -1]], atol=1e-12)


def test_an_acclaim_leg_stands_where_it_does_by_hand(tmp_path):
    # frame 1: the thigh turns by 90 degrees about x, so it points along -z, and the rest with it.
    # frame 2: the root turns by 90 degrees about y; the shank turns by 90 degrees about its own
    # x, which its axis (90 degrees about z) lays along y: a shank along y stays, the foot is
    # turned from z to x by it and from x to -z by the root
    positions = node_positions(recording_of(tmp_path, "take.amc", AMC), range(4))
    first = [[0, 3, 0], [0, 3, -2], [0, 3, -3], [0, 2.5, -3]]
    second = [[1, 3, 0], [1, 1, 0], [1, 0, 0], [1, 0, -0.5]]
    np.testing.assert_allclose(positions[0], first, atol=1e-12)
    np.testing.assert_allclose(positions[1], second, atol=1e-12)


@pytest.mark.parametrize(("name", "text"), [("take.bvh", BVH), ("take.amc", AMC)])
def test_files_agree_with_one_matrix_at_a_time(tmp_path, name, text):
    recording = recording_of(tmp_path, name, text)
    nodes = range(len(recording.skeleton.names))
    expected = naive.node_positions(recording)
    np.testing.assert_allclose(node_positions(recording, nodes), expected, atol=1e-12)


@pytest.mark.parametrize("positions", ["add", "replace"])
@pytest.mark.parametrize("turned_by", ["own", "parent"])
@pytest.mark.parametrize("seed", range(12))
def test_any_tree_agrees_with_one_matrix_at_a_time(seed, turned_by, positions):
    recording = random_recording(seed, turned_by)
    expected = np.array(naive.node_positions(recording, positions))
    nodes = range(len(recording.skeleton.names))
    found = node_positions(recording, nodes, positions)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    some = list(nodes)[::-2]
    np.testing.assert_allclose(
        node_positions(recording, some, positions), expected[:, some], atol=1e-12
    )


def test_blocks_parts_and_absent_nodes(monkeypatch):
    recording = random_recording(3, "parent", frames=11)
    whole = node_positions(recording, [0, 1])
    monkeypatch.setattr(kinematics, "BLOCK", 4)
    np.testing.assert_allclose(node_positions(recording, [0, 1]), whole, atol=1e-14)
    part = node_positions(recording, [-1, 1], frames=np.array([0, 7]))
    assert np.isnan(part[:, 0]).all()
    np.testing.assert_allclose(part[:, 1], whole[[0, 7], 1], atol=1e-14)


def test_the_zero_pose_is_the_pose_of_zero_channels():
    recording = random_recording(5, "own")
    still = Recording(
        recording.skeleton,
        recording.channel_nodes,
        recording.channel_kinds,
        np.zeros((1, recording.values.shape[1])),
        None,
        None,
    )
    nodes = range(len(recording.skeleton.names))
    pose = node_positions(still, nodes)[0]
    np.testing.assert_allclose(zero_pose(recording.skeleton), pose - pose[0], atol=1e-12)


@given(st.integers(0, 2), st.floats(-10, 10))
def test_turning_about_an_axis_is_the_textbook_matrix(axis, angle):
    matrix = np.random.default_rng(0).normal(size=(3, 3, 1))
    expected = matrix[:, :, 0] @ np.array(naive.turn(axis, angle))
    found = turned(matrix, axis, np.cos([angle]), np.sin([angle]))
    np.testing.assert_allclose(found[:, :, 0], expected, atol=1e-12)


def test_products_over_all_frames():
    random = np.random.default_rng(1)
    matrices, constant, vector = (random.normal(size=s) for s in ((3, 3, 4), (3, 3), (3,)))
    expected = np.einsum("ikt,kj->ijt", matrices, constant)
    np.testing.assert_allclose(multiplied(matrices, constant), expected)
    expected = np.einsum("ikt,k->it", matrices, vector)
    np.testing.assert_allclose(times_vector(matrices, vector), expected)


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_turning_upright_mirrors_nothing(up):
    turn = upright(up)
    axis = np.zeros(3)
    axis["xyz".index(up[-1])] = -1 if up.startswith("-") else 1
    np.testing.assert_array_equal(turn @ axis, [0, 1, 0])
    assert np.linalg.det(turn) == pytest.approx(1)
