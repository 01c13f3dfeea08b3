"""Marker maps: what joints formulas give, partial sets, several people, maps of one's own."""

import numpy as np
import pytest

from mocapidx.errors import FeatureSetError, FormatError
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.skeleton.markermap import parse_marker_map, shipped_marker_maps
from mocapidx.skeleton.markers import choose_marker_map, marker_joints, subjects_of
from tests.made_points import markers_of

SIDED = ["FWT", "BWT", "KNE", "ANK", "TOE", "MT5", "FHD", "BHD", "SHO", "ELB", "WRA", "WRB", "FIN"]
HDM05 = ["C7", "STRN", "T10", *(side + name for side in "LR" for name in SIDED)]
NEWER = {"LFWT": "LASI", "RFWT": "RASI", "LBWT": "LPSI", "RBWT": "RPSI"}
PLUG_IN = [NEWER.get(name, name) for name in HDM05 if not name.endswith("MT5")]


def some_points(names, seed=7):
    return np.random.default_rng(seed).normal(0, 1, (4, len(names), 3))


def test_the_formulas_of_the_hdm05_authors():
    points = some_points(HDM05)
    p = {name: points[:, i] for i, name in enumerate(HDM05)}
    found = marker_joints(choose_marker_map(HDM05), points, 1.0)
    ring = (p["LFHD"] + p["RFHD"] + p["LBHD"] + p["RBHD"]) / 4
    waist = p["LFWT"] + p["RFWT"] + p["LBWT"] + p["RBWT"]
    expected = {
        "root": (p["STRN"] + waist) / 5,
        "lhip": (p["LFWT"] + p["LBWT"]) / 2,
        "rknee": p["RKNE"] + 0.4 * (p["RTOE"] - p["RMT5"]),
        "lankle": p["LANK"] + 0.3 * (p["LTOE"] - p["LMT5"]),
        "rtoes": (p["RTOE"] + p["RMT5"]) / 2,
        "belly": 0.4 * p["STRN"] + 0.4 * p["T10"] + 0.05 * waist,
        "chest": (p["C7"] + p["STRN"] + p["T10"]) / 3,
        "neck": p["C7"],
        "rclavicle": p["C7"],
        "head": 0.5 * ring + 0.5 * p["C7"],
        "headtop": ring + 0.3 * (ring - p["C7"]),
        "lshoulder": p["LSHO"],
        "relbow": p["RELB"],
        "lwrist": (p["LWRA"] + p["LWRB"]) / 2,
        "rfingers": p["RFIN"],
    }
    for joint, point in expected.items():
        np.testing.assert_allclose(found[:, INDEX[joint]], point, atol=1e-12, err_msg=joint)


def test_plug_in_gait_turns_inwards_by_the_pelvis():
    points = some_points(PLUG_IN)
    p = {name: points[:, i] for i, name in enumerate(PLUG_IN)}
    found = marker_joints(choose_marker_map(PLUG_IN), points, 0.001)
    way = (p["RASI"] + p["RPSI"]) / 2 - (p["LASI"] + p["LPSI"]) / 2
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    np.testing.assert_allclose(found[:, INDEX["lknee"]], p["LKNE"] + 28 * way)
    np.testing.assert_allclose(found[:, INDEX["rknee"]], p["RKNE"] - 28 * way)


def test_markers_made_of_joints_give_them_back():
    rng = np.random.default_rng(8)
    joints = rng.normal(0, 1, (5, 24, 3))
    joints[:, INDEX["lclavicle"]] = joints[:, INDEX["rclavicle"]] = joints[:, INDEX["neck"]]
    names, points = markers_of(CANONICAL_JOINTS, joints)
    found = marker_joints(choose_marker_map(names), points, 1.0)
    same = [i for i, j in enumerate(CANONICAL_JOINTS) if j not in ("root", "belly", "headtop")]
    np.testing.assert_allclose(found[:, same], joints[:, same], atol=1e-9)


def test_a_partial_set_gives_the_joints_that_it_can():
    lower = ["lasi", "RASI", "SACR", "LKNE", "RKNE", "LANK", "RANK", "LTOE", "RTOE"]
    mapping = choose_marker_map(lower)
    assert mapping.marker_map.name == "plug-in-gait"
    assert len(mapping.real) == 9
    assert {"head", "lelbow", "neck"} <= set(mapping.missing)
    assert mapping.made == ()


