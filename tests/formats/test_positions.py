"""Positions of joints in npz, npy and CSV, key points in JSON, and angles of AMASS."""

import json

import numpy as np
import pytest

from mocapidx.errors import FormatError
from mocapidx.formats.registry import holds_motion, read_recording, sources_of
from mocapidx.skeleton.kinematics import node_positions

NAMES = ("lhip", "rhip", "lknee")


def some_points(frames=6):
    points = np.random.default_rng(3).normal(0, 1, (frames, 3, 3)).round(4)
    points[2, 1] = np.nan
    return points


def long_table(points):
    rows = ["frame,joint,x,y,z"]
    for frame, pose in enumerate(points):
        for name, point in zip(NAMES, pose, strict=True):
            if np.isfinite(point).all():
                rows.append(f"{frame},{name},{','.join(map(str, point))}")
    return "\n".join(rows) + "\n"


def wide_table(points, mark="."):
    rows = [",".join(["time", *(f"{n}{mark}{a}" for n in NAMES for a in "xyz")])]
    for frame, pose in enumerate(points):
        cells = ["" if np.isnan(v) else repr(float(v)) for v in pose.ravel()]
        rows.append(",".join([f"{frame / 120:.6f}", *cells]))
    return "\n".join(rows) + "\n"


def test_npz_with_any_key_for_the_rate(tmp_path):
    path = tmp_path / "x.npz"
    for key in ("rate", "sampling_rate", "fps"):
        np.savez(path, positions=some_points(), joints=np.array(NAMES), **{key: 120})
        found = read_recording(path)
        np.testing.assert_array_equal(found.positions, some_points())
        assert (found.names, found.rate) == (NAMES, 120.0)


@pytest.mark.parametrize(("unit", "up"), [(0.01, "z"), (1, "-y"), (None, None)])
def test_npz_may_say_its_unit_and_what_is_up(tmp_path, unit, up):
    said = {"unit": unit, "up": up}
    arrays = {"positions": np.zeros((3, 2, 3)), "joints": np.array(["a", "b"]), "rate": 30.0}
    arrays |= {key: np.array(value) for key, value in said.items() if value is not None}
    np.savez(tmp_path / "x.npz", **arrays)
    found = read_recording(tmp_path / "x.npz")
    assert (found.unit, found.up) == (unit, up)


@pytest.mark.parametrize(
    "said", [{"unit": 0.0}, {"unit": "m"}, {"up": "w"}, {"up": 1}, {"unit": [1.0, 2.0]}]
)
def test_an_odd_unit_or_axis_is_told(tmp_path, said):
    arrays = {"positions": np.zeros((3, 1, 3)), "joints": np.array(["a"]), "rate": 30.0}
    np.savez(tmp_path / "x.npz", **arrays, **said)
    with pytest.raises(FormatError, match="expected"):
        read_recording(tmp_path / "x.npz")


def test_joints_that_were_made_up_are_left_out(tmp_path):
    np.savez(tmp_path / "x.npz", positions=some_points(), joints=NAMES, rate=30, made=["lknee"])
    assert read_recording(tmp_path / "x.npz").names == ("lhip", "rhip")


def test_npy_takes_its_names_from_a_list_beside_it(tmp_path):
    path = tmp_path / "x.npy"
    np.save(path, some_points().astype("f4"))
    assert not holds_motion(path)
    with pytest.raises(FormatError, match=r"'x\.joints\.txt' or 'joints\.txt' beside it"):
        read_recording(path)
    (tmp_path / "joints.txt").write_text("lhip\nrhip\nlknee\n")
    assert holds_motion(path)
    assert sources_of(path) == (path, tmp_path / "joints.txt")
    found = read_recording(path, skeleton_path=sources_of(path)[1])
    np.testing.assert_allclose(found.positions, some_points(), rtol=1e-6)
    assert found.rate is None


