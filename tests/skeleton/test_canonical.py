import numpy as np
import pytest

from mocapidx.formats.registry import read_recording
from mocapidx.skeleton.canonical import canonical_positions, canonical_rest, made_joints
from mocapidx.skeleton.jointmap import choose_map
from mocapidx.skeleton.joints import INDEX
from tests.small_files import PERSON, bvh_text, person_rows


def poses(tmp_path, drop=(), rename=()):
    nodes = [(dict(rename).get(n, n), dict(rename).get(p, p), o) for n, p, o in PERSON]
    parent = {n: p for n, p, _ in nodes}
    point = {"": np.zeros(3)}
    for name, over, offset in nodes:
        point[name] = point[over] + offset
    kept = []
    for name, over, _ in nodes:
        if name in drop:
            continue
        while over in drop:
            over = parent[over]
        kept.append((name, over, tuple(point[name] - point[over])))
    width = 3 + 3 * sum(not n.endswith("/End") for n, _, _ in kept)
    path = tmp_path / "take.bvh"
    path.write_text(bvh_text(kept, [row[:width] for row in person_rows(2)]))
    recording = read_recording(path)
    mapping = choose_map(recording.skeleton)
    found = canonical_positions(recording, mapping, "replace")[0]
    return {joint: found[i] for joint, i in INDEX.items()}, made_joints(mapping), recording


def test_joints_are_where_their_nodes_are(tmp_path):
    pose, made, _ = poses(tmp_path)
    np.testing.assert_allclose(pose["root"], [0, 95, 0])
    np.testing.assert_allclose(pose["lankle"], [9, 10, 0], atol=1e-12)
    np.testing.assert_allclose(pose["rtoes"], [-9, 2, 14], atol=1e-12)
    np.testing.assert_allclose(pose["headtop"], [0, 170, 0])
    assert set(made) == {"lfingers", "rfingers"}


def test_fingers_lie_a_third_of_the_forearm_beyond_the_wrist(tmp_path):
    pose, _, _ = poses(tmp_path)
    # the forearm of 25 cm ends at x = 4 + 13 + 28 + 25 = 70 cm
    np.testing.assert_allclose(pose["lfingers"], [70 + 0.35 * 25, 141, 0])
    np.testing.assert_allclose(pose["rfingers"], [-70 - 0.35 * 25, 141, 0])


def test_the_top_of_the_head_lies_six_hundredths_of_the_height_above_it(tmp_path):
    pose, made, _ = poses(tmp_path, drop=["Head/End"])
    # legs of 85 cm are 0.491 of the height
    np.testing.assert_allclose(pose["headtop"], [0, 155 + 0.06 * 85 / 0.491, 0])
    assert "headtop" in made


def test_a_single_spine_joint_gives_belly_and_chest_by_thirds(tmp_path):
    pose, made, _ = poses(tmp_path, drop=["Spine1"])
    np.testing.assert_allclose(pose["belly"], [0, 95 + 50 / 3, 0])
    np.testing.assert_allclose(pose["chest"], [0, 95 + 2 * 50 / 3, 0])
    assert {"belly", "chest"} <= made.keys()


def test_a_map_may_make_a_joint_its_own_way(tmp_path):
    pose, made, _ = poses(tmp_path, drop=["Spine1", "Neck"])
    np.testing.assert_allclose(pose["belly"], [0, 95 + 7.5, 0])  # half way to the only spine joint
    np.testing.assert_allclose(pose["chest"], [0, 110, 0])
    assert "chest" not in made


def test_toes_are_never_made(tmp_path):
    pose, made, _ = poses(tmp_path, drop=["LeftToeBase", "RightToeBase"])
    assert np.isnan(pose["ltoes"]).all()
    assert "ltoes" not in made


def test_the_zero_pose_has_its_root_at_the_origin(tmp_path):
    pose, _, recording = poses(tmp_path)
    rest = canonical_rest(recording, choose_map(recording.skeleton))
    np.testing.assert_allclose(rest[INDEX["lankle"]], pose["lankle"] - pose["root"], atol=1e-12)
    assert rest[INDEX["lfingers"]][0] == pytest.approx(70 + 0.35 * 25)
