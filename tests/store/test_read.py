import gc
import os
import random
import subprocess
import sys

import numpy as np
import pytest

from mocapidx.errors import ParameterError, StoreError
from mocapidx.store import read, schema
from mocapidx.store.read import Snapshot, open_store
from mocapidx.store.write import writing
from tests.made_store import SETTINGS, make_batch, read_everything

LARGE = {"x": 3000, "y": 5000, "z": 1}


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """A store whose poses take more than two blocks, and what went into it."""
    path = tmp_path_factory.mktemp("large") / "takes.store"
    batch = make_batch(LARGE)
    with writing(path, command="test", create=SETTINGS) as writer:
        writer.commit(batch)
    return path, batch


@pytest.mark.parametrize("path", sorted(set(schema.COLUMNS) - {"meta"}))
def test_any_rows_come_back_as_they_were_written(large, path):
    store, batch = large
    expected = batch.arrays[path]
    expected = np.concatenate(expected) if isinstance(expected, list) else expected
    border = schema.BLOCK // schema.COLUMNS[path].row_bytes
    with open_store(store) as snapshot:
        (file,) = snapshot.files
        for start, stop in (
            (0, None),
            (3000, 8000),
            (0, 0),
            (8001, 8001),
            (8000, 8001),
            (0, 1),
            *((min(border, 8000) + i, min(border, 8000) + i + 1) for i in (-1, 0)),
        ):
            got = snapshot.array(file, path, start, stop)
            assert got.dtype == expected.dtype
            assert not got.flags.writeable
            np.testing.assert_array_equal(got, expected[start:stop])
        rows = len(expected)
        for start, stop in ((-1, 2), (2, 1), (0, rows + 1), (rows + 1, None)):
            with pytest.raises(ParameterError):
                snapshot.array(file, path, start, stop)


def test_a_part_of_a_dataset_costs_its_blocks_only(large, monkeypatch):
    store, _ = large
    sizes = []
    real = os.pread
    with open_store(store) as snapshot:
        monkeypatch.setattr(os, "pread", lambda fd, n, at: (sizes.append(n), real(fd, n, at))[1])
        snapshot.array(snapshot.files[0], "frames/poses", 8000, 8001)
    assert sum(sizes) <= schema.BLOCK


def test_ranges_of_an_index_come_back_as_they_were_written(large):
    store, batch = large
    with open_store(store) as snapshot:
        (file,) = snapshot.files
        assert snapshot.index_head(file) == batch.index[:100]
        for offset, size in ((0, 300), (0, 100), (50, 100), (99, 1), (100, 1), (250, 50), (300, 0)):
            assert snapshot.index_bytes(file, offset, size) == batch.index[offset : offset + size]
        for offset, size in ((-1, 5), (299, 2), (0, -1), (10**20, 1)):
            with pytest.raises(StoreError, match="damaged"):
                snapshot.index_bytes(file, offset, size)


def test_a_reader_never_loads_hdf5(large):
    program = (
        "import sys; from pathlib import Path; from mocapidx.store.read import open_store\n"
        "s = open_store(Path(sys.argv[1])); s.array(s.files[0], 'frames/words'); s.close()\n"
        "sys.exit('h5py' in sys.modules)"
    )
    assert (
        subprocess.run([sys.executable, "-c", program, str(large[0])], check=False).returncode == 0
    )


def test_no_store_is_said_in_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path, tmp_path / "none", tmp_path / "file"):
        with pytest.raises(StoreError) as caught:
            open_store(path)
        assert str(caught.value) == f"{path}: no store here; make one with 'mocapidx index'"


@pytest.mark.parametrize("seed", range(150))
def test_a_single_changed_bit_is_an_error_or_changes_nothing(store, seed):
    expected = read_everything(store)
    chance = random.Random(seed)
    places = sorted(place for place in store.rglob("*") if place.is_file() and place.name != "LOCK")
    victim = places[seed % len(places)]
    data = bytearray(victim.read_bytes())
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    victim.write_bytes(data)
    try:
        found = read_everything(store)
    except StoreError as exc:
        message = str(exc)
        assert message.startswith(f"{victim}: damaged (")
        assert "\n" not in message
    else:
        assert found == expected


@pytest.mark.parametrize("name", ["000001.h5", "000002.idx"])
def test_a_file_that_is_not_what_it_was_is_named_with_advice(store, name):
    victim = store / "segments" / name
    data = victim.read_bytes()
    elsewhere = store.parent / "elsewhere"
    elsewhere.write_bytes(data)

    def expect(what):
        with pytest.raises(StoreError) as caught:
            open_store(store)
        assert str(caught.value).startswith(f"{victim}: damaged ({what}")
        assert str(caught.value).endswith(f"; run 'mocapidx verify {store} --repair'")

    victim.write_bytes(data[:-1])
    expect(f"{len(data) - 1} bytes, expected {len(data)}")
    victim.write_bytes(data + b"x")
    expect(f"{len(data) + 1} bytes, expected {len(data)}")
    victim.unlink()
    expect("no such file or directory")
    victim.symlink_to(elsewhere)
    expect("too many levels of symbolic links")
    victim.unlink()
    os.mkfifo(victim)
    expect("not a regular file")
    victim.unlink()
    victim.mkdir()
    expect("not a regular file")


def test_a_folder_of_segments_that_leads_elsewhere_is_not_followed(store):
    (store / "segments").rename(store.parent / "elsewhere")
    (store / "segments").symlink_to(store.parent / "elsewhere")
    with pytest.raises(StoreError, match="symbolic link"):
        open_store(store)


def test_a_manifest_must_be_a_file_of_bounded_size(store, monkeypatch):
    monkeypatch.setattr(schema, "MANIFEST_LIMIT", 1000)
    with pytest.raises(StoreError, match="a manifest at most 1000"):
        open_store(store)
    (store / "MANIFEST").unlink()
    os.mkfifo(store / "MANIFEST")
    with pytest.raises(StoreError, match="not a regular file"):
        open_store(store)


@pytest.mark.parametrize("late", range(1, 7))
def test_a_reader_that_comes_too_late_for_a_file_reads_the_manifest_again(store, monkeypatch, late):
    """Between manifest and files, a writer removes what the manifest names, `late` times."""
    real, times = read.read_manifest, 0

    def slow(path):
        nonlocal times
        manifest = real(path)
        times += 1
        if times <= late:
            with writing(store, command="test") as writer:
                writer.commit(make_batch({"a": times}), remove={e.name for e in writer.documents()})
                writer.commit(make_batch({"b": 1}))
                writer.commit(None, remove=["b"])
        return manifest

    monkeypatch.setattr(read, "read_manifest", slow)
    if late >= read.ATTEMPTS:
        with pytest.raises(StoreError, match="damaged"):
            open_store(store)
    else:
        with open_store(store) as snapshot:
            assert [e.document.frames for e in snapshot.documents()] == [late]


def test_a_snapshot_that_a_stop_kept_from_being_made_goes_without_a_word():
    Snapshot.__new__(Snapshot)
    gc.collect()  # whatever it says in its end would fail here


def test_a_closed_snapshot_and_a_forgotten_one_hold_no_files(store):
    def held():
        return len(os.listdir("/proc/self/fd"))

    before = held()
    with open_store(store):
        assert held() == before + 4
    assert held() == before
    open_store(store)
    assert held() == before
