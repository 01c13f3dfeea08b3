"""The compiled reader of numbers takes what Python's `float` takes, and the NumPy path with it."""

import math
import re
import struct
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from mocapidx.errors import FormatError
from mocapidx.formats import amc_frames, bvh
from mocapidx.formats.registry import read_recording
from tests.naive_numbers import number_of
from tests.small_files import AMC, ASF, BVH

KERNEL = pytest.importorskip("mocapidx.kernels._text", reason="the kernels weren't built")


def bits(number):
    return struct.pack("<d", number)


def by_kernel(word, before="", after="\n"):
    """What the kernel makes of a word, at the end of a text or within."""
    text = before.encode() + word.encode("utf-8", "surrogateescape") + after.encode()
    values = np.zeros((1, 1))
    read, at, _ = KERNEL.read_rows(text, len(before), np.zeros(1, int), np.ones(1), values, 0)
    assert at == (len(text) if read else len(before))
    return float(values[0, 0]) if read else None


def judged_alike(word):
    expected = number_of(word)
    for after in ("", "\n", " \t\r\n\n"):
        found = by_kernel(word, "1 " if after else "", after)
        assert (found is None) == (expected is None), word
        assert found is None or bits(found) == bits(expected), word


FLOATS = st.floats(allow_nan=False, allow_infinity=False)
DIGITS = st.text("0123456789", max_size=24)


@given(FLOATS, st.sampled_from([repr, "{:.17g}".format, "{:.6f}".format, "{:.5e}".format]))
@example(5e-324, repr)
@example(2.2250738585072011e-308, repr)
@example(1.7976931348623157e308, "{:.6f}".format)
def test_any_float_comes_back_from_its_text(number, written):
    judged_alike(written(number))


@given(FLOATS.filter(lambda x: abs(x) < 1e300), st.sampled_from([-1, 0, 1]))
@example(1.0, 0)
@example(5e-324, 0)
@example(2.0**53, 0)
def test_what_lies_halfway_between_two_floats_is_rounded_to_even(number, aside):
    halfway = (Decimal(number) + Decimal(math.nextafter(number, math.inf))) / 2
    word = f"{halfway:f}"
    if aside:
        word += ("" if "." in word else ".") + "0" * 30 + "1"
    judged_alike(word if aside >= 0 else word[:-32])
    judged_alike(f"{halfway:e}")


@given(st.sampled_from(["", "-", "+"]), DIGITS, st.sampled_from(["", "."]), DIGITS,
       st.one_of(st.just(""), st.builds("{}{}".format, st.sampled_from(["e", "E-", "e+", "e-0"]),
                                        st.integers(0, 400))))  # fmt: skip
@example("", "9007199254740993", "", "", "")
@example("-", "0" * 400, ".", "0" * 400 + "1", "")
@example("", "1" * 400, "", "", "e-380")
@example("", "1", "", "", "e22")
@example("", "1", ".", "25234", "e-014")
@example("", "", ".", "", "e5")
@example("", "9007199254740992", "", "", "e-22")
@example("", "9007199254740993", "", "", "e-22")
@example("", "1", "", "", "e99999999999999999999")
@example("", "0", "", "", "e99999999")
def test_mantissas_and_exponents_of_all_lengths_are_read(sign, whole, point, part, exponent):
    judged_alike(sign + whole + point + part + exponent or "0")


@given(st.text("0123456789.-+eE_nx\u0661/:\x00\x1f", min_size=1))
@example("1_0")
@example("１２")
@example("0x10")
@example("nan")
@example("-inf")
@example("infinity")
@example("1e")
@example("e5")
@example(".")
@example("-")
@example("1e5.0")
@example("--1")
@example("1\x00")
def test_what_is_no_number_is_left_to_python(word):
    judged_alike(word)


@pytest.mark.parametrize("end", range(1, 24))
def test_a_text_is_not_read_beyond_its_end(end):
    text = b"-123456.789012e-3 4 5\n12"[:end]
    count = len(text.split(b"\n")[0].split())
    values = np.zeros((4, count))
    read, at, lines = KERNEL.read_rows(text, 0, np.arange(count), np.ones(count), values, 0)
    for row, line in zip(values[:read], text.split(b"\n"), strict=False):
        assert row.tolist() == [float(w) for w in line.split()]
    assert lines == text[:at].count(b"\n")


def rows(text, width=2, room=10, start=0):
    values = np.full((room, width), -1.0)
    found = KERNEL.read_rows(text, 0, np.arange(width)[::-1].copy(), np.full(width, 2.0), values, 0)
    return *found, values[: found[0]].tolist()


def test_rows_are_scaled_and_put_where_they_belong():
    assert rows(b"\n 1 2\r\n\n3\t4") == (2, 11, 3, [[4, 2], [8, 6]])


@pytest.mark.parametrize("odd", [b"5", b"5 6 7", b"5 x", b"5 \x001", b"5\x1f6"])
def test_reading_stops_at_the_line_that_is_irregular(odd):
    assert rows(b"1 2\n3 4\n" + odd + b"\n7 8\n")[:3] == (2, 8, 2)


