from pathlib import Path

import numpy as np
import pytest

from mocapidx.errors import FeatureSetError, FormatError
from mocapidx.model import Skeleton
from mocapidx.skeleton.jointmap import choose_map, load_joint_map, parse_joint_map, shipped_maps
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX, MIRROR, PARENTS
from tests.small_files import PERSON


def skeleton(names, zero_ends=()):
    offsets = np.ones((len(names), 3))
    for name in zero_ends:
        offsets[names.index(name)] = 0
    return Skeleton(tuple(names), np.arange(-1, len(names) - 1), offsets, "parent")


def sides(*names):
    return [name.replace("#", side) for name in names for side in ("Left", "Right")]


HUMANIK = [
    *("Hips", "Spine", "Neck", "Head"),
    *sides("#UpLeg", "#Leg", "#Foot", "#Shoulder", "#Arm", "#ForeArm", "#Hand"),
]
XSENS = [
    *("Hips", "Chest", "Chest2", "Chest3", "Chest4", "Neck", "Head"),
    *sides("#Hip", "#Knee", "#Ankle", "#Toe", "#Collar", "#Shoulder", "#Elbow", "#Wrist"),
]
BIPED = [f"Bip01 {n}" for n in ("Pelvis", "Spine", "Spine1", "Neck", "Head")] + [
    f"Bip01 {s} {n}"
    for s in "LR"
    for n in ("Thigh", "Calf", "Foot", "Toe0", "Clavicle", "UpperArm", "Forearm", "Hand")
]
RIGS = {
    "humanik": [*HUMANIK, "Spine1", *sides("#ToeBase")],
    "humanik-one-spine": [*HUMANIK, *sides("#ToeBase")],
    "humanik-minimal": [n for n in HUMANIK if n != "Neck"] + sides("#ToeBase"),
    "mixamo": [*HUMANIK, "Spine1", "Spine2", "HeadTop_End", *sides("#ToeBase", "#Toe_End")],
    "lafan1": [*HUMANIK, "Spine1", "Spine2", *sides("#Toe")],
    "cmu-bvh": [*HUMANIK, "Spine1", "Neck1", "LowerBack", "LHipJoint", "RHipJoint",
                *sides("#ToeBase", "#ToeBase/End", "#HandIndex1")],
    "xsens": XSENS,
    "biovision": [n for n in XSENS if n not in ("Chest2", "Chest3", "Chest4")],
    "biped": BIPED,
}  # fmt: skip


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_is_known_by_its_whole_set_of_names(name):
    assert choose_map(skeleton(RIGS[name])).joint_map.name == name


@pytest.mark.parametrize(
    "prefix", ["mixamorig:", "mixamorig_", "mixamorig", "mixamorig9:", "Bob:mixamorig:", "X1_"]
)
def test_what_exporters_put_before_names_is_taken_off(prefix):
    mapping = choose_map(skeleton([prefix + n for n in RIGS["mixamo"]]))
    assert mapping.joint_map.name == "mixamo"
    assert -1 not in mapping.nodes[:6]


def node(mapping, rig, joint):
    return RIGS[rig][mapping.nodes[INDEX[joint]]]


def test_one_name_can_be_two_joints():
    humanik = choose_map(skeleton(RIGS["humanik"]))
    assert node(humanik, "humanik", "lclavicle") == "LeftShoulder"
    xsens = choose_map(skeleton(RIGS["xsens"]))
    assert node(xsens, "xsens", "lclavicle") == "LeftCollar"
    assert node(xsens, "xsens", "lshoulder") == "LeftShoulder"


def test_an_end_site_on_its_own_joint_is_no_point_of_its_own():
    names = [name for name, _, _ in PERSON] + ["LeftToeBase/End", "RightToeBase/End"]
    mapping = choose_map(skeleton(names))
    assert names[mapping.nodes[INDEX["ltoes"]]] == "LeftToeBase/End"
    assert names[mapping.nodes[INDEX["headtop"]]] == "Head/End"
    mapping = choose_map(skeleton(names, zero_ends=["LeftToeBase/End", "Head/End"]))
    assert names[mapping.nodes[INDEX["ltoes"]]] == "LeftToeBase"
    assert mapping.nodes[INDEX["headtop"]] == -1


def test_a_rig_without_a_map_is_told_what_the_nearest_map_misses():
    names = [n for n in RIGS["humanik"] if n != "LeftArm"]
    with pytest.raises(FormatError) as caught:
        choose_map(skeleton(names), where="take.bvh")
    assert str(caught.value) == (
        "take.bvh: no joint map fits its names; the nearest, 'humanik', needs 'LeftArm' for "
        "lshoulder; write a map of your own and name it with --joint-map"
    )