@pytest.mark.parametrize("mark", [".", "_", " ", ":"])
def test_csv_with_one_row_a_frame(tmp_path, mark):
    path = tmp_path / "x.csv"
    path.write_text(wide_table(some_points(), mark))
    assert holds_motion(path)
    found = read_recording(path)
    np.testing.assert_array_equal(found.positions, some_points())
    assert (found.names, found.rate) == (NAMES, 120.0)


def test_csv_with_one_row_a_joint_and_frame(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(long_table(some_points()))
    assert holds_motion(path)
    found = read_recording(path)
    np.testing.assert_array_equal(found.positions, some_points())
    assert found.rate is None


def test_only_ends_of_lines_end_a_row(tmp_path):
    path = tmp_path / "x.csv"
    table = long_table(some_points()).replace(NAMES[0], f"a\u2028b\x0b{NAMES[0]}")
    path.write_bytes(table.replace("\n", "\r\n").encode())
    assert read_recording(path).names == (f"a\u2028b\x0b{NAMES[0]}", *NAMES[1:])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("document,label\na.amc,walk\n", r":1: no table of positions"),
        ("lhip.x,lhip.y\n1,2\n", r":1: no table of positions"),
        ("lhip.x,lhip.y,lhip.z,rhip.x\n1,2,3,4\n", r":1: 'rhip' has no column for y"),
        ("lhip.x,lhip.y,lhip.z,lhip_x\n1,2,3,4\n", r"column 'lhip_x' stands twice"),
        ("lhip.x,lhip.y,lhip.z\n1,2,x\n", r":2: column 3 is 'x'"),
        ("lhip.x,lhip.y,lhip.z\n1,2,1_0\n", r":2: column 3 is '1_0'"),
        ("lhip.x,lhip.y,lhip.z\n", "has no positions"),
        ("time,lhip.x,lhip.y,lhip.z\n0,1,2,3\n1,1,2,3\n5,1,2,3\n", "times are not even"),
        ("frame,joint,x,y,z\n0,lhip,1,2,3\n0,lhip,1,2,3\n", "stands twice in a frame"),
        ("frame,joint,x,y,z\n0,lhip,1,2,3\n999999999,lhip,1,2,3\n", "most joints are missing"),
        ("frame,joint,x,y,z\n-1,lhip,1,2,3\n", r":2: frame '-1'"),
        ("frame,joint,x,y,z\n0,lhip,1\n", r":2: has fewer cells"),
        ("frame,joint,x,y,z\n0,lhip,1,2,inf\n", r":2: 'inf', expected a number"),
    ],
)
def test_tables_that_are_wrong_are_told_with_their_line(tmp_path, text, message):
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match=message) as caught:
        read_recording(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"betas": np.zeros(16)}, "no 'poses' and no 'positions'"),
        ({"positions": np.zeros((3, 3, 3))}, "no 'joints'"),
        (
            {"positions": np.zeros((3, 2, 3)), "joints": NAMES},
            r"expected numbers of shape \(any, 3",
        ),
        ({"positions": np.zeros((3, 3, 3)), "joints": NAMES, "rate": 0}, "'rate' is 0"),
        ({"positions": np.zeros((3, 3, 3)), "joints": NAMES, "rate": "fast"}, "'rate' is fast"),
        ({"positions": np.full((3, 3, 3), np.nan), "joints": NAMES}, "no point of it is ever seen"),
        ({"positions": np.full((3, 3, 3), 1e30), "joints": NAMES}, "1e9 units away"),
        ({"poses": np.zeros((3, 156))}, "has no 'trans'"),
        ({"poses": np.zeros((3, 100)), "trans": np.zeros((3, 3))}, "has 100 numbers a frame"),
        ({"poses": np.zeros((3, 156)), "trans": np.zeros((2, 3))}, r"'trans': is float64 of shape"),
        ({"poses": np.full((3, 156), np.inf), "trans": np.zeros((3, 3))}, "not finite"),
        (
            {"poses": np.zeros((3, 156)), "trans": np.zeros((3, 3)), "mocap_framerate": 0.0},
            "'mocap_framerate' is 0.0",
        ),
    ],
)
def test_arrays_that_are_wrong_are_told_by_their_key(tmp_path, arrays, message):
    np.savez(tmp_path / "x.npz", **arrays)
    with pytest.raises(FormatError, match=message) as caught:
        read_recording(tmp_path / "x.npz")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("width", [156, 165])
