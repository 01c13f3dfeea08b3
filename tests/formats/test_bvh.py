import numpy as np
import pytest

from mocapidx.errors import FormatError
from mocapidx.formats.bvh import read_bvh
from mocapidx.formats.text import Limits
from tests.small_files import BVH


def read(tmp_path, text, limits=None):
    path = tmp_path / "take.bvh"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    return read_bvh(path, limits or Limits())


def refused(tmp_path, text, limits=None):
    with pytest.raises(FormatError) as caught:
        read(tmp_path, text, limits)
    message = str(caught.value)
    assert "\n" not in message
    return message.removeprefix(str(tmp_path / "take.bvh"))


def test_a_small_file_is_read_as_it_stands(tmp_path):
    recording = read(tmp_path, BVH)
    skeleton = recording.skeleton
    assert skeleton.names == ("hip", "knee", "knee/End")
    assert skeleton.parents.tolist() == [-1, 0, 1]
    assert skeleton.offsets.tolist() == [[0, 0, 0], [0, -2, 0], [0, -1, 0]]
    assert skeleton.turned_by == "parent"
    assert skeleton.axes is None
    assert recording.channel_nodes.tolist() == [0] * 6 + [1] * 3
    assert recording.channel_kinds.tolist() == [0, 1, 2, 5, 3, 4, 5, 3, 4]
    expected = np.array(
        [
            [0, 3, 0, 0, 0, 0, 0, 0, 0],
            [1, 3, 0, np.deg2rad(90), 0, 0, 0, np.deg2rad(90), 0],
            [2, 3, 0, 0, -0.0, 0, np.deg2rad(1.5e-15), 0, np.deg2rad(-90.25)],
        ]
    )
    np.testing.assert_array_equal(recording.values, expected)
    assert np.signbit(recording.values[2, 4])
    assert recording.rate == 30.0
    assert recording.unit is None


@pytest.mark.parametrize(
    "text",
    [
        BVH.replace("\n", "\r\n"),
        BVH.replace("\n", "\r"),
        BVH.replace("  ", "\t"),
        BVH.replace("\n", "  \n"),
        BVH.replace("\n", "\n\n"),
        BVH.removesuffix("\n"),
        BVH.replace("\n{", " {").replace("\n  {", " {"),
        BVH.replace("knee\n  {\n", "knee {\n"),
        BVH.replace("HIERARCHY", "hierarchy").replace("JOINT", "Joint").replace("Xpos", "xPOS"),
        BVH.replace("Frames: 3", "Frames:\t3").replace("Frame Time: ", "Frame Time:\t"),
        BVH + "\n\n\n",
        "\ufeff" + BVH,
    ],
)
def test_line_ends_blanks_and_case_do_not_matter(tmp_path, text):
    expected = read(tmp_path, BVH)
    found = read(tmp_path, text)
    assert found.skeleton.names == expected.skeleton.names
    np.testing.assert_array_equal(found.values, expected.values)


def test_utf_16_with_a_mark_is_read(tmp_path):
    path = tmp_path / "take.bvh"
    path.write_bytes(BVH.encode("utf-16"))
    assert len(read_bvh(path, Limits()).values) == 3


def test_names_may_hold_blanks_and_other_bytes(tmp_path):
    names = read(tmp_path, BVH.replace("knee", "Bip01 L Th\udcfcgh")).skeleton.names
    assert names == ("hip", "Bip01 L Th\udcfcgh", "Bip01 L Th\udcfcgh/End")


@pytest.mark.parametrize(
    ("frame_time", "rate"),
    [
        ("0.0333333", 30.0), ("0.033333", 30.0), ("0.0333", 30.0), ("0.008333", 120.0),
        ("0.0083333", 120.0), ("0.016667", 60.0), ("0.01", 100.0), ("0.04", 25.0),
        ("8.333333e-03", 120.0), ("0.041708", 1 / 0.041708), ("1", 1.0), ("10", 0.1),
        ("0.0001", 10000.0),
    ],
)  # fmt: skip
def test_a_frame_time_that_is_a_rounded_inverse_stands_for_a_whole_rate(tmp_path, frame_time, rate):
    assert read(tmp_path, BVH.replace("0.0333333", frame_time)).rate == rate


