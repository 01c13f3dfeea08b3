import os
from pathlib import Path

import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.skeleton.resample import resample_motion
from mocapidx.tasks.read import Limits, ReadOptions, read_motion, read_take
from mocapidx.tasks.skeleton_report import skeleton_report
from tests.small_files import PERSON, bvh_text, person_rows

ROOT = Path(__file__).parent.parent.parent
DATA = Path(os.environ.get("MOCAP_DATA", ROOT.parent / "shared" / "data"))
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="real motion capture data is not there")

BONES = (
    ("lhipjoint", "root", (0.6, -0.7, 0.2), 2.3, ""),
    ("lfemur", "lhipjoint", (0.34, -0.94, 0), 7.3, "rx ry rz"),
    ("ltibia", "lfemur", (0.34, -0.94, 0), 7, "rx"),
    ("lfoot", "ltibia", (0.1, -0.4, 0.9), 2.3, "rx rz"),
    ("ltoes", "lfoot", (0, 0, 1), 1.1, "rx"),
    ("lowerback", "root", (0, 1, 0), 2.2, "rx ry rz"),
    ("upperback", "lowerback", (0, 1, 0), 2.2, "rx ry rz"),
    ("thorax", "upperback", (0, 1, 0), 2.2, "rx ry rz"),
    ("lowerneck", "thorax", (0, 1, 0), 1.6, "rx ry rz"),
    ("upperneck", "lowerneck", (0, 1, 0), 1.6, "rx ry rz"),
    ("head", "upperneck", (0, 1, 0), 1.7, "rx ry rz"),
    ("lclavicle", "thorax", (0.9, 0.3, 0), 3.6, "ry rz"),
    ("lhumerus", "lclavicle", (1, 0, 0), 5, "rx ry rz"),
    ("lradius", "lhumerus", (1, 0, 0), 3, "rx"),
    ("lwrist", "lradius", (1, 0, 0), 1.5, "ry"),
    ("lhand", "lwrist", (1, 0, 0), 0.7, "rx rz"),
    ("lfingers", "lhand", (1, 0, 0), 0.6, "rx"),
)


def mirrored(bone):
    name, parent, (x, y, z), length, dof = bone
    other = [("r" + n[1:]) if n.startswith("l") and n not in CENTRE else n for n in (name, parent)]
    return (*other, (-x, y, z), length, dof)


CENTRE = {"lowerback", "lowerneck"}
ALL_BONES = BONES + tuple(mirrored(b) for b in BONES if mirrored(b)[0] != b[0])


def acclaim_pair(folder, name="take.amc", frames=3):
    asf = [":units", "length 0.45", "angle deg", ":root", "order TX TY TZ RX RY RZ", ":bonedata"]
    for bone, _, direction, length, dof in ALL_BONES:
        asf += ["begin", f"name {bone}", "direction {} {} {}".format(*direction)]
        asf += [f"length {length}", "axis 0 0 0 XYZ", *([f"dof {dof}"] if dof else []), "end"]
    asf += [":hierarchy", *(f"{parent} {bone}" for bone, parent, *_ in ALL_BONES)]
    (folder / "actor.asf").write_text("\n".join(asf))
    amc = [":FULLY-SPECIFIED", ":DEGREES"]
    for frame in range(1, frames + 1):
        amc += [str(frame), f"root 0 17 {frame} 0 0 0"]
        amc += [f"{b} " + " ".join("0" * len(dof.split())) for b, *_, dof in ALL_BONES if dof]
    (folder / name).write_text("\n".join(amc))
    return folder / name


def bvh_person(folder, rows=None, **text):
    path = folder / "take.bvh"
    down = person_rows(12, LeftArm=(-80, 0, 0), RightArm=(80, 0, 0))
    path.write_text(bvh_text(PERSON, rows or down, **text))
    return path


def test_an_acclaim_pair_becomes_joints_in_metres(tmp_path):
    path = acclaim_pair(tmp_path)
    reading = read_take(path)
    motion = reading.motion
    assert motion.joints == CANONICAL_JOINTS
    assert motion.positions.shape == (3, 24, 3)
    unit = 0.0254 / 0.45
    np.testing.assert_allclose(motion.positions[1, 0], [0, 17 * unit, 2 * unit])
    np.testing.assert_allclose(
        motion.positions[0, INDEX["neck"]], [0, (17 + 6.6) * unit, unit], atol=1e-12
    )
    np.testing.assert_allclose(motion.rest, motion.positions[0] - motion.positions[0, 0])
    assert motion.made == ()
    assert reading.conventions.joint_map == "acclaim"
    assert reading.sources == (path, tmp_path / "actor.asf")
    assert (reading.source_frames, reading.source_start) == (3, 0)
    assert ("neck", "lclavicle") in reading.conventions.coincident


