import json

import numpy as np
import pytest

from mocapidx.errors import ParameterError
from mocapidx.formats.registry import read_recording
from mocapidx.skeleton.conventions import Overrides, detect_conventions
from mocapidx.skeleton.jointmap import choose_map
from tests.small_files import PERSON, bvh_text, person_rows

ARMS_DOWN = {"LeftArm": (-80, 0, 0), "RightArm": (80, 0, 0)}


def detected(tmp_path, nodes, rows, overrides=None, **text):
    path = tmp_path / "take.bvh"
    path.write_text(bvh_text(nodes, rows, **text))
    recording = read_recording(path)
    return detect_conventions(recording, choose_map(recording.skeleton), overrides)


def scaled(factor):
    return [(n, p, tuple(factor * v for v in o)) for n, p, o in PERSON]


def walking(frames=20, **turns):
    """A person who shifts about a little, so that no two frames are the same."""
    rows = person_rows(frames, **{**ARMS_DOWN, **turns})
    for i, row in enumerate(rows):
        row[2] += 0.5 * i
    return rows


@pytest.mark.parametrize(
    ("file_unit", "metres"),
    [(1.0, 0.01), (0.01, 1.0), (10.0, 0.001), (1 / 2.54, 0.0254), (0.45 / 2.54, 0.0254 / 0.45)],
)
def test_the_unit_is_the_one_that_gives_human_legs(tmp_path, file_unit, metres):
    rows = [[file_unit * v if i < 3 else v for i, v in enumerate(row)] for row in walking()]
    conventions = detected(tmp_path, scaled(file_unit), rows)
    assert conventions.unit == pytest.approx(metres)
    assert "legs of 0.85 m" in conventions.evidence[0]
    assert not conventions.warnings


def test_legs_of_no_adult_are_warned_of(tmp_path):
    rows = [[0.6 * v if i < 3 else v for i, v in enumerate(row)] for row in walking()]
    conventions = detected(tmp_path, scaled(0.6), rows)
    assert conventions.warnings == ("legs of 0.51 m are no adult's: is the unit right?",)


def test_root_positions_replace_an_offset_that_would_lift_the_feet(tmp_path):
    conventions = detected(tmp_path, PERSON, walking())
    assert conventions.root_positions == "replace"
    assert "add: lowest foot at 0.97 m" in conventions.evidence[2]
    assert "replace: lowest foot at 0.02 m" in conventions.evidence[2]


def test_root_positions_are_added_where_they_are_small(tmp_path):
    rows = walking()
    for row in rows:
        row[1] = 0
    assert detected(tmp_path, PERSON, rows).root_positions == "add"


def test_an_offset_of_nothing_needs_no_guess(tmp_path):
    nodes = [("Hips", "", (0, 0, 0)), *PERSON[1:]]
    conventions = detected(tmp_path, nodes, walking())
    assert conventions.root_positions == "add"
    assert "both are the same here" in conventions.evidence[2]


def test_position_channels_of_all_joints_replace_when_adding_doubles_the_body(tmp_path):
    text = bvh_text(PERSON, walking(3))
    order = [line.split()[1] for line in text.splitlines() if "JOINT" in line]
    offsets = {name: offset for name, _, offset in PERSON}
    rows = []
    for row in walking(3):
        wide = row[:6]
        for i, name in enumerate(order):
            wide += [*offsets[name], *row[6 + 3 * i : 9 + 3 * i]]
        rows.append(wide)
    channels = "CHANNELS 3 Zrotation"
    text = bvh_text(PERSON, rows).replace(
        channels, "CHANNELS 6 Xposition Yposition Zposition Zrotation"
    )
    path = tmp_path / "take.bvh"
    path.write_text(text)
    recording = read_recording(path)
    conventions = detect_conventions(recording, choose_map(recording.skeleton))
    assert (conventions.root_positions, conventions.unit) == ("replace", 0.01)


