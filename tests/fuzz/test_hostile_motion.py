"""A megabyte that looks like motion and is none, in every format: soon one line, in little memory.

Those of BVH and AMC stand in `tests/formats/test_hostile.py`.
"""

import io
import json
import struct
import time
import tracemalloc
import zipfile

import numpy as np
import pytest

from mocapidx.errors import MocapidxError
from mocapidx.tasks.read import read_take
from tests.made_points import c3d_bytes, trc_text
from tests.small_files import AMC, ASF

SECONDS, MEMORY = 1.0, 200e6
SMALL = 1 << 20


def packed(**arrays):
    """An npz with everything in it deflated."""
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def members(names, data):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as file:
        for name in names:
            file.writestr(name, data)
    return stream.getvalue()


def poses(frames, kind):
    return packed(poses=np.zeros((frames, 66), kind), trans=np.zeros((frames, 3), kind))


def named(joints):
    return packed(positions=np.ones((2, 3, 3)), joints=joints)


def npy(values):
    stream = io.BytesIO()
    np.save(stream, values)
    return stream.getvalue()


JOINTS = [f"joint {number}" for number in range(24)]
WHOLE = c3d_bytes(["A", "B", "C"], np.zeros((4, 3, 3)))
TRC = trc_text(["A", "B", "C"], np.zeros((4, 3, 3)), 60.0)
HEAD = TRC[: TRC.index("\n1\t") + 1]
BONES = ASF.index("begin")
AXES = [f"j{n}.{axis}" for n in range(3) for axis in "xyz"]
HUGE = {
    "bones without end": ("x.asf", ASF[:BONES] + "begin\n name a\n" * 70_000),
    "bones of one name": ("x.asf", ASF[:BONES] + "begin\nname a\nlength 1\nend\n" * 40_000),
    "a skeleton of one line": ("x.asf", ASF.replace("root ", "root " + "thigh " * 160_000, 1)),
    "limits without end": ("x.asf", ASF.replace("dof", "limits " + "(0 1)\n" * 150_000 + "dof", 1)),
    "sections without end": ("x.asf", ":units\n" * 140_000 + ASF),
    "C3D of zeros behind its header": ("x.c3d", WHOLE + b"\0" * (SMALL - len(WHOLE))),
    "C3D of ones behind its header": ("x.c3d", WHOLE[:512] + b"\xff" * (SMALL - 600)),
    "C3D parameters in a circle": ("x.c3d", WHOLE[:520] + b"\1\1A\0\0" * 200_000),
    "C3D of 65,535 points": ("x.c3d", WHOLE[:2] + b"\xff\xff" + WHOLE[4:] + b"\0" * 900_000),
    "poses of halves": ("x.npz", lambda: poses(120_000, "f2")),
    "poses of bytes": ("x.npz", lambda: poses(240_000, "u1")),
    "poses beyond all memory": ("x.npz", lambda: poses(250_000, "f8")),
    "points of bytes": (
        "x.npz",
        lambda: packed(positions=np.ones((230_000, 24, 3), "u1"), joints=np.array(JOINTS)),
    ),
    "names without end": ("x.npz", lambda: named(np.full(16_000_000, b"a"))),
    "three long names": ("x.npz", lambda: named(np.full(3, "a" * 1_300_000))),
    "members without end": ("x.npz", lambda: members((f"{n}.npy" for n in range(9000)), b"")),
    "a member of text": ("x.npz", lambda: members(["poses.npy", "trans.npy"], b"[" * 8_000_000)),
    "an array of a million axes": (
        "x.npy", b"\x93NUMPY\x02\0" + struct.pack("<I", 900_000) + b"(" * 900_000,
    ),
    "an array of bytes": ("x.npy", lambda: npy(np.ones((14_000, 24, 3), "u1"))),
    "a row of commas": ("x.csv", ",".join(AXES) + "\n" + "," * 1_000_000),
    "columns without end": ("x.csv", ",".join(f"j{n}.x" for n in range(50_000)) + "\n1\n"),
    "rows without end": ("x.csv", "frame,joint,x,y,z\n" + "0,a,1,1,1\n" * 20_000),
    "joints without end": (
        "x.csv", "frame,joint,x,y,z\n" + "".join(f"0,{n},1,1,1\n" for n in range(15_000)),
    ),
    "frames far apart": (
        "x.csv", "frame,joint,x,y,z\n" + "".join(f"{n**3},a,1,1,1\n" for n in range(45_000)),
    ),
    "quotes without end": ("x.csv", ",".join(AXES) + '\n"' + '""' * 500_000),
    "rows of TRC without cells": ("x.trc", HEAD + "\n" * 1_000_000),
    "cells of TRC without end": ("x.trc", HEAD + "1\t0\t" + "1\t" * 490_000),
    "lists without end": ("x.json", "[" * 1_000_000),
    "lists in lists": ("x.json", '{"joints":["a"],"frames":[' + "[[]]," * 30_000 + "[]]}"),
    "numbers without end": ("x.json", json.dumps({"joints": ["a"], "frames": [[0] * 170_000]})),
    "digits without end": ("x.json", '{"joints":["a"],"frames":[[[' + "9" * 1_000_000 + "]]]}"),
    "people without end": ("x.json", '[{"people":[' + "{}," * 330_000 + "{}]}]"),
    "key points in objects": ("x.json", "[" + '{"keypoints":[]},' * 58_000 + "{}]"),
}  # fmt: skip


@pytest.mark.parametrize("kind", HUGE)
def test_a_megabyte_that_only_looks_like_motion_takes_neither_time_nor_memory(kind, tmp_path):
    name, data = HUGE[kind]
    data = data() if callable(data) else data
    data = data.encode() if isinstance(data, str) else data
    assert len(data) <= SMALL, len(data)
    path = tmp_path / name
    path.write_bytes(data)
    if name == "x.asf":
        path = tmp_path / "x.amc"
        path.write_text(AMC)
    (tmp_path / "joints.txt").write_text("\n".join(JOINTS))
    begin = time.process_time()
    message = message_of(path)
    assert time.process_time() - begin < SECONDS
    assert message
    assert message.isprintable()
    assert len(message) < 600
    assert "sys." not in message
    tracemalloc.start()
    try:
        assert message_of(path) == message
        assert tracemalloc.get_traced_memory()[1] < MEMORY
    finally:
        tracemalloc.stop()


def message_of(path):
    try:
        read_take(path)
    except MocapidxError as exc:
        return str(exc)
    return ""
