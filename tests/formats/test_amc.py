import numpy as np
import pytest

from mocapidx.errors import FormatError
from mocapidx.formats import amc, amc_frames
from mocapidx.formats.amc import find_skeleton, read_amc
from mocapidx.formats.text import Limits
from tests.small_files import AMC, ASF


def read(tmp_path, text, limits=None, asf=ASF):
    path = tmp_path / "take.amc"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    (tmp_path / "small.asf").write_text(asf)
    return read_amc(path, None, limits or Limits())


def refused(tmp_path, text, limits=None):
    with pytest.raises(FormatError) as caught:
        read(tmp_path, text, limits)
    message = str(caught.value)
    assert "\n" not in message
    return message.removeprefix(str(tmp_path / "take.amc"))


def test_a_small_take_is_read_as_it_stands(tmp_path):
    recording = read(tmp_path, AMC)
    assert recording.channel_nodes.tolist() == [0] * 6 + [1, 1, 1, 2]
    # rotations: x is applied first, so it is the last factor
    assert recording.channel_kinds.tolist() == [0, 1, 2, 5, 4, 3, 5, 4, 3, 3]
    quarter = np.deg2rad(90)
    expected = np.array(
        [
            [0, 3, 0, 0, 0, 0, 0, 0, quarter, 0],
            [1, 3, 0, 0, quarter, 0, 0, 0, 0, quarter],
            [2, 3, 0, 0, 0, 0, np.deg2rad(1.5e-15), 0, 0, np.deg2rad(-90.25)],
        ]
    )
    np.testing.assert_array_equal(recording.values, expected)
    assert recording.rate is None
    assert recording.unit == pytest.approx(0.056444, abs=1e-6)


REORDERED = AMC.replace("thigh 0 0 0\nshank 90\n", "shank 90\nthigh 0 0 0\n")
LATIN = AMC.replace("C:\\small", "C:\\f\udcfcr Bonn").replace("\n", "\r\n", 7)


@pytest.mark.parametrize(
    "text",
    [
        AMC.replace("\n", "\r\n"), AMC.replace("\n", "\r"), AMC.replace(" ", "\t"),
        AMC.replace("\n", " \n"), AMC.replace("\n2\n", "\n\n2\n"), AMC.removesuffix("\n"),
        AMC.replace("\n2\n", "\n# a remark\n2\n"), REORDERED, LATIN, "\ufeff" + AMC,
        AMC.replace("\n1\n", "\n41\n").replace("\n2\n", "\n42\n").replace("\n3\n", "\n43\n"),
    ],
)  # fmt: skip
def test_line_ends_blanks_remarks_and_order_do_not_matter(tmp_path, text):
    expected = read(tmp_path, AMC)
    found = read(tmp_path, text)
    np.testing.assert_array_equal(found.values, expected.values)
    np.testing.assert_array_equal(found.channel_kinds, expected.channel_kinds)


def test_radians_and_the_rate_of_the_header_are_heeded(tmp_path):
    text = AMC.replace(":DEGREES", ":RADIANS\n:SAMPLES-PER-SECOND 60")
    recording = read(tmp_path, text)
    assert recording.values[0, 8] == 90.0
    assert recording.rate == 60.0


@pytest.mark.parametrize("rate", ["0", "nan", "-1", "x", "1e9", ""])
def test_a_rate_out_of_bounds_is_refused(tmp_path, rate):
    text = AMC.replace(":DEGREES", f":SAMPLES-PER-SECOND {rate}")
    assert "expected samples a second between 0.1 and 10000" in refused(tmp_path, text)


def test_axes_in_another_order_change_the_order_of_the_factors(tmp_path):
    asf = ASF.replace("axis 0 0 0 XYZ\n    dof rx ry rz", "axis 0 0 0 ZXY\n    dof rx ry rz")
    recording = read(tmp_path, AMC, asf=asf)
    assert recording.channel_kinds[6:9].tolist() == [4, 3, 5]
    assert recording.values[0, 6:9].tolist() == [0, np.deg2rad(90), 0]


def test_many_blocks_read_like_one(tmp_path, monkeypatch):
    frames = AMC[AMC.index("1\nroot") :]
    text = AMC[: AMC.index("1\nroot")]
    for i in range(100):
        for n in (1, 2, 3):
            begin, end = frames.index(f"{n}\nroot"), frames.find(f"{n + 1}\nroot")
            body = frames[begin : end if end > 0 else None].split("\n", 1)[1]
            text += f"{3 * i + n}\n{body}"
    whole = read(tmp_path, text)
    assert len(whole.values) == 300
    monkeypatch.setattr(amc, "BLOCK", 200)
    np.testing.assert_array_equal(read(tmp_path, text).values, whole.values)
    broken = text.replace("\n299\nroot 1 3", "\n299\nroot 1 x")
    line = broken[: broken.index("root 1 x")].count("\n") + 1
    assert refused(tmp_path, broken) == (
        f":{line}: frame 299: value 2 of 'root' is 'x', expected a number"
    )


