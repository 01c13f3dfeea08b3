import json
import os
import struct

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.errors import ParameterError, StoreError, WriteError
from mocapidx.store import sealed as sealed_files
from mocapidx.store.manifest import file_digest
from mocapidx.store.sealed import SEAL
from mocapidx.store.templates import TEMPLATES, read_templates, write_templates

META = {"what": "two matrices", "odd name": "\udc80\x1b"}


@pytest.fixture
def matrices():
    random = np.random.default_rng(0)
    return [random.random((7, 39)), random.random((1, 2))]


@pytest.fixture
def path(tmp_path, matrices):
    write_templates(tmp_path / "t.h5", META, matrices)
    return tmp_path / "t.h5"


def sealed(image, table):
    """A file with a right digest, whatever it says."""
    text = table if isinstance(table, bytes) else json.dumps(table).encode()
    body = image + text + struct.pack("<Q", len(text))
    return body + file_digest(body).digest() + TEMPLATES.magic


def parts(data):
    size = SEAL.unpack_from(data, len(data) - SEAL.size)[0]
    end = len(data) - SEAL.size
    return data[: end - size], json.loads(data[end - size : end])


def test_what_is_written_is_read(path, matrices):
    meta, read = read_templates(path)
    assert meta == META
    for one, other in zip(read, matrices, strict=True):
        np.testing.assert_array_equal(one, other)


def test_other_hdf5_tools_open_it(path, matrices):
    with h5py.File(path, "r") as file:
        np.testing.assert_array_equal(file["matrices/0000"], matrices[0])
        assert json.loads(file["meta"][()].tobytes()) == META
        assert not file.attrs


def test_equal_templates_give_equal_bytes(path, tmp_path, matrices):
    write_templates(tmp_path / "again.h5", META, matrices)
    assert (tmp_path / "again.h5").read_bytes() == path.read_bytes()


def test_every_changed_byte_is_noticed(path):
    data = path.read_bytes()
    random = np.random.default_rng(1)
    for place in [*random.integers(0, len(data), 300), *range(len(data) - 60, len(data))]:
        damaged = bytearray(data)
        damaged[place] ^= 1 << int(random.integers(8))
        path.write_bytes(damaged)
        with pytest.raises(StoreError, match=r"t\.h5"):
            read_templates(path)


@pytest.mark.parametrize("kept", [0, 10, 55, 1000, -1])
def test_a_file_cut_off_is_noticed(path, kept):
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(StoreError, match="not a template file"):
        read_templates(path)


@given(data=st.binary(max_size=300))
def test_bytes_behind_a_right_digest_never_do_harm(data, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "hostile.h5"
    path.write_bytes(sealed(b"image", data))
    with pytest.raises(StoreError, match="damaged"):
        read_templates(path)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"dtype": "|O8"}, "wrong type"),
        ({"dtype": None}, "wrong type"),
        ({"shape": [7]}, "wrong shape"),
        ({"shape": [-7, -39]}, "wrong shape"),
        ({"shape": [0, 39]}, "wrong shape"),
        ({"shape": [7.0, 39]}, "wrong shape"),
        ({"shape": [1 << 28, 1 << 28]}, "within the file"),
        ({"shape": [10**30, 39]}, "wrong shape"),
        ({"offset": -8}, "within the file"),
        ({"offset": 10**40}, "within the file"),
        ({"offset": None}, "wrong shape"),
    ],
)
def test_a_table_that_lies_is_refused_by_name(path, changes, complaint):
    image, table = parts(path.read_bytes())
    table["datasets"]["matrices/0000"].update(changes)
    path.write_bytes(sealed(image, table))
    with pytest.raises(StoreError, match=complaint):
        read_templates(path)


@pytest.mark.parametrize(
    ("table", "complaint"),
    [
        ({}, "none of a template file"),
        ([], "none of a template file"),
        ({"format": "mocapidx-templates", "version": 2}, "version is 2.*upgrade"),
        ({"format": "mocapidx-templates", "version": 1}, "no datasets"),
        ({"format": "mocapidx-templates", "version": 1, "datasets": {"x": 1}}, "meta is missing"),
        (b"[" * 100_000, "not JSON"),
        (b"1" * 5_000, "not JSON"),
        (b'{"format": NaN}', "not JSON"),
    ],
)
def test_a_table_of_another_kind_is_refused(path, table, complaint):
    path.write_bytes(sealed(b"", table))
    with pytest.raises(StoreError, match=complaint):
        read_templates(path)


def test_a_table_larger_than_the_file_is_refused(path):
    body = b"{}" + struct.pack("<Q", 1 << 62)
    path.write_bytes(body + file_digest(body).digest() + TEMPLATES.magic)
    with pytest.raises(StoreError, match="does not lie within"):
        read_templates(path)


def test_what_is_no_file_is_refused_in_one_line(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name, complaint in (
        ("none", "no template file here"),
        (".", "is a folder"),
        ("pipe", "read"),
    ):
        with pytest.raises(StoreError, match=complaint) as caught:
            read_templates(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_a_link_to_a_template_file_is_followed(path, tmp_path):
    (tmp_path / "link").symlink_to(path)
    assert read_templates(tmp_path / "link")[0] == META


def test_a_file_larger_than_the_limit_is_not_read(path, monkeypatch):
    monkeypatch.setattr(sealed_files, "SIZE_LIMIT", 1000)
    with pytest.raises(StoreError, match="at most 1000"):
        read_templates(path)


def test_too_much_for_one_file_is_refused_before_it_is_written(path, matrices, monkeypatch):
    before = path.read_bytes()
    monkeypatch.setattr(sealed_files, "MOST_DATASETS", 1)
    with pytest.raises(ParameterError, match="too many for one file"):
        write_templates(path, META, matrices)
    assert path.read_bytes() == before


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_that_may_not_be_written_is_an_error_of_writing(tmp_path, matrices):
    tmp_path.chmod(0o500)
    with pytest.raises(WriteError):
        write_templates(tmp_path / "t.h5", META, matrices)
