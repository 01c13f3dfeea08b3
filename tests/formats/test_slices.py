"""Stretches of motion files, read back by us and, for C3D, by a public reader."""

import io
import warnings

import numpy as np
import pytest

from mocapidx.errors import FormatError
from mocapidx.formats.amc import read_amc
from mocapidx.formats.bvh import read_bvh
from mocapidx.formats.c3d import read_c3d
from mocapidx.formats.slice_c3d import c3d_frames
from mocapidx.formats.slice_text import amc_frames, bvh_frames
from mocapidx.formats.text import Limits
from tests.small_files import AMC, ASF, BVH

LIMITS = Limits()
CUTS = ((0, 3), (0, 1), (1, 3), (2, 3))


@pytest.mark.parametrize(("start", "end"), CUTS)
@pytest.mark.parametrize(
    "text",
    [
        BVH,
        BVH.replace("\n", "\r\n"),
        BVH.replace("\n", "\r"),
        BVH.replace("\n", "\n\n"),
        BVH.removesuffix("\n"),
        BVH.replace("Frames: 3", "  frames:\t+3 "),
        BVH.replace("\n  }\n}\nMOTION", "} } MOTION"),
        BVH.replace("Frames: 3", "\fFrames\v:\v3\f"),
        BVH.replace("\n1 3 0 90", "\n\x01\n1 3 0\x1c90") + "\0\0",
    ],
)
def test_a_stretch_of_bvh_has_the_same_numbers(tmp_path, text, start, end):
    path, cut = tmp_path / "take.bvh", tmp_path / "cut.bvh"
    path.write_bytes(text.encode())
    cut.write_bytes(bvh_frames(path, LIMITS).cut(start, end))
    whole, part = read_bvh(path, LIMITS), read_bvh(cut, LIMITS)
    np.testing.assert_array_equal(part.values, whole.values[start:end])
    assert part.skeleton.names == whole.skeleton.names
    assert part.rate == whole.rate


@pytest.mark.parametrize(("start", "end"), CUTS)
@pytest.mark.parametrize(
    "text",
    [
        AMC,
        AMC.replace("\n", "\r\n"),
        AMC.replace("\n2\n", "\n 2 \n").replace("\n", "\n# a comment\n"),
        AMC.replace("small.asf", "gr\udcfc\udcdfe.asf").removesuffix("\n"),
        AMC.replace("\n3\n", "\n9\n").replace("\n2\n", "\n8\n").replace("\n1\n", "\n7\n"),
        AMC.replace(":DEGREES", ":SAMPLES-PER-SECOND 60\n:DEGREES"),
        AMC.replace("\n1\n", "\n\v1\f\n").replace("\n2\n", "\n\x012\0\n") + "\0\n",
    ],
)
def test_a_stretch_of_amc_has_the_same_numbers_and_counts_from_1(tmp_path, text, start, end):
    (tmp_path / "small.asf").write_text(ASF)
    path, cut = tmp_path / "take.amc", tmp_path / "cut.amc"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    cut.write_bytes(amc_frames(path, LIMITS).cut(start, end))
    whole, part = read_amc(path, None, LIMITS), read_amc(cut, None, LIMITS)
    np.testing.assert_array_equal(part.values, whole.values[start:end])
    assert part.rate == whole.rate
    lines = (line.strip(bytes(range(33))) for line in cut.read_bytes().split(b"\n"))
    numbers = [line for line in lines if line.isdigit()]
    assert numbers == [b"%d" % n for n in range(1, end - start + 1)]


@pytest.mark.parametrize(("start", "end"), [(-1, 2), (0, 4), (2, 2), (3, 2), (3, 4)])
def test_frames_that_are_not_there_are_refused(tmp_path, start, end):
    (tmp_path / "take.bvh").write_text(BVH)
    (tmp_path / "take.amc").write_text(AMC)
    (tmp_path / "take.c3d").write_bytes(made_c3d(3))
    for frames in (
        bvh_frames(tmp_path / "take.bvh", LIMITS),
        amc_frames(tmp_path / "take.amc", LIMITS),
        c3d_frames(tmp_path / "take.c3d", LIMITS),
    ):
        with pytest.raises(FormatError, match="has 3 frames, none from"):
            frames.cut(start, end)


def made_c3d(frames):
    """Write a C3D of three points and two analogue channels with the public package `c3d`."""
    c3d = pytest.importorskip("c3d")
    generator = np.random.default_rng(frames)
    writer = c3d.Writer(point_rate=60.0, analog_rate=240.0, point_scale=-1.0)
    for _ in range(frames):
        points = np.zeros((3, 5), np.float32)
        points[:, :3] = generator.normal(0, 500, (3, 3))
        writer.add_frames([(points, generator.normal(0, 1, (2, 4)).astype(np.float32))])
    writer.set_point_labels(["A", "B", "C"])
    writer.set_analog_labels(["x", "y"])
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        writer.write(stream)
    return stream.getvalue()


def read_by_others(path):
    """Numbers, points and analogue values of all frames, as the public package reads them."""
    c3d = pytest.importorskip("c3d")
    with path.open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        frames = list(c3d.Reader(file).read_frames())
    return (
        [number for number, _, _ in frames],
        np.array([points for _, points, _ in frames]),
        [analogue for _, _, analogue in frames],
    )


def check_c3d(path, cut, start, end):
    cut.write_bytes(c3d_frames(path, LIMITS).cut(start, end))
    whole, part = read_c3d(path, LIMITS), read_c3d(cut, LIMITS)
    np.testing.assert_array_equal(part.positions, whole.positions[start:end])
    assert (part.names, part.rate, part.unit) == (whole.names, whole.rate, whole.unit)
    numbers, points, analogue = read_by_others(path)
    part_numbers, part_points, part_analogue = read_by_others(cut)
    assert part_numbers == numbers[start:end]
    np.testing.assert_array_equal(part_points, points[start:end])
    assert len(part_analogue) == end - start
    for found, expected in zip(part_analogue, analogue[start:end], strict=True):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(("start", "end"), CUTS)
def test_a_stretch_of_c3d_keeps_points_residuals_and_analogue_values(tmp_path, start, end):
    path = tmp_path / "take.c3d"
    path.write_bytes(made_c3d(3))
    check_c3d(path, tmp_path / "cut.c3d", start, end)


@pytest.mark.parametrize(
    "name",
    ["PiG_Motion3_FF", "PlugInC3D", "pc_int", "sgi_real", "Dec_real", "pyomeca_markers_analogs"],
)
def test_stretches_of_real_c3d_of_every_processor(tmp_path, real_data, name):
    path = real_data / "c3d" / f"{name}.c3d"
    for start, end in ((0, 1), (40, 77)):
        check_c3d(path, tmp_path / "cut.c3d", start, end)