@pytest.mark.parametrize("text", ["", "\n\n", "\x1f\x8b\x08\x00binary", "MOTION\n", "x" * 100])
def test_empty_binary_and_zipped_files_are_no_bvh(tmp_path, text):
    assert refused(tmp_path, text) == ": not a BVH file: line 1 is not HIERARCHY"


def test_nesting_is_limited_and_does_not_overflow_a_stack(tmp_path):
    depth = 5000
    joints = "".join(f"JOINT j{i}\n{{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n" for i in range(depth))
    text = BVH.replace("  JOINT knee", joints + "JOINT knee").replace("MOTION", "}\n" * depth)
    assert refused(tmp_path, text).endswith("more than 512 levels of joints")


def test_too_many_joints_name_the_limit_and_the_option(tmp_path):
    joint = "JOINT j{}\n{{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n}}\n"
    text = BVH.replace("  JOINT knee", "".join(map(joint.format, range(5000))) + "JOINT knee")
    assert refused(tmp_path, text).endswith("more than 4,096 joints; --max-joints lifts this limit")


def test_too_many_frames_name_the_limit_and_the_option(tmp_path):
    message = refused(tmp_path, BVH, Limits(max_frames=2))
    assert message == ": more than 2 frames; --max-frames lifts this limit"


@pytest.mark.parametrize(
    ("number", "reason"),
    [
        ("1000000000", ": says 1000000000 frames, has 3; is the file cut off?"),
        ("2", ": says 2 frames, has 3"),
        ("-3", ":17: says '-3' frames, expected a number of frames"),
        ("3.0", ":17: says '3.0' frames, expected a number of frames"),
        ("0", ":17: says 0 frames; there is no motion in the file"),
        ("three", ":17: says 'three' frames, expected a number of frames"),
        ("", ":17: expected 'Frames: N' after MOTION"),
    ],
)
def test_a_number_of_frames_that_lies_is_told_with_both_numbers(tmp_path, number, reason):
    assert refused(tmp_path, BVH.replace("Frames: 3", f"Frames: {number}")) == reason


def test_five_thousand_digits_are_no_number_of_frames(tmp_path):
    message = refused(tmp_path, BVH.replace("Frames: 3", "Frames: " + "9" * 5000))
    assert message.startswith(":17: says '999")
    assert len(message) < 150


@pytest.mark.parametrize(
    "time", ["0", "-0.01", "nan", "inf", "1e-12", "1e9", "10.1", "0.00009", "x", "1_0", "1e999"]
)
def test_a_frame_time_out_of_bounds_is_refused(tmp_path, time):
    assert refused(tmp_path, BVH.replace("0.0333333", time)) == (
        f":18: frame time is '{time}', it must be between 1/10000 s and 10 s"
    )


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999", "1_0", "１２", "0x10", "1.2.3"])
def test_a_value_that_is_no_number_is_named_by_line_and_column(tmp_path, value):
    text = BVH.replace("1 3 0 90", f"1 3 0 {value}")
    assert refused(tmp_path, text) == f":20: value 4 is '{value}', expected a number"