@pytest.mark.parametrize("up", ["x", "-x", "y", "-y", "z", "-z"])
def test_up_is_where_the_head_is(tmp_path, up):
    axis, sign = "xyz".index(up[-1]), -1 if up[0] == "-" else 1
    turned = []
    for name, parent, offset in PERSON:
        x, y, z = offset
        new = [0.0, 0.0, 0.0]
        new[axis], new[(axis + 1) % 3], new[(axis + 2) % 3] = sign * y, sign * z, x
        turned.append((name, parent, tuple(new)))
    rows = person_rows(5, root=turned[0][2])
    conventions = detected(tmp_path, turned, rows, Overrides(keep_first_frame=True))
    assert conventions.up == up
    assert "the head is 1.45 m above the ankles (guessed)" in conventions.evidence[1]
    assert not conventions.warnings


def test_lying_down_for_most_of_a_take_does_not_turn_the_world_over(tmp_path):
    standing, lying = walking(20), walking(80)
    for row in lying:
        row[1], row[4] = 12, -90
    assert detected(tmp_path, PERSON, standing + lying).up == "y"


def test_a_first_frame_of_zero_rotations_is_dropped(tmp_path):
    rows = person_rows(1) + walking(20)
    conventions = detected(tmp_path, PERSON, rows)
    assert conventions.first_frame == "dropped T-pose"
    assert "all its rotations are 0" in conventions.evidence[3]


def test_a_first_frame_with_the_arms_out_and_far_from_the_next_is_dropped(tmp_path):
    rows = person_rows(1, Spine=(0, 1, 0)) + walking(20)
    conventions = detected(tmp_path, PERSON, rows)
    assert conventions.first_frame == "dropped T-pose"
    assert "joints move 0." in conventions.evidence[3]


def test_other_first_frames_are_motion(tmp_path):
    assert detected(tmp_path, PERSON, walking(20)).first_frame == "motion"
    assert detected(tmp_path, PERSON, person_rows(1)).first_frame == "motion"
    assert detected(tmp_path, PERSON, person_rows(9)).first_frame == "motion"
    jumps = person_rows(1, LeftArm=(60, 0, 0), Spine=(0, 1, 0)) + walking(20)
    assert detected(tmp_path, PERSON, jumps).first_frame == "motion"


def test_exchanged_sides_are_warned_of(tmp_path):
    nodes = [(n, p, (-o[0], *o[1:])) for n, p, o in PERSON]
    conventions = detected(tmp_path, nodes, walking())
    assert conventions.warnings[0].startswith("the toes point backwards")
    assert "cosine of toes and front -1.00" in conventions.evidence[4]


def test_joints_made_missing_and_on_one_point_are_listed(tmp_path):
    nodes = [n for n in PERSON if "ToeBase" not in n[0] and n[0] != "Head/End"]
    nodes = [
        (n, p, (0, 20, 0) if n in ("LeftShoulder", "RightShoulder") else o) for n, p, o in nodes
    ]
    rows = [row[:15] + row[18:27] + row[30:] for row in walking()]
    conventions = detected(tmp_path, nodes, rows)
    assert conventions.joint_map == "humanik"
    assert conventions.made == ("headtop", "lfingers", "rfingers")
    assert conventions.missing == ("ltoes", "rtoes")
    assert conventions.coincident == (
        ("neck", "lclavicle"), ("neck", "rclavicle"), ("lclavicle", "rclavicle"),
    )  # fmt: skip
    assert not conventions.warnings


def test_what_the_user_says_goes(tmp_path):
    said = Overrides(unit=0.02, up="-z", root_positions="add", keep_first_frame=False)
    conventions = detected(tmp_path, PERSON, walking(), said)
    assert (conventions.unit, conventions.up, conventions.root_positions) == (0.02, "-z", "add")
    assert conventions.first_frame == "dropped T-pose"
    assert all("as told" in line for line in conventions.evidence[:4])


def test_a_store_keeps_what_was_decided_without_the_evidence(tmp_path):
    record = detected(tmp_path, PERSON, walking()).to_dict()
    assert json.loads(json.dumps(record)) == record
    assert record["unit"] == 0.01
    assert "evidence" not in record


@pytest.mark.parametrize(
    "wrong",
    [{"unit": 0}, {"unit": -1}, {"unit": np.nan}, {"up": "w"}, {"root_positions": "both"}],
)
def test_overrides_are_checked(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        Overrides(**wrong)