@pytest.mark.parametrize("key", ["mocap_framerate", "mocap_frame_rate"])
def test_amass_moves_a_template_body(tmp_path, width, key):
    poses = np.random.default_rng(4).normal(0, 0.7, (5, width))
    trans = np.random.default_rng(5).normal(0, 1, (5, 3))
    arrays = {"poses": poses, "trans": trans, key: 59.94, "gender": np.array("neutral")}
    np.savez(tmp_path / "x.npz", **arrays)
    found = read_recording(tmp_path / "x.npz")
    assert (found.rate, found.unit, found.up) == (59.94, 1.0, "z")
    assert "template" in found.notes[0]
    names = list(found.skeleton.names)
    points = node_positions(found, range(len(names)))
    for frame in range(5):
        turns = [rotation(v) for v in poses[frame, :66].reshape(22, 3)]
        world, expected = {}, {}
        for i, parent in enumerate(found.skeleton.parents.tolist()):
            offset = found.skeleton.offsets[i]
            base = np.eye(3) if parent < 0 else world[parent]
            start = trans[frame] if parent < 0 else expected[parent]
            expected[i] = start + base @ offset
            world[i] = base @ turns[i] if i < 22 else base
        np.testing.assert_allclose(points[frame], list(expected.values()), atol=1e-9)


def small_model(path, joints=52):
    rng = np.random.default_rng(10)
    weights = rng.random((joints, 80))
    arrays = {
        "J_regressor": weights / weights.sum(axis=1, keepdims=True),
        "v_template": rng.normal(0, 1, (80, 3)),
        "shapedirs": rng.normal(0, 0.1, (80, 3, 10)),
    }
    np.savez(path, **arrays)
    return arrays


@pytest.mark.parametrize(("joints", "fingers"), [(24, (22, 23)), (52, (25, 40)), (55, (28, 43))])
def test_a_body_model_gives_the_joints_of_the_shape(tmp_path, joints, fingers):
    model = small_model(tmp_path / "model.npz", joints)
    betas = np.random.default_rng(11).normal(0, 1, 16)
    trans = np.array([[1.0, 2.0, 3.0]])
    path = tmp_path / "x.npz"
    np.savez(path, poses=np.zeros((1, 156)), trans=trans, betas=betas, mocap_framerate=60)
    assert sources_of(path, tmp_path / "model.npz") == (path, tmp_path / "model.npz")
    assert sources_of(path, tmp_path / "x.asf") == (path,)
    found = read_recording(path, skeleton_path=tmp_path / "model.npz")
    points = node_positions(found, range(24))[0]
    shaped = model["v_template"] + model["shapedirs"] @ betas[:10]
    expected = (model["J_regressor"] @ shaped)[[*range(22), *fingers]] + trans
    np.testing.assert_allclose(points, expected, atol=1e-12)
    assert "model.npz" in found.notes[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"v_template": None}, "no body model: it has no 'v_template'"),
        ({"v_template": np.zeros((7, 3))}, r"'v_template': is float64 of shape \(7, 3\)"),
        ({"shapedirs": np.full((80, 3, 10), np.nan)}, "not finite"),
        ({"J_regressor": np.zeros((9, 80))}, "has 9 joints"),
    ],
)
def test_what_is_no_body_model_is_told(tmp_path, change, message):
    arrays = {**small_model(tmp_path / "model.npz"), **change}
    kept = {key: value for key, value in arrays.items() if value is not None}
    np.savez(tmp_path / "model.npz", **kept)
    np.savez(tmp_path / "x.npz", poses=np.zeros((1, 156)), trans=np.zeros((1, 3)))
    with pytest.raises(FormatError, match=message):
        read_recording(tmp_path / "x.npz", skeleton_path=tmp_path / "model.npz")
    with pytest.raises(FormatError, match=r"none\.npz: can't be read"):
        read_recording(tmp_path / "x.npz", skeleton_path=tmp_path / "none.npz")


