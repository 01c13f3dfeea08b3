"""C3D: six encodings, public readers and writers to agree with, and files that lie."""

import contextlib
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import FormatError
from mocapidx.formats.c3d import named_apart, read_c3d
from mocapidx.formats.text import Limits
from tests.made_points import c3d_bytes

NAMES = ["LASI", "RASI", "SACR"]


def some_points(frames=20, points=3, seed=1):
    return np.random.default_rng(seed).normal(0, 500, (frames, points, 3)).round(1)


def read(tmp_path, data):
    path = tmp_path / "x.c3d"
    path.write_bytes(data)
    return read_c3d(path, Limits())


@pytest.mark.parametrize("processor", ["Intel", "DEC", "SGI"])
@pytest.mark.parametrize("real", [True, False])
def test_points_are_read_from_every_encoding(tmp_path, processor, real):
    points = some_points()
    points[3:6, 1] = np.nan
    found = read(tmp_path, c3d_bytes(NAMES, points, 120.0, processor=processor, real=real))
    np.testing.assert_allclose(found.positions, points, atol=1e-3)
    assert found.names == tuple(NAMES)
    assert (found.rate, found.unit, found.up) == (120.0, 0.001, "z")


def test_zero_is_a_place_and_a_negative_residual_is_none(tmp_path):
    points = some_points()
    points[2, 0], points[3, 0] = 0.0, np.nan
    found = read(tmp_path, c3d_bytes(NAMES, points)).positions
    np.testing.assert_array_equal(found[2, 0], [0, 0, 0])
    assert np.isnan(found[3, 0]).all()
    assert np.isfinite(found[:, 1:]).all()


def test_labels_go_on_beyond_255(tmp_path):
    names = [f"M{i:03d}" for i in range(300)]
    found = read(tmp_path, c3d_bytes(names, some_points(3, 300)))
    assert found.names == tuple(names)


def test_what_models_computed_and_analogue_values_are_left_out(tmp_path):
    names = [*NAMES, "LKneeAngles", "LKneePower", "Energy"]
    extra = {"ANGLES": ["LKneeAngles"], "POWERS": ["LKneePower"]}
    extra |= {"TYPE_GROUPS": ["ENERGIES", "ENERGY"], "ENERGIES": ["Energy"]}
    points = some_points(points=6)
    found = read(tmp_path, c3d_bytes(names, points, extra=extra, analogue=7))
    assert found.names == tuple(NAMES)
    np.testing.assert_allclose(found.positions, points[:, :3], atol=1e-3)


def test_labels_that_repeat_or_are_missing_are_told_apart(tmp_path):
    found = read(tmp_path, c3d_bytes(["A", "A", ""], some_points()))
    assert found.names == ("A", "A#2", "*3")
    assert named_apart(["A", "A", "A#2", "A"]) == ("A", "A#3", "A#2", "A#4")


@pytest.mark.parametrize(("said", "unit"), [("mm", 0.001), ("m", 1.0), ("CM", 0.01), ("?", None)])
def test_units_are_those_of_the_file(tmp_path, said, unit):
    assert read(tmp_path, c3d_bytes(NAMES, some_points(), units=said)).unit == unit


def test_more_frames_than_the_header_can_count(tmp_path):
    points = np.zeros((70_000, 1, 3))
    assert len(read(tmp_path, c3d_bytes(["A"], points, real=False)).positions) == 65_535
    trial = {"ACTUAL_START_FIELD": (1, 0), "ACTUAL_END_FIELD": (70_000 - 65_536, 1)}
    found = read(tmp_path, c3d_bytes(["A"], points, real=False, trial=trial))
    assert len(found.positions) == 70_000
    with pytest.raises(FormatError, match="more than 100 frames"):
        read_c3d(tmp_path / "x.c3d", Limits(max_frames=100))


def test_six_encodings_of_one_trial_read_alike(real_data):
    names = ("DEC_INT.C3D", "Dec_real.c3d", "pc_int.c3d", "pc_real.c3d", "sgi_int.c3d")
    expected = read_c3d(real_data / "c3d" / "sgi_real.c3d", Limits())
    for name in names:
        found = read_c3d(real_data / "c3d" / name, Limits())
        assert (found.names, found.rate, found.unit) == (expected.names, 50.0, 0.001)
        np.testing.assert_allclose(found.positions, expected.positions, atol=0.29)