def test_video_key_points_make_root_and_neck():
    names = [f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle", "shoulder")]
    names += [f"{s}_{j}" for s in ("left", "right") for j in ("elbow", "wrist", "ear")]
    mapping = choose_marker_map(names)
    assert mapping.marker_map.name == "coco-17"
    assert {"root", "neck", "belly", "chest"} <= set(mapping.made)
    assert {"ltoes", "rtoes"} <= set(mapping.missing)
    found = marker_joints(mapping, some_points(names), 1.0)
    assert np.isnan(found[:, INDEX["ltoes"]]).all()
    hips = found[:, [INDEX["lhip"], INDEX["rhip"]]].mean(axis=1)
    np.testing.assert_allclose(found[:, INDEX["root"]], hips)


def test_one_of_several_subjects_is_chosen_or_named():
    box = ["box:a", "box:b"]
    ann = [f"Ann:{name}" for name in PLUG_IN]
    bob = [f"Bob:{name}" for name in PLUG_IN]
    assert choose_marker_map([*box, *ann]).subject == "Ann"
    with pytest.raises(FormatError, match="has the subjects 'Ann', 'Bob'; name one with --subject"):
        choose_marker_map([*ann, *bob])
    mapping = choose_marker_map([*ann, *bob], subject="Bob")
    assert min(mapping.used) >= len(ann)
    with pytest.raises(FormatError, match="no subject 'Eve', it has the subjects 'Ann', 'Bob'"):
        choose_marker_map([*ann, *bob], subject="Eve")
    assert subjects_of([*box, *ann, "x"]) == ("box", "Ann", "")


def test_what_fits_no_map_is_told_with_the_nearest():
    with pytest.raises(FormatError, match=r"\(a, b\); write a map of your own"):
        choose_marker_map(["a", "b"])
    with pytest.raises(FormatError, match="nearest, 'plug-in-gait', needs 'LBWT'"):
        choose_marker_map(["LASI", "RASI", "LKNE"])


def test_maps_of_ones_own_take_joint_maps_too():
    text = """
name = "mine"
[joints]
lhip = "A"
rhip = "B"
lknee = ["nowhere", "C"]
rknee = { between = ["lhip", "C"], at = 2 }
lankle = { mean = ["A", "B"], made = true }
rankle = { sum = { A = 2, B = -1 } }
head = { sum = { A = 1 }, along = ["A", "B"], metres = 0.5 }
neck = "A"
lshoulder = "B"
"""
    mapping = choose_marker_map(["A", "B", "C"], parse_marker_map(text, "x.toml"))
    points = some_points("ABC")
    found = marker_joints(mapping, points, 1.0)
    a, b, c = points.transpose(1, 0, 2)
    np.testing.assert_allclose(found[:, INDEX["rknee"]], a + 2 * (c - a))
    np.testing.assert_allclose(found[:, INDEX["rankle"]], 2 * a - b)
    assert {"rknee", "lankle"} <= set(mapping.made)
    assert mapping.real == ["lhip", "lknee", "rhip", "rankle", "neck", "head", "lshoulder"]
    assert mapping.users()[2] == ("lknee", "rknee")


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("lhip = 3", "expected a name"),
        ("lhip = []", "expected a name or a formula"),
        ("lhip = { mean = [] }", "expected points"),
        ("lhip = { sum = { A = 0.5 } }", "make 0.5, expected 1"),
        ("lhip = { sum = { A = 11, B = -10 } }", "from -10 to 10"),
        ("lhip = { sum = { A = true } }", "expected a number"),
        ("lhip = { sum = { A = 1 }, along = ['A', 'B'] }", "go together"),
        ("lhip = { sum = { A = 1 }, along = ['A'], metres = 1 }", "two names"),
        ("lhip = { mean = ['A'], eval = 'x' }", "unknown key 'eval'"),
        ("tail = 'A'", "'tail'"),
        ("", "missing or empty"),
    ],
)
def test_maps_that_are_wrong_are_told_by_their_entry(entry, message):
    with pytest.raises(FeatureSetError, match=message):
        parse_marker_map(f"name = 'x'\n[joints]\n{entry}\n", "x.toml")


def test_shipped_maps_mirror_and_are_documented(pytestconfig):
    page = (pytestconfig.rootpath / "docs" / "formats.md").read_text()
    for marker_map in shipped_marker_maps():
        assert f"`{marker_map.name}`" in page
        if marker_map.name != "irsst-upper-body":
            sided = {j for j in marker_map.joints if j[0] == "l"}
            assert {"r" + joint[1:] for joint in sided} <= set(marker_map.joints)
