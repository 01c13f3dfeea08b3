"""Damaged files: whatever is done to a file, the worst is one line, and it comes soon."""

import time
import tracemalloc

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mocapidx.errors import FormatError, MocapidxError
from mocapidx.formats.registry import is_motion_file, read_recording
from mocapidx.tasks.read import read_take
from tests.small_files import AMC, ASF, BVH, PERSON, bvh_text, person_rows

RIG = bvh_text(PERSON, person_rows(4, LeftArm=(1e-3, 20, 0)))


@st.composite
def damaged(draw, text):
    """The text cut off, with bytes changed, or with lines doubled, dropped or exchanged."""
    data = bytearray(text.encode())
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["cut", "flip", "write", "double", "drop", "swap"]))
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        if kind == "cut":
            del data[at:]
        elif kind == "flip" and data:
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == "write":
            data[at:at] = draw(
                st.sampled_from([b"nan", b"1e308", b"-1e308", b"{", b"}", b"\0", b"9" * 30, b"\n"])
            )
        else:
            lines = bytes(data).split(b"\n")
            i, j = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
            if kind == "double":
                lines.insert(i, lines[j])
            elif kind == "drop":
                del lines[i]
            else:
                lines[i], lines[j] = lines[j], lines[i]
            data = bytearray(b"\n".join(lines))
    return bytes(data)


def one_line_at_worst(read, path):
    begin = time.process_time()
    message = message_of(read, path)
    assert time.process_time() - begin < 1
    assert message.isprintable()
    assert len(message) < 600


def message_of(read, path):
    try:
        read(path)
    except MocapidxError as exc:
        return str(exc)
    return ""


hostile = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@hostile
@given(damaged(BVH))
def test_a_damaged_bvh_gives_one_line(tmp_path, data):
    path = tmp_path / "take.bvh"
    path.write_bytes(data)
    one_line_at_worst(read_recording, path)


@hostile
@given(damaged(RIG))
def test_a_damaged_person_gives_one_line(tmp_path, data):
    path = tmp_path / "take.bvh"
    path.write_bytes(data)
    one_line_at_worst(read_take, path)


@hostile
@given(damaged(AMC))
def test_a_damaged_amc_gives_one_line(tmp_path, data):
    path = tmp_path / "take.amc"
    path.write_bytes(data)
    (tmp_path / "small.asf").write_text(ASF)
    one_line_at_worst(read_recording, path)


@hostile
@given(damaged(ASF))
def test_a_damaged_asf_gives_one_line(tmp_path, data):
    path = tmp_path / "take.amc"
    path.write_text(AMC)
    (tmp_path / "small.asf").write_bytes(data)
    one_line_at_worst(read_recording, path)


HUGE = {
    "many braces": ("x.bvh", "HIERARCHY\n" + "{" * 1_000_000),
    "many joints": ("x.bvh", "HIERARCHY\nROOT a\n{\n" + "JOINT b\n{\n" * 90_000),
    "one long name": ("x.bvh", "HIERARCHY\nROOT " + "a" * 1_000_000),
    "many short rows": ("x.bvh", BVH[: BVH.index("0 3 0")] + "0\n" * 480_000),
    "many blank lines": ("x.bvh", BVH + "\n" * 990_000),
    "many wrong values": ("x.bvh", BVH[: BVH.index("0 3 0")] + "x x x x x x x x x\n" * 55_000),
    "many long values": ("x.bvh", BVH[: BVH.index("0 3 0")] + "1e-300 " * 140_000),
    "one long row": ("x.bvh", BVH[: BVH.index("0 3 0")] + "0 " * 490_000),
    "many frame numbers": ("x.amc", "".join(f"{i}\n" for i in range(1, 140_000))),
    "many doubled bones": ("x.amc", "1\n" + "root 0 0 0 0 0 0\n" * 58_000),
    "many frames out of order": ("x.amc", AMC + "thigh 0 0 0\n1\nroot 0 0 0 0 0 0\n" * 20_000),
    "a long header": ("x.amc", "# remark\n" * 110_000),
    "a number of a million digits": ("x.bvh", BVH.replace("-90.25", "9" * 990_000)),
    "a bone with a long name": ("x.amc", AMC + "4\n" + "r" * 990_000),
}  # fmt: skip


@pytest.mark.parametrize("kind", HUGE)
def test_a_megabyte_of_nonsense_takes_neither_time_nor_memory(tmp_path, kind):
    name, text = HUGE[kind]
    path = tmp_path / name
    path.write_text(text)
    (tmp_path / "small.asf").write_text(ASF)
    one_line_at_worst(read_recording, path)
    tracemalloc.start()
    try:
        message = message_of(read_recording, path)
        assert tracemalloc.get_traced_memory()[1] < 200e6
    finally:
        tracemalloc.stop()
    assert bool(message) == (kind != "many blank lines")


@pytest.mark.parametrize("value", ["1e12", "-1e300"])
def test_lengths_that_no_body_has_are_refused(tmp_path, value):
    path = tmp_path / "x.bvh"
    path.write_text(BVH.replace("1 3 0 90", f"{value} 3 0 90"))
    with pytest.raises(FormatError, match="frame 1: joint 'hip' is more than 1e9 units away"):
        read_recording(path)
    path.write_text(BVH.replace("OFFSET 0 -2 0", f"OFFSET 0 {value} 0"))
    with pytest.raises(FormatError, match="joint 'knee' is more than 1e9 units away"):
        read_recording(path)


def test_files_are_told_apart_by_their_suffix_in_any_case(tmp_path):
    names = ["a.amc", "a.AMC", "a.Bvh", "a.asf", "a.bvh.gz", "amc", "a"]
    assert [is_motion_file(tmp_path / n) for n in names] == [True] * 3 + [False] * 4


def test_a_file_of_another_kind_is_named_with_what_can_be_read(tmp_path):
    with pytest.raises(FormatError, match=r"x\.fbx: no such file"):
        read_recording(tmp_path / "x.fbx")
    (tmp_path / "x.fbx").write_bytes(b"Kaydara")
    with pytest.raises(FormatError, match=r"x\.fbx: .* mocapidx reads \.amc, \.bvh, "):
        read_recording(tmp_path / "x.fbx")
