import numpy as np
import pytest

from mocapidx.errors import FormatError
from mocapidx.formats.asf import read_asf
from mocapidx.formats.text import Limits
from tests.small_files import ASF


def read(tmp_path, text, limits=None):
    path = tmp_path / "small.asf"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    return read_asf(path, limits or Limits())


def refused(tmp_path, text, limits=None):
    with pytest.raises(FormatError) as caught:
        read(tmp_path, text, limits)
    message = str(caught.value)
    assert "\n" not in message
    return message.removeprefix(str(tmp_path / "small.asf"))


def line_of(text, part):
    return text[: text.index(part)].count("\n") + 1


def test_a_small_skeleton_is_read_as_it_stands(tmp_path):
    acclaim = read(tmp_path, ASF)
    skeleton = acclaim.skeleton
    assert skeleton.names == ("root", "thigh", "shank", "foot")
    assert skeleton.parents.tolist() == [-1, 0, 1, 2]
    assert skeleton.offsets.tolist() == [[0, 0, 0], [0, -2, 0], [0, -1, 0], [0, 0, 0.5]]
    assert skeleton.turned_by == "own"
    quarter_about_z = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    np.testing.assert_allclose(skeleton.axes[2], quarter_about_z, atol=1e-15)
    np.testing.assert_array_equal(skeleton.axes[1], np.eye(3))
    assert acclaim.columns == ((0, 1, 2, 3, 4, 5), (3, 4, 5), (3,), ())
    assert acclaim.turns == ((3, 4, 5),) * 4
    assert acclaim.unit == pytest.approx(0.0254 / 0.45)
    assert acclaim.degrees


def test_axes_in_another_order_or_in_radians_are_heeded(tmp_path):
    text = ASF.replace("angle deg", "angle rad").replace(
        "axis 0 0 90 XYZ", f"axis 0 {np.pi / 2} {np.pi / 2} ZYX"
    )
    acclaim = read(tmp_path, text)
    # first about z by 0, then about y, then about x: e_x to -e_z to e_y
    np.testing.assert_allclose(acclaim.skeleton.axes[2] @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    assert acclaim.turns[2] == (5, 4, 3)
    assert not acclaim.degrees


def test_other_bytes_in_names_are_kept(tmp_path):
    assert "sh\udcfcank" in read(tmp_path, ASF.replace("shank", "sh\udcfcank")).skeleton.names


def test_line_ends_do_not_matter(tmp_path):
    assert len(read(tmp_path, ASF.replace("\n", "\r\n")).skeleton.names) == 4
    assert len(read(tmp_path, ASF.replace("\n", "\r")).skeleton.names) == 4


HIERARCHY = "    root thigh\n    thigh shank\n    shank foot\n"


@pytest.mark.parametrize(
    ("old", "new", "at", "reason"),
    [
        (HIERARCHY, "root thigh\nshank foot\nfoot shank\n", "shank foot",
         "bone 'shank' is its own ancestor"),
        ("shank foot", "shank shank", "shank shank", "bone 'shank' is its own parent"),
        ("shank foot", "shank root", "shank root", "root has the parent 'shank'"),
        ("shank foot", "", "name foot", "bone 'foot' has no parent in :hierarchy"),
        ("shank foot", "shank wing", "shank wing", "unknown bone 'wing' in the hierarchy"),
        ("shank foot", "wing foot", "wing foot", "unknown bone 'wing' in the hierarchy"),
        ("shank foot", "shank foot\nthigh foot", "thigh foot",
         "bone 'foot' has a second parent 'thigh', first 'shank'"),
        ("name foot", "name shank", "name foot", "bone 'shank' stands twice, first in line 27"),
        ("name foot", "name root", "name foot", "a bone is called root"),
        ("     name foot\n", "", "id 3", "a bone without a name"),
        ("dof rx\n", "dof rw\n", "dof rw", "dof of bone 'shank' is 'rw'"),
        ("dof rx\n", "dof rx rx\n", "dof rx rx", "dof of bone 'shank' is 'rx rx'"),
        ("length 1\n", "length -1\n", "length -1", "bone 'shank' has the length -1"),
        ("length 1\n", "length inf\n", "length inf", "length of bone 'shank' is 'inf'"),
        ("length 1\n", "length\n", "length\n", "length of bone 'shank' is ''"),
        ("     length 1\n", "", "id 2", "bone 'shank' has no length"),
        ("direction 0 0 1", "direction 0 1", "direction 0 1", "direction of bone 'foot'"),
        ("0 0 90 XYZ", "0 0 90 XYY", "0 0 90 XYY", "axis of bone 'shank' is '0 0 90 XYY'"),
        ("0 0 90 XYZ", "0 90 XYZ", "0 90 XYZ", "axis of bone 'shank' is '0 90 XYZ'"),
        ("length 0.45", "length 0", "length 0", "the unit 'length 0' is no sensible length"),
        ("angle deg", "angle grad", "angle grad", "the unit 'angle grad' is neither"),
        (":hierarchy", ":root\n:hierarchy", ":root\n:hier", "a second :root, first in line 10"),
        ("  end\n:hier", ":hier", "id 3", "bone 'foot' has no end"),
        ("  end\n  begin\n     id 3", "begin\n     id 3", "begin\n     id 3",
         "begin before the end of bone 'shank'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_by_bone_and_line(tmp_path, old, new, at, reason):
    text = ASF.replace(old, new, 1)
    assert text != ASF
    line, message = refused(tmp_path, text).removeprefix(":").split(": ", 1)
    assert message.startswith(reason)
    nearest = line_of(text, at) if at in text else line_of(ASF, at)
    assert abs(int(line) - nearest) <= 2


@pytest.mark.parametrize("section", [":root", ":bonedata", ":hierarchy"])
def test_a_missing_section_is_named(tmp_path, section):
    message = refused(tmp_path, ASF.replace(section, ":other"))
    assert message.startswith(f": the section {section} is missing")


@pytest.mark.parametrize("text", ["", "\n", "\x00\x01\x02", "HIERARCHY\nROOT hip\n", "# only\n"])
def test_other_files_are_no_asf(tmp_path, text):
    assert refused(tmp_path, text).startswith(": not an ASF file")


def test_a_chain_of_bones_is_limited_without_a_stack(tmp_path):
    bone = "begin\nname b{}\ndirection 0 1 0\nlength 1\nend\n"
    bones = "".join(bone.format(i) for i in range(4000))
    links = "".join(f"b{i} b{i + 1}\n" for i in range(3999))
    text = ASF.replace(":hierarchy\n  begin\n", f"{bones}:hierarchy\nbegin\nroot b0\n{links}")
    assert refused(tmp_path, text).endswith("more than 512 levels of joints")
    assert refused(tmp_path, text, Limits(max_joints=1000)).endswith(
        "more than 1,000 joints; --max-joints lifts this limit"
    )


def test_a_skeleton_that_changed_is_read_again(tmp_path):
    assert read(tmp_path, ASF).skeleton.offsets[1, 1] == -2
    assert read(tmp_path, ASF.replace("length 2", "length 25")).skeleton.offsets[1, 1] == -25
