"""Bones as joints, and positions as rotations: both must put the joints where they were."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mocapidx.errors import ParameterError
from mocapidx.formats.amc import read_amc
from mocapidx.formats.text import Limits
from mocapidx.formats.write_bvh import bvh_text
from mocapidx.model import Motion
from mocapidx.skeleton.angles import channel_angles
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.skeleton.kinematics import node_positions
from mocapidx.skeleton.rigs import as_joints
from mocapidx.skeleton.rotations import turned
from mocapidx.skeleton.solve import solved_rig
from mocapidx.tasks.read import read_take
from tests.small_files import AMC, ASF

ORDERS = ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))


def product(angles, order):
    matrices = np.repeat(np.eye(3)[:, :, None], angles.shape[1], axis=2)
    for axis, own in zip(order, angles, strict=True):
        matrices = turned(matrices, axis, np.cos(own), np.sin(own))
    return matrices


@pytest.mark.parametrize("order", ORDERS)
@settings(max_examples=30, deadline=None)
@given(arrays(np.float64, (3, 4), elements=st.floats(-7, 7)))
def test_angles_give_the_same_rotation_again(order, angles):
    expected = product(angles, order)
    np.testing.assert_allclose(product(channel_angles(expected, order), order), expected, atol=1e-8)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("middle", [np.pi / 2, -np.pi / 2])
def test_at_the_pole_one_angle_does_the_work_of_two(order, middle):
    expected = product(np.array([[0.3, 1.0], [middle] * 2, [0.4, -2.0]]), order)
    found = channel_angles(expected, order)
    assert not found[2].any()
    np.testing.assert_allclose(product(found, order), expected, atol=1e-12)


def test_angles_go_on_over_a_whole_turn():
    turning = np.linspace(0, 8, 50)
    found = channel_angles(
        product(np.stack((turning, 0 * turning, 0 * turning)), (2, 1, 0)), (2, 1, 0)
    )
    np.testing.assert_allclose(found[0], turning, atol=1e-12)


def small(tmp_path):
    (tmp_path / "small.asf").write_text(ASF)
    (tmp_path / "small.amc").write_text(AMC)
    return read_amc(tmp_path / "small.amc", None, Limits())


def test_joints_lie_where_bones_begin_and_end(tmp_path):
    bones = small(tmp_path)
    joints = as_joints(bones)
    assert joints.skeleton.names == ("root", "thigh", "shank", "foot", "foot/End")
    assert joints.skeleton.turned_by == "parent"
    found = node_positions(joints, range(5))
    expected = node_positions(bones, [0, 0, 1, 2, 3])
    np.testing.assert_allclose(found, expected, atol=1e-14)
    assert as_joints(joints) is joints


def test_what_has_no_frame_of_its_own_keeps_its_channels(tmp_path):
    bones = small(tmp_path)
    joints = as_joints(bones)
    kept = joints.channel_nodes < 2
    assert joints.channel_kinds[kept].tolist() == bones.channel_kinds[:9].tolist()
    np.testing.assert_array_equal(joints.values[:, kept], bones.values[:, :9])
    assert joints.channel_kinds[~kept].tolist() == [5, 4, 3]


def test_bones_that_change_their_length_are_refused(tmp_path):
    bones = small(tmp_path)
    with pytest.raises(ParameterError, match="length"):
        as_joints(replace(bones, channel_nodes=bones.channel_nodes + 1))


@pytest.fixture(scope="module")
def take(fixtures_dir):
    return next(iter(sorted((fixtures_dir / "takes").glob("*.amc"))))


def test_an_amc_written_as_bvh_is_read_as_the_same_motion(tmp_path, take):
    given = read_take(take)
    joints = as_joints(read_amc(take, None, Limits()))
    (tmp_path / "take.bvh").write_bytes(bvh_text(joints, given.motion.rate))
    found = read_take(tmp_path / "take.bvh")
    assert found.conventions.joint_map == "acclaim-joints"
    assert found.motion.rate == given.motion.rate
    np.testing.assert_allclose(found.motion.positions, given.motion.positions, atol=1e-12)


def distances(tmp_path, motion):
    """How far joints are from where they were, (T, 24) in metres, after BVH and back."""
    path = tmp_path / "solved.bvh"
    path.write_bytes(bvh_text(solved_rig(motion)))
    found = read_take(path)
    assert found.conventions.unit == 0.01
    assert found.conventions.up == "y"
    assert found.source_start == 0
    return np.linalg.norm(found.motion.positions - motion.positions, axis=2)


def test_solved_rotations_put_joints_back_within_centimetres(tmp_path, take):
    off = distances(tmp_path, read_take(take).motion)
    assert off.max() < 0.05
    assert off.mean() < 0.005


def test_a_public_reader_sees_the_joints_where_we_see_them(tmp_path, take):
    bvhio = pytest.importorskip("bvhio")
    motion = read_take(take).motion
    part = Motion(motion.joints, motion.positions[100:103], motion.rate)
    bones = read_amc(take, None, Limits())
    for rig in (solved_rig(part), as_joints(replace(bones, values=bones.values[100:103]))):
        path = tmp_path / "rig.bvh"
        path.write_bytes(bvh_text(rig, motion.rate))
        hierarchy = bvhio.readAsHierarchy(str(path))
        names = [name for name in rig.skeleton.names if not name.endswith("/End")]
        ours = node_positions(rig, [rig.skeleton.names.index(name) for name in names])
        for frame, points in enumerate(ours):
            hierarchy.loadPose(frame)
            theirs = {joint.Name: joint.PositionWorld for joint, _, _ in hierarchy.layout()}
            expected = [np.array(theirs[name]) for name in names]
            np.testing.assert_allclose(points, expected, atol=1e-3)


def test_a_rigid_body_is_solved_exactly(tmp_path, take):
    motion = read_take(take).motion
    pose = motion.positions[:1]
    angles = np.linspace(0, 4, 30)
    spin = product(np.stack((angles, 0 * angles, 0 * angles)), (1, 0, 2)).transpose(2, 0, 1)
    spun = Motion(motion.joints, np.einsum("tij,ukj->tki", spin, pose), 30.0)
    assert distances(tmp_path, spun).max() < 1e-7


@pytest.mark.parametrize("data", ["bandai/1", "bvh-reallusion", "bvh-cgspeed", "cmu/02"])
def test_real_motion_is_solved_within_centimetres(tmp_path, real_data, data):
    for path in sorted(p for p in (real_data / data).iterdir() if p.suffix != ".asf")[:2]:
        motion = read_take(path).motion
        off = distances(tmp_path, motion)
        assert np.nanmax(off) < 0.06
        assert np.nanmean(off) < 0.005


def test_gaps_are_bridged_and_missing_joints_left_out(take):
    motion = read_take(take).motion
    positions = motion.positions[:200].copy()
    positions[50:60, INDEX["lwrist"]] = np.nan
    for joint in ("lclavicle", "rtoes", "headtop", "belly"):
        positions[:, INDEX[joint]] = np.nan
    rig = solved_rig(Motion(CANONICAL_JOINTS, positions, 120.0))
    names = rig.skeleton.names
    assert np.isfinite(rig.values).all()
    assert names[rig.skeleton.parents[names.index("Spine1")]] == "Hips"
    assert "LeftShoulder" in names  # begins at the neck
    assert not {"RightToeBase", "Spine"} & {*names}
    assert {"RightFoot/End", "Head/End"} <= {*names}


def test_legs_alone_are_turned_by_the_line_of_the_hips(take):
    motion = read_take(take).motion
    legs = [INDEX[side + joint] for joint in ("hip", "knee", "ankle", "toes") for side in "lr"]
    positions = np.full_like(motion.positions[:300], np.nan)
    positions[:, [0, *legs]] = motion.positions[:300, [0, *legs]]
    rig = solved_rig(Motion(CANONICAL_JOINTS, positions, 120.0))
    nodes = [rig.skeleton.names.index(n) for n in ("LeftUpLeg", "RightUpLeg", "LeftFoot")]
    found = node_positions(rig, nodes) / 100
    wanted = positions[:, [INDEX["lhip"], INDEX["rhip"], INDEX["lankle"]]]
    assert np.linalg.norm(found - wanted, axis=2).max() < 0.05


def test_without_hips_there_is_no_rig():
    motion = Motion(("root", "head"), np.zeros((3, 2, 3)), 30.0)
    with pytest.raises(ParameterError, match="no joint lhip"):
        solved_rig(motion)


def test_opposite_and_empty_directions_still_give_rotations():
    positions = np.zeros((4, 24, 3))
    rng = np.random.default_rng(1)
    for i in range(24):
        positions[:, i] = rng.normal(size=3)
    positions[1:, INDEX["lelbow"]] = positions[1:, INDEX["lshoulder"]]
    positions[2, INDEX["lknee"]] = 2 * positions[2, INDEX["lhip"]] - positions[2, INDEX["lknee"]]
    rig = solved_rig(Motion(CANONICAL_JOINTS, positions, 30.0))
    assert np.isfinite(rig.values).all()