def test_bones_in_another_order_are_read_in_blocks_too(tmp_path, monkeypatch):
    text = AMC[: AMC.index("1\nroot")]
    for i in range(1, 200):
        bones = [f"root {i} 3 0 0 0 0", "thigh 0 0 0", "shank 0"]
        text += "\n".join([str(i), *bones[i % 3 :], *bones[: i % 3]]) + "\n"
    whole = read(tmp_path, text)
    assert whole.values[:, 0].tolist() == list(range(1, 200))
    monkeypatch.setattr(amc, "BLOCK", 100)
    np.testing.assert_array_equal(read(tmp_path, text).values, whole.values)
    monkeypatch.setattr(amc_frames, "LARGE", 50)
    np.testing.assert_array_equal(read(tmp_path, text).values, whole.values)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("thigh 0 0 0", "thigh 0 0",
         ":10: frame 2 has 2 values for 'thigh', small.asf gives it 3 degrees of freedom"),
        ("thigh 0 0 0", "thigh 0 0 0 0",
         ":10: frame 2 has 4 values for 'thigh', small.asf gives it 3 degrees of freedom"),
        ("thigh 90 0 0", "thigh",
         ":6: frame 1 has 0 values for 'thigh', small.asf gives it 3 degrees of freedom"),
        ("shank 90\n", "", ":10: frame 2 ends without bone 'shank'"),
        ("shank 0\n", "", ":6: frame 1 ends without bone 'shank'"),
        ("shank -90.25\n", "", ":14: frame 3 ends without bone 'shank'"),
        ("shank 90\n", "shank 90\nshank 90\n", ":12: frame 2 has bone 'shank' twice"),
        ("shank 90\n", "wing 90\n", ":11: frame 2: bone 'wing' is not one that small.asf moves; "
         "name the right skeleton with --skeleton"),
        ("shank 0\n", "foot 0\n", ":7: frame 1: bone 'foot' is not one that small.asf moves; "
         "name the right skeleton with --skeleton"),
        ("\n2\n", "\n3\n", ":8: frame 3, expected 2"),
        ("\n3\n", "\n2\n", ":12: frame 2, expected 3"),
        ("\n2\n", "\n", ":8: frame 1 has bone 'root' twice"),
        ("shank 90\n", "shank 9_0\n", ":11: frame 2: value 1 of 'shank' is '9_0', expected a number"),  # noqa: E501
        ("shank 90\n", "shank nan\n", ":11: frame 2: value 1 of 'shank' is 'nan', expected a number"),  # noqa: E501
        ("shank 90\n", "shank 1e999\n",
         ":11: frame 2: value 1 of 'shank' is '1e999', expected a number"),
        ("shank 90\n", "shank １２\n",
         ":11: frame 2: value 1 of 'shank' is '１２', expected a number"),
        ("shank 90\n", "sh\x1b[2Jank 90\n", ":11: frame 2: bone 'sh\\x1b[2Jank' is not one that "
         "small.asf moves; name the right skeleton with --skeleton"),
        ("shank -90.25\n", "sha", ":15: frame 3: bone 'sha' is not one that small.asf moves; "
         "name the right skeleton with --skeleton"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_by_line_frame_and_bone(tmp_path, old, new, reason):
    text = AMC.replace(old, new, 1)
    assert text != AMC
    assert refused(tmp_path, text) == reason


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", ": not an AMC file: it has no frames"),
        (":DEGREES\n", ": not an AMC file: it has no frames"),
        ("\x1f\x08", ":1: not an AMC file: expected a frame number, found '\\x1f\\x08'"),
        ("HIERARCHY\n", ":1: not an AMC file: expected a frame number, found 'HIERARCHY'"),
    ],
)
def test_other_files_are_no_amc(tmp_path, text, reason):
    assert refused(tmp_path, text) == reason


def test_too_many_frames_name_the_limit_and_the_option(tmp_path):
    message = refused(tmp_path, AMC, Limits(max_frames=2))
    assert message == ": more than 2 frames; --max-frames lifts this limit"


def touched(folder, *names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).touch()


@pytest.mark.parametrize(
    ("beside", "above", "expected"),
    [
        (["13.asf"], [], "13.asf"),
        (["1.asf", "13.asf"], [], "13.asf"),
        (["13.asf", "13_2.asf", "13_29.asf"], [], "13_29.asf"),
        (["13.ASF", "14.asf"], [], "13.ASF"),
        (["other.asf"], [], "other.asf"),
        (["other.asf"], ["13.asf"], "../13.asf"),
        ([], ["13.asf", "14.asf"], "../13.asf"),
        ([], ["other.asf"], "../other.asf"),
        (["14.asf", "15.asf"], ["other.asf"], "../other.asf"),
    ],
)
def test_the_skeleton_is_found_by_name_or_because_it_is_the_only_one(
    tmp_path, beside, above, expected
):
    folder = tmp_path / "takes"
    touched(folder, "13_29.amc", *beside)
    touched(tmp_path, *above)
    assert find_skeleton(folder / "13_29.amc") == (
        tmp_path / expected[3:] if expected.startswith("../") else folder / expected
    )


def test_without_a_skeleton_the_message_says_what_is_expected(tmp_path):
    folder = tmp_path / "takes"
    with pytest.raises(FormatError, match=r"13_29\.amc: no such file"):
        find_skeleton(folder / "13_29.amc")
    touched(folder, "13_29.amc")
    with pytest.raises(FormatError, match=r"13_29\.amc: expects SKELETON\.asf .* found none"):
        find_skeleton(folder / "13_29.amc")
    touched(folder, "1.asf", "2.asf")
    with pytest.raises(FormatError, match="found 2 of which none begins its name"):
        find_skeleton(folder / "13_29.amc")


def test_a_skeleton_is_found_from_a_relative_path(tmp_path, monkeypatch):
    touched(tmp_path, "13.asf")
    touched(tmp_path / "takes", "13_29.amc")
    monkeypatch.chdir(tmp_path / "takes")
    assert find_skeleton(amc.Path("13_29.amc")).resolve() == (tmp_path / "13.asf").resolve()