@pytest.mark.parametrize("joint_map", shipped_maps(), ids=lambda m: m.name)
def test_shipped_maps_tell_left_from_right(joint_map):
    for i, joint in enumerate(CANONICAL_JOINTS):
        other = CANONICAL_JOINTS[MIRROR[i]]
        mine, theirs = joint_map.joints.get(joint, ()), joint_map.joints.get(other, ())
        assert len(mine) == len(theirs)
        if joint != other and "clavicle" not in joint:
            assert not set(mine) & set(theirs)
    assert joint_map.source


def test_every_shipped_map_is_documented():
    page = (Path(__file__).parent.parent.parent / "docs" / "skeletons.md").read_text()
    for joint_map in shipped_maps():
        assert f"`{joint_map.name}`" in page


def test_the_canonical_tree_is_one_tree_with_two_sides():
    assert len(CANONICAL_JOINTS) == 24
    assert PARENTS[0] == -1
    assert (PARENTS[1:] < np.arange(1, 24)).all()
    np.testing.assert_array_equal(MIRROR[MIRROR], np.arange(24))
    assert CANONICAL_JOINTS[MIRROR[INDEX["lclavicle"]]] == "rclavicle"
    assert CANONICAL_JOINTS[MIRROR[INDEX["root"]]] == "root"
    np.testing.assert_array_equal(MIRROR[PARENTS[1:]], PARENTS[MIRROR[1:]])


OWN = """
name = "mine"
[joints]
root = "pelvis"
lhip = "thighL"
lknee = "shinL"
lankle = "footL"
rhip = "thighR"
rknee = "shinR"
rankle = "footR"
head = ["skull", "head"]
neck = { between = ["root", "head"], at = 0.8 }
"""


def test_a_map_of_ones_own_has_the_form_of_the_shipped_ones(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(OWN)
    joint_map = load_joint_map(path)
    assert joint_map.name == "mine"
    assert joint_map.joints["head"] == ("skull", "head")
    assert joint_map.made["neck"].at == 0.8
    names = ["pelvis", "thighL", "shinL", "footL", "thighR", "shinR", "footR", "head"]
    mapping = choose_map(skeleton(names), joint_map)
    assert mapping.nodes[INDEX["head"]] == 7
    with pytest.raises(FormatError, match="the nearest, 'mine', needs 'skull' for head"):
        choose_map(skeleton(names[:-1]), joint_map)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("name =", "nom =", "unknown key 'nom'"),
        ('name = "mine"', "", "name: expected a text"),
        ('name = "mine"', "name = 3", "name: expected a text"),
        ('"pelvis"', "3", "joint root: expected a name or a list of names"),
        ('"pelvis"', "[]", "joint root: expected a name or a list of names"),
        ('"pelvis"', '[""]', "joint root: expected a name or a list of names"),
        ("root =", "pelvis =", "[joints] has 'pelvis'"),
        ('head = ["skull", "head"]', "", "[joints] lacks head"),
        ("at = 0.8", "at = 80", "joint neck: expected { between"),
        ("at = 0.8", "to = 0.8", "joint neck: expected { between"),
        ("at = 0.8", "at = nan", "joint neck: expected { between"),
        ('"root", "head"]', '"root", "skull"]', "joint neck: expected { between"),
        ('"root", "head"]', '"root", "chest"]', "joint neck is made from chest"),
        ("[joints]", "strip = '('\n[joints]", "strip is no regular expression"),
        ("[joints]", "needs = 'a'\n[joints]", "needs: expected a name or a list of names"),
        ("[joints]", "[joint]", "unknown key 'joint'"),
        ("[joints]", "[joints", "is not TOML"),
    ],
)
def test_a_wrong_map_is_one_line_with_entry_and_key(old, new, reason):
    text = OWN.replace(old, new, 1)
    assert text != OWN
    with pytest.raises(FeatureSetError) as caught:
        parse_joint_map(text, "mine.toml")
    assert str(caught.value).startswith(f"mine.toml: {reason}")
    assert "\n" not in str(caught.value)


def test_files_that_are_no_maps_are_one_line(tmp_path):
    path = tmp_path / "map.toml"
    with pytest.raises(FeatureSetError, match="no such file"):
        load_joint_map(path)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(FeatureSetError, match="not UTF-8"):
        load_joint_map(path)
    path.write_text("a = " + "[" * 1900)
    with pytest.raises(FeatureSetError, match=r"nested too deeply|not TOML"):
        load_joint_map(path)
    path.write_bytes(b"#" * 2_000_000)
    with pytest.raises(FeatureSetError, match="larger than 1 MiB"):
        load_joint_map(path)