def test_reading_stops_where_there_is_no_more_room():
    assert rows(b"1 2\n3 4\n5 6\n", room=2)[:3] == (2, 8, 2)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"at": -1}, ValueError), ({"at": 5}, ValueError), ({"row": 3}, ValueError),
        ({"targets": np.array([0, 2])}, ValueError), ({"targets": np.array([-1, 0])}, ValueError),
        ({"targets": np.arange(3)}, ValueError), ({"scales": np.ones(1)}, ValueError),
        ({"scales": np.ones(2, np.float32)}, TypeError), ({"text": "1 2"}, TypeError),
        ({"values": np.zeros((2, 3))}, ValueError), ({"values": np.zeros(4)}, ValueError),
        ({"values": np.zeros((2, 4))[:, ::2]}, BufferError),
    ],
)  # fmt: skip
def test_arrays_that_do_not_fit_are_refused(change, error):
    given = {"text": b"1 2\n", "at": 0, "targets": np.arange(2), "scales": np.ones(2),
             "values": np.zeros((2, 2)), "row": 0}  # fmt: skip
    with pytest.raises((error, ValueError)):
        KERNEL.read_rows(*(given | change).values())


def both_ways(path):
    """What each path makes of a file: the bits of its values, or the message."""
    found = []
    for kernel in (KERNEL, None):
        with pytest.MonkeyPatch.context() as patch:
            for module in (amc_frames, bvh):
                patch.setattr(module, "compiled", lambda name, kernel=kernel: kernel)
            try:
                recording = read_recording(path)
                found.append((recording.values.shape, recording.values.tobytes()))
            except FormatError as exc:
                found.append(str(exc))
    return found


TAKES = {"take.amc": AMC, "take.bvh": BVH}


@st.composite
def mutated(draw):
    """A small motion file with some bytes changed."""
    name = draw(st.sampled_from(sorted(TAKES)))
    data = bytearray(TAKES[name].encode())
    for _ in range(draw(st.integers(0, 3))):
        at = draw(st.integers(0, len(data)))
        piece = st.sampled_from(
            [b"", b"\n", b" ", b"\t", b"\r", b"\r\n", b"\x00", b"\x1a", b"#", b"-", b".", b"e-014",
             b"1_0", b"nan", b"\n3\n", b"root", b"shank 0\n", b"9" * 25, b"0" * 400]
        )  # fmt: skip
        data[at : at + draw(st.integers(0, 4))] = draw(piece)
    return name, bytes(data)


@settings(
    max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(mutated())
def test_damaged_files_give_the_same_result_or_message_on_both_paths(tmp_path, take):
    name, data = take
    (tmp_path / name).write_bytes(data)
    (tmp_path / "small.asf").write_text(ASF)
    compiled, numpy = both_ways(tmp_path / name)
    assert compiled == numpy


PIECES = (
    *(b"", b"\n", b" ", b"\t", b"\r", b"\x00", b"\x0b", b"\x1c", b"\xa0", b"\xef\xbb\xbf", b"#"),
    *(b"-", b".", b"e", b"e-014", b"1_0", b"nan", b"\n2\n", b"root", b"9" * 25, b"0" * 400),
)


def damaged(data, random):
    """The data with some bytes changed, lines doubled, or the end cut off."""
    data = bytearray(data)
    for _ in range(random.integers(1, 4)):
        at = int(random.integers(0, len(data)))
        kind = random.integers(0, 4)
        if kind == 0:
            data[at : at + int(random.integers(0, 5))] = PIECES[random.integers(0, len(PIECES))]
        elif kind == 1:
            data[at] ^= 1 << int(random.integers(0, 8))
        elif kind == 2:
            begin, end = data.rfind(b"\n", 0, at) + 1, data.find(b"\n", at) + 1
            data[begin:begin] = data[begin:end]
        elif random.random() < 0.2:
            del data[at:]
    return bytes(data)


@pytest.mark.parametrize("pattern", ["hdm05/**/*.amc", "bandai/1/*.bvh"])
def test_damaged_real_files_give_the_same_result_or_message_on_both_paths(
    real_data, tmp_path, pattern
):
    source = min(real_data.glob(pattern), key=lambda path: path.stat().st_size)
    lines = source.read_bytes().split(b"\n")
    begin = next((i + 3 for i, line in enumerate(lines) if line.startswith(b"MOTION")), 0)
    beginning = b"\n".join([*lines[: begin + (8 if begin else 100)], b""])
    frames = re.sub(rb"(?m)^(Frames:\s*)\d+", rb"\g<1>8", beginning)
    (tmp_path / "HDM_x.asf").write_bytes((real_data / "hdm05" / "HDM_bd.asf").read_bytes())
    random = np.random.default_rng(5)
    path = tmp_path / f"HDM_x_1{source.suffix}"
    for _ in range(150):
        path.write_bytes(damaged(frames, random))
        compiled, numpy = both_ways(path)
        assert compiled == numpy


def test_real_files_are_the_same_bits_on_both_paths(real_data):
    paths = sorted(p for p in real_data.rglob("*") if p.suffix in (".amc", ".bvh"))[::23]
    for path in paths:
        compiled, numpy = both_ways(path)
        assert compiled == numpy, path


def test_fixtures_are_the_same_bits_on_both_paths(fixtures_dir):
    paths = sorted(p for p in fixtures_dir.rglob("*") if p.suffix in (".amc", ".bvh"))
    assert paths
    for path in paths:
        compiled, numpy = both_ways(path)
        assert compiled == numpy, path
