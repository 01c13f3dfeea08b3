"""NumPy's files: what is no array, too much, or not what it says, is refused in one line."""

import contextlib
import io
import zipfile

import numpy as np
import pytest

from mocapidx.errors import FormatError
from mocapidx.formats.arrays import read_array, read_arrays
from mocapidx.formats.text import Limits


def npy(array, **options):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, **options)
    return stream.getvalue()


def archive(path, members, method=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", method) as file:
        for name, data in members:
            file.writestr(name, data)
    return path


@pytest.mark.parametrize(
    "array",
    [
        np.arange(12.0).reshape(4, 3),
        np.asfortranarray(np.arange(12, dtype="f4").reshape(4, 3)),
        np.arange(12, dtype=">f8").reshape(4, 3),
        np.arange(12, dtype="f2").reshape(4, 3),
        np.arange(12, dtype="i2").reshape(4, 3),
        np.array(["root", "lhip"]),
        np.zeros((0, 3)),
        np.float64(120.0),
    ],
)
def test_arrays_are_read_whatever_their_layout(tmp_path, array):
    array = np.asarray(array)
    path = archive(tmp_path / "x.npz", [("a.npy", npy(array)), ("../../evil.npy", b"")])
    np.testing.assert_array_equal(read_arrays(path, Limits(), {"a"})["a"], array)
    (tmp_path / "x.npy").write_bytes(npy(array))
    np.testing.assert_array_equal(read_array(tmp_path / "x.npy", Limits()), array)


def lying_header(shape):
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    head = head.ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (npy(np.array([{}], dtype=object), allow_pickle=True), "holds object"),
        (lying_header("(549755813888,)"), "is it cut off"),
        (lying_header("(-1,)"), "is it cut off"),
        (lying_header("(" + "(" * 50), "not an array"),
        (lying_header("(1, 'x')"), "not an array"),
        (b"\x93NUMPY\x07\x00", "not an array"),
        (b"pickle", "not an array"),
        (b"", "not an array"),
        (npy(np.zeros(3))[:-1], "is it cut off"),
        (npy(np.zeros(3, dtype="c16")), "holds complex128"),
        (npy(np.zeros(3, dtype="M8[s]")), "holds datetime"),
    ],
)
def test_what_is_no_array_is_told_in_one_line_without_advice_on_pickles(tmp_path, data, message):
    path = archive(tmp_path / "x.npz", [("a.npy", data)])
    with pytest.raises(FormatError, match=message) as caught:
        read_arrays(path, Limits(), {"a"})
    assert "\n" not in str(caught.value)
    assert "pickle" not in str(caught.value)


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path):
    data = npy(np.zeros(1 << 22))
    path = archive(tmp_path / "x.npz", [("a.npy", data)], zipfile.ZIP_DEFLATED)
    assert path.stat().st_size < 64_000
    with pytest.raises(FormatError, match="would become 33,554,"):
        read_arrays(path, Limits(), {"a"})


@pytest.mark.parametrize("values", [np.zeros(1 << 22, "u1"), np.zeros(1 << 20, "S1")])
def test_numbers_and_names_count_as_what_they_become(tmp_path, values):
    path = archive(tmp_path / "x.npz", [("a.npy", npy(values))], zipfile.ZIP_DEFLATED)
    with pytest.raises(FormatError, match="no motion is packed so tightly"):
        read_arrays(path, Limits(), {"a"})
    path = archive(tmp_path / "y.npz", [("a.npy", npy(values[: 1 << 16]))], zipfile.ZIP_STORED)
    assert read_arrays(path, Limits(), {"a"})["a"].shape == (1 << 16,)


def test_a_bomb_that_lies_about_its_size_is_refused(tmp_path):
    path = archive(tmp_path / "x.npz", [("a.npy", npy(np.zeros(1000)))], zipfile.ZIP_DEFLATED)
    octets = path.read_bytes()
    size = (8128).to_bytes(4, "little")
    assert octets.count(size) == 2
    path.write_bytes(octets.replace(size, (200).to_bytes(4, "little")))
    with pytest.raises(FormatError):
        read_arrays(path, Limits(), {"a"})


def test_members_that_stand_twice_are_refused(tmp_path):
    path = tmp_path / "x.npz"
    with pytest.warns(UserWarning, match="Duplicate"):
        archive(path, [("a.npy", npy(np.zeros(2))), ("a.npy", npy(np.ones(2)))])
    with pytest.raises(FormatError, match="'a' twice"):
        read_arrays(path, Limits(), {"a"})


def test_damaged_archives_are_refused(tmp_path):
    path = archive(tmp_path / "x.npz", [("a.npy", npy(np.arange(100.0)))], zipfile.ZIP_DEFLATED)
    whole = path.read_bytes()
    for cut in range(0, len(whole), 7):
        path.write_bytes(whole[:cut])
        with pytest.raises(FormatError) as caught:
            read_arrays(path, Limits(), {"a"})
        assert "\n" not in str(caught.value)
    for place in range(0, len(whole), 3):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        with contextlib.suppress(FormatError):
            read_arrays(path, Limits(), {"a"})