@pytest.mark.parametrize(
    ("name", "options", "header", "rate", "origin"),
    [
        ("take.amc", {}, "", 120.0, "assumed"),
        ("13_29.amc", {}, "", 120.0, "assumed"),
        ("13_60.amc", {}, "", 120.0, "assumed"),
        ("HDM_bd_squat_001_120.amc", {}, "", 120.0, "name"),
        ("HDM_bd_squat_001_240.AMC", {}, "", 240.0, "name"),
        ("HDM_bd_squat_001_240.amc", {}, ":SAMPLES-PER-SECOND 60\n", 60.0, "file"),
        ("HDM_bd_squat_001_240.amc", {"source_rate": 50.0}, ":SAMPLES-PER-SECOND 60\n",
         50.0, "option"),
    ],
)  # fmt: skip
def test_the_rate_is_told_or_written_or_in_the_name_or_assumed(
    tmp_path, name, options, header, rate, origin
):
    path = acclaim_pair(tmp_path, name)
    path.write_text(header + path.read_text())
    reading = read_take(path, ReadOptions(**options))
    assert (reading.motion.rate, reading.rate_origin) == (rate, origin)


def test_a_bvh_becomes_joints_in_metres(tmp_path):
    reading = read_take(bvh_person(tmp_path))
    positions = reading.motion.positions
    np.testing.assert_allclose(positions[0, INDEX["lankle"]], [0.09, 0.10, 0], atol=1e-12)
    np.testing.assert_allclose(positions[5, INDEX["headtop"]], [0, 1.70, 0], atol=1e-12)
    assert reading.motion.rest is None
    assert reading.motion.made == ("lfingers", "rfingers")
    assert (reading.motion.rate, reading.rate_origin) == (30.0, "file")


def test_a_bvh_keeps_its_own_rate(tmp_path):
    reading = read_take(bvh_person(tmp_path), ReadOptions(source_rate=60.0))
    assert (reading.motion.rate, reading.rate_origin) == (30.0, "file")


def test_a_t_pose_is_dropped_and_counted(tmp_path):
    rows = person_rows(1) + person_rows(9, LeftArm=(-80, 0, 0))
    reading = read_take(bvh_person(tmp_path, rows))
    assert (reading.source_frames, reading.source_start) == (10, 1)
    assert len(reading.motion.positions) == 9
    kept = read_take(bvh_person(tmp_path, rows), ReadOptions(keep_first_frame=True))
    assert len(kept.motion.positions) == 10
    assert kept.source_start == 0


def test_a_file_that_lies_on_its_back_is_stood_up(tmp_path):
    motion = read_motion(bvh_person(tmp_path), up="z", unit=0.01, root_positions="replace")
    # z up becomes y, y becomes -z
    np.testing.assert_allclose(motion.positions[0, INDEX["root"]], [0, 0, -0.95], atol=1e-12)
    np.testing.assert_allclose(motion.positions[0, INDEX["ltoes"]], [0.09, 0.14, -0.02], atol=1e-12)


def test_a_joint_map_of_ones_own_is_used(tmp_path):
    joints = "\n".join(
        f'{side[0].lower()}{joint} = "{side}{node}"'
        for side in ("Left", "Right")
        for joint, node in (("hip", "UpLeg"), ("knee", "Leg"), ("ankle", "Foot"))
    )
    (tmp_path / "own.toml").write_text(
        f'name = "own"\n[joints]\nroot = "Hips"\nhead = "Neck"\n{joints}\n'
    )
    reading = read_take(bvh_person(tmp_path), ReadOptions(joint_map=tmp_path / "own.toml"))
    assert reading.conventions.joint_map == "own"
    assert "lwrist" in reading.conventions.missing
    assert np.isnan(reading.motion.positions[:, INDEX["lwrist"]]).all()
    np.testing.assert_allclose(reading.motion.positions[0, INDEX["head"]], [0, 1.45, 0])


def test_a_rig_without_a_map_names_its_file(tmp_path):
    nodes = [(n.replace("Arm", "Limb"), p.replace("Arm", "Limb"), o) for n, p, o in PERSON]
    path = tmp_path / "take.bvh"
    path.write_text(bvh_text(nodes, person_rows(2)))
    with pytest.raises(FormatError) as caught:
        read_take(path)
    assert str(caught.value).startswith(f"{path}: no joint map fits its names; the nearest")


def test_limits_are_passed_on(tmp_path):
    with pytest.raises(FormatError, match="--max-frames"):
        read_take(bvh_person(tmp_path), ReadOptions(limits=Limits(max_frames=3)))


@pytest.mark.parametrize(
    "wrong", [{"source_rate": 0}, {"source_rate": np.nan}, {"unit": 0}, {"up": "up"}]
)
def test_options_are_checked_before_any_file_is_read(wrong):
    with pytest.raises(ParameterError):
        ReadOptions(**wrong)