def rotation(vector):
    """The formula of Rodrigues."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def key_points(count, frames=4):
    return np.random.default_rng(6).normal(0, 1, (frames, count, 3)).round(3)


@pytest.mark.parametrize("count", [17, 25])
def test_key_points_in_each_layout(tmp_path, count):
    points = key_points(count).tolist()
    sure = [[[*point, 0.9] for point in pose] for pose in points]
    flat = [[v for point in pose for v in point] for pose in sure]
    layouts = [
        points,
        {"rate": 30, "frames": points},
        {"fps": 30, "frames": sure},
        {"frames": flat},
        [{"keypoints": pose} for pose in points],
        [{"people": [{"pose_keypoints_3d": pose}]} for pose in flat],
    ]
    path = tmp_path / "x.json"
    for layout in layouts:
        path.write_text(json.dumps(layout))
        assert holds_motion(path) or layout == {"frames": flat}
        np.testing.assert_array_equal(read_recording(path).positions, key_points(count))
    assert len(read_recording(path).names) == count


def test_key_points_that_were_not_seen(tmp_path):
    points = [[[*point, 1.0] for point in pose] for pose in key_points(17).tolist()]
    points[1][4] = None
    points[2][5][3] = 0
    points[3] = None
    (tmp_path / "x.json").write_text(json.dumps({"frames": points}))
    found = np.isnan(read_recording(tmp_path / "x.json").positions[:, :, 0])
    assert found[1, 4]
    assert found[2, 5]
    assert found[3].all()
    assert found.sum() == 2 + 17


def test_named_key_points(tmp_path):
    table = {"joints": ["a", "b"], "frames": key_points(2).tolist()}
    (tmp_path / "x.json").write_text(json.dumps(table))
    assert read_recording(tmp_path / "x.json").names == ("a", "b")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not JSON"),
        ("{", "not JSON"),
        ("[" * 100_000, "nested too deeply"),
        ("[]", "no list of frames"),
        ('{"content": 6}', "no list of frames"),
        ('{"people": [{"pose_keypoints_3d": [1]}]}', "a file for each frame"),
        ("[[[1, 2, 3]]]", "expected 3 or 4 for each of 17"),
        ("[[[1, 2], [1, 2, 3]]]", "points of different numbers"),
        (json.dumps([[["x", 2, 3]] * 17]), "frame 0: x, expected a number"),
        (json.dumps([[[1, 2]] * 17]), "two-dimensional key points are not read"),
        (json.dumps({"rate": "30", "frames": [[[1, 2, 3]] * 17]}), "'rate' is 30"),
        (json.dumps([None]), "nobody is in any frame"),
        (json.dumps([[[10**400, 2, 3]] * 17]), "expected a number|not JSON"),
    ],
)
def test_key_points_that_are_wrong(tmp_path, text, message):
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(FormatError, match=message) as caught:
        read_recording(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("labels.csv", b"document,label\n"),
        ("label.json", b'{"content": 6, "style": 11}'),
        ("frame_000.json", b'{"version": 1.3, "people": [{"pose_keypoints_3d": []}]}'),
        ("clip.json", b'{"frames": [3, 40], "positions": "metres"}'),
        ("broken.npz", b"PK"),
        ("hits.csv", b"rank,document,start_frame\n"),
    ],
)
def test_files_of_other_kinds_in_a_folder_are_passed_over(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    assert not holds_motion(tmp_path / name)