@pytest.mark.parametrize(
    "name",
    ["Eb015pr", "PiG_Motion3_FF", "PlugInC3D", "pyomeca_markers_analogs", "walkingOptiTrack"],
)
def test_real_files_read_as_public_readers_have_them(real_data, name):
    ezc3d = pytest.importorskip("ezc3d")
    path = real_data / "c3d" / f"{name}.c3d"
    found = read_c3d(path, Limits())
    theirs = ezc3d.c3d(str(path))
    labels = [label.strip() for label in theirs["parameters"]["POINT"]["LABELS"]["value"]]
    points = theirs["data"]["points"][:3].transpose(2, 1, 0)
    columns = [labels.index(label) for label in found.names]
    np.testing.assert_allclose(found.positions, points[:, columns], rtol=1e-5, atol=1e-3)


def test_what_a_public_writer_writes_is_read(tmp_path):
    c3d = pytest.importorskip("c3d")
    points = some_points(30, 4)
    writer = c3d.Writer(point_rate=60.0, analog_rate=60.0)
    rows = np.concatenate((points, np.zeros((30, 4, 2))), axis=2)
    rows[5, 2, 3:] = -1
    writer.set_point_labels(["A", "B", "C", "D"])
    writer.add_frames([(row, np.zeros((0, 0))) for row in rows])
    path = tmp_path / "theirs.c3d"
    with path.open("wb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        writer.write(file)
    found = read_c3d(path, Limits())
    assert found.names == ("A", "B", "C", "D")
    assert found.rate == 60
    assert np.isnan(found.positions[5, 2]).all()
    points[5, 2] = np.nan
    np.testing.assert_allclose(found.positions, points, atol=1e-3)


def whole_file():
    return c3d_bytes(NAMES, some_points())


def put(data, at, octets):
    return data[:at] + octets + data[at + len(octets) :]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "it is empty"),
        (b"HIERARCHY\n" * 200, "no C3D header"),
        (whole_file()[:600], "no C3D header"),
        (put(whole_file(), 0, b"\xff"), "should begin in block 255"),
        (put(whole_file(), 515, b"\x57"), "unknown processor 87"),
        (put(whole_file(), 2, b"\xff\xff"), "65535 points, POINT:USED says 3"),
        (put(whole_file(), 8, b"\xff\x7f"), "says 32767 frames of 3 points, has"),
        (put(whole_file(), 16, b"\xff\xff"), "its data should begin"),
        (put(whole_file(), 16, b"\2\0"), "begin at byte 512, its parameters at 512"),
        (put(whole_file(), 12, b"\0\0\0\0"), "scale is 0"),
        (put(whole_file(), 12, b"\xff\xff\xff\x7f"), "scale is nan"),
        (whole_file()[:-600], "is it cut off"),
    ],
)
def test_files_that_lie_are_one_line(tmp_path, data, message):
    with pytest.raises(FormatError, match=message) as caught:
        read(tmp_path, data)
    assert "\n" not in str(caught.value)


def test_a_small_file_that_claims_everything_is_refused_before_anything_is_allocated(tmp_path):
    data = put(put(whole_file(), 2, b"\xff\xff"), 8, b"\xfe\xff")
    used = data.index(b"USED") + 4 + 4
    with pytest.raises(FormatError, match="65534 frames of 65535 points, has 0"):
        read(tmp_path, put(data, used, b"\xff\xff"))


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_damaged_files_are_read_or_refused(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "damaged.c3d"
    octets = bytearray(whole_file())
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.one_of(st.integers(0, 30), st.integers(512, 1100)))
        octets[place] = data.draw(st.integers(0, 255))
    path.write_bytes(octets[: data.draw(st.sampled_from([len(octets), 700, 1024, 1500]))])
    with contextlib.suppress(FormatError):
        found = read_c3d(path, Limits())
        assert found.positions.shape[1:] == (len(found.names), 3)
        assert len(set(found.names)) == len(found.names)