def test_a_report_tells_how_a_skeleton_is_understood(tmp_path):
    report = skeleton_report(bvh_person(tmp_path))
    assert [row.joint for row in report.segments] == list(CANONICAL_JOINTS)
    rows = {row.joint: row for row in report.segments}
    assert rows["lknee"].node == "LeftLeg"
    assert rows["lknee"].parent == "lhip"
    assert rows["lknee"].length == pytest.approx(0.43)
    assert rows["lfingers"].state == "made"
    assert np.isnan(rows["root"].length)
    nodes = {row.name: row for row in report.nodes}
    assert nodes["Hips"].channels[:4] == ("Xposition", "Yposition", "Zposition", "Zrotation")
    assert nodes["LeftShoulder"].joints == ("lclavicle",)
    assert nodes["LeftLeg"].offset == (0, -43, 0)
    assert len(report.reading.conventions.evidence) == 5


@needs_data
def test_positions_are_those_of_the_database_authors_parser():
    truths = sorted((DATA / "hdm05-positions").glob("*.npz"))[::3]
    assert truths
    for truth in truths:
        with np.load(truth, allow_pickle=False) as expected:
            motion = read_motion(next((DATA / "hdm05").glob(f"*/{truth.stem}.amc")))
            order = [INDEX[j] for j in expected["joints"].tolist()]
            error = np.abs(motion.positions[:, order] - expected["positions"]).max()
        assert error < 2e-5


CONVENTIONS = {
    "cmu/02/02_01.amc": ("acclaim", 0.056444, "add", 120.0),
    "bvh-cgspeed/neutral_16_000.bvh": ("cmu-bvh", 0.056444, "add", 120.0),
    "bandai/1/dataset-1_walk_normal_001.bvh": ("bandai", 0.01, "replace", 30.0),
    "bvh-reallusion/005_03.bvh": ("reallusion", 0.01, "add", 60.0),
    "bvh-reallusion/002_01.bvh": ("reallusion", 0.01, "add", 60.0),
    "bvh-motionbuilder/AV_8Walk_Meredith_HVHA_Rep1.bvh":
        ("humanik-minimal", 0.0254, "replace", 120.0),
}  # fmt: skip


@needs_data
@pytest.mark.parametrize("name", CONVENTIONS)
def test_a_person_stands_on_the_floor_and_walks_where_he_faces(name):
    reading = read_take(DATA / name)
    conventions = reading.conventions
    joint_map, unit, positions, rate = CONVENTIONS[name]
    assert conventions.joint_map == joint_map
    assert conventions.unit == pytest.approx(unit, rel=1e-4)
    assert (conventions.root_positions, conventions.up) == (positions, "y")
    assert (conventions.first_frame, conventions.warnings) == ("motion", ())
    assert reading.motion.rate == rate
    joints = {j: reading.motion.positions[:, i] for j, i in INDEX.items()}
    feet = np.min([joints[j][:, 1] for j in ("lankle", "rankle", "ltoes", "rtoes")], axis=0)
    assert abs(np.percentile(feet, 5)) < 0.1
    assert 1.35 < np.percentile(joints["headtop"][:, 1] - feet, 95) < 2.0
    if "005_03" in name:
        return  # a dance
    front = np.cross(joints["lhip"] - joints["rhip"], [0, 1, 0])
    front /= np.linalg.norm(front, axis=1, keepdims=True)
    speed = np.diff(joints["root"], axis=0) * reading.motion.rate
    forwards = np.sum(speed * front[1:], axis=1).mean()
    assert forwards > 0.6 * np.linalg.norm(speed[:, [0, 2]], axis=1).mean()


def test_hours_of_hardly_any_frames_are_refused(tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text(bvh_text(PERSON, person_rows(181), frame_time="10"))
    with pytest.raises(FormatError, match=r"a\.bvh: 0\.5 hours of 0\.1 frames a second"):
        read_take(path)
    path.write_text(bvh_text(PERSON, person_rows(180), frame_time="10"))
    assert read_take(path).motion.rate == 0.1


@pytest.mark.parametrize("rate", [30.0, 15.0, 10.0, 12.0, 60.0])
def test_the_frames_of_a_lower_rate_are_those_of_the_whole_take(tmp_path, rate):
    path = tmp_path / "person.bvh"
    path.write_text(bvh_text(PERSON, person_rows(20, LeftArm=(1, 20, 0))))
    whole, part = read_take(path), read_take(path, rate=rate)
    expected = resample_motion(whole.motion, rate)
    found = resample_motion(part.motion, rate)
    np.testing.assert_array_equal(found.positions, expected.positions)
    assert part.source_rate == whole.source_rate == whole.motion.rate
    assert part.source_frames == whole.source_frames


@needs_data
def test_a_lower_rate_computes_only_its_frames():
    path = sorted((DATA / "hdm05").rglob("*.amc"))[0]
    whole, part = read_take(path), read_take(path, rate=30.0)
    assert part.motion.rate == 30.0
    np.testing.assert_array_equal(part.motion.positions, whole.motion.positions[::4])