def test_values_are_checked_in_later_blocks_too(tmp_path):
    rows = "0 3 0 0 0 0 0 0 0\n" * 50_000
    text = BVH.replace("Frames: 3", "Frames: 50003").replace("0.0333333\n", "0.0333333\n" + rows)
    assert len(read(tmp_path, text).values) == 50_003
    assert refused(tmp_path, text.replace("-90.25", "x")).startswith(":50021: value 9 is 'x'")
    assert refused(tmp_path, text.replace(" -90.25", "")).startswith(":50021: a frame has 8 values")


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("1.5e-015 0 -90.25", "1.5e-015", ":21: a frame has 7 values, the channels need 9"),
        ("0 90 0\n", "0 90 0 1\n", ":20: a frame has 10 values, the channels need 9"),
        ("0 90 0\n", "0 90\n0\n", ":20: a frame has 8 values, the channels need 9"),
        ("1.5e-015 0 -90.25\n", "1.5e-015 0 -", ":21: value 9 is '-', expected a number"),
    ],
)
def test_a_row_of_another_length_is_named_by_its_line(tmp_path, old, new, reason):
    assert refused(tmp_path, BVH.replace(old, new)) == reason


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("CHANNELS 3 ", "CHANNELS 0 ", ":9: joint 'knee' has '0' channels, expected 1 to 6"),
        ("CHANNELS 3 ", "CHANNELS 7 ", ":9: joint 'knee' has '7' channels, expected 1 to 6"),
        ("CHANNELS 3 ", "CHANNELS ", ":9: joint 'knee' has 'Zrotation' channels, expected 1 to 6"),
        ("CHANNELS 3 ", "CHANNELS 2 ", ":9: joint 'knee' says 2 channels, names 3"),
        ("3 Zrot", "3 Wrot", ":9: joint 'knee': unknown channel 'wrotation'"),
        ("3 Zrot", "3 Xrot", ":9: joint 'knee': channel 'xrotation' twice"),
        ("    CHANNELS 3 Zrotation Xrotation Yrotation\n", "",
         ":6: joint 'knee' has no CHANNELS"),
        ("    OFFSET 0 -2 0\n", "", ":6: joint 'knee' has no OFFSET"),
        ("OFFSET 0 -2 0", "OFFSET 0 -2",
         ":8: OFFSET of 'knee' is '0 -2', expected three numbers"),
        ("OFFSET 0 -2 0", "OFFSET 0 nan 0",
         ":8: OFFSET of 'knee' is '0 nan 0', expected three numbers"),
        ("OFFSET 0 -2 0", "OFFSET 0 -2 0\nOFFSET 0 -2 0", ":9: joint 'knee' has two OFFSETs"),
        ("JOINT knee", "JOINT hip", ":6: joint 'hip' stands twice, first in line 2"),
        ("JOINT knee", "JOINT", ":6: a joint without a name"),
        ("JOINT knee", "ROOT knee", ":6: a second ROOT; one skeleton a file is read"),
        ("JOINT knee\n  {", "JOINT knee", ":7: expected '{', found 'OFFSET 0 -2 0'"),
        ("MOTION", "}\nMOTION", ":16: '}' without a '{' before it"),
        ("}\nMOTION", "MOTION", ":15: MOTION before the '}' of joint 'hip'"),
        ("MOTION\n", "", ":16: expected a joint, found 'Frames: 3'"),
        ("HIERARCHY\n", "HIERARCHY\nMOTION\n", ":2: MOTION before any joint"),
        ("ROOT hip", "JOINT hip", ":2: 'JOINT' outside the braces of the ROOT"),
        ("OFFSET 0 -1 0", "OFFSET 0 -1 0\nCHANNELS 1 Xrotation",
         ":13: the End Site 'knee/End' has CHANNELS"),
        ("OFFSET 0 -1 0", "OFFSET 0 -1 0\nJOINT a", ":13: End Site of 'knee' has children"),
        ("ROOT hip\n{", "ROOT hip\n{\n{", ":4: '{' without a joint before it"),
        ("ROOT hip", "ROOT h\x1b[2Jip\nx", ":3: expected '{', found 'x'"),
        ("JOINT knee", "JOINT k\x1b\u202e\nx", ":7: expected '{', found 'x'"),
        ("Frame Time", "Time", ":18: expected 'Frame Time: S' after Frames"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_skeleton_is_named_by_line_and_joint(tmp_path, old, new, reason):
    assert refused(tmp_path, BVH.replace(old, new, 1)) == reason


def test_a_file_cut_off_in_its_skeleton_says_so(tmp_path):
    text = BVH[: BVH.index("MOTION")]
    assert refused(tmp_path, text) == ": ends before MOTION; is the file cut off?"


def test_names_are_shown_escaped(tmp_path):
    text = BVH.replace("JOINT knee", "JOINT \x1b[31m\u202eknee\udcfc").replace("0 -2 0", "0 0")
    assert "OFFSET of '\\x1b[31m\\u202eknee\\xfc' is '0 0'" in refused(tmp_path, text)
