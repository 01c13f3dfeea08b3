import errno
import fcntl
import gc
import os
import re
import resource
import subprocess
import sys
import weakref

import numpy as np
import pytest

from mocapidx.errors import LockedError, ParameterError, StoreError, WriteError
from mocapidx.store import write
from mocapidx.store.manifest import StoreSettings
from mocapidx.store.read import open_store
from mocapidx.store.write import check_writable, writing
from tests.made_store import (
    SETTINGS,
    make_batch,
    make_store,
    names_of,
    read_everything,
    store_bytes,
)

ALL = ["a/jog.amc", "a/walk.amc", "b/kick.amc", "c.bvh", "d \udc80\x1b.bvh"]


def files_in(store):
    return sorted(place.name for place in (store / "segments").iterdir())


def test_a_commit_is_seen_by_the_next_reader(store):
    assert names_of(store) == ALL
    assert files_in(store) == ["000001.h5", "000001.idx", "000002.h5", "000002.idx"]


def test_equal_commits_give_equal_bytes(store, tmp_path):
    assert store_bytes(make_store(tmp_path / "again.store")) == store_bytes(store)


def test_nothing_to_do_writes_nothing(store):
    before = {place: place.stat().st_mtime_ns for place in store.rglob("*") if place.name != "LOCK"}
    with writing(store, command="test", create=SETTINGS) as writer:
        writer.commit(None)
        writer.commit(None, remove=())
    assert before == {place: place.stat().st_mtime_ns for place in before}


def test_a_store_is_there_with_its_first_commit_and_not_before(tmp_path):
    path = tmp_path / "new.store"
    with writing(path, command="test", create=SETTINGS) as writer:
        with pytest.raises(StoreError, match="no store here"):
            open_store(path)
        writer.commit(None)
    assert not path.exists()
    with writing(path, command="test", create=SETTINGS) as writer:
        writer.commit(make_batch({"a": 5}))
        assert names_of(path) == ["a"]


def test_a_new_document_replaces_the_one_of_its_name(store):
    with writing(store, command="test") as writer:
        snapshot = writer.commit(make_batch({"c.bvh": 99, "new": 3}))
        assert [entry.document.frames for entry in snapshot.documents()] == [40, 25, 31, 7, 99, 3]
        assert [entry.file.number for entry in snapshot.documents()] == [1, 1, 1, 2, 3, 3]
    assert names_of(store) == sorted([*ALL, "new"])


def test_a_removed_document_keeps_its_numbers_and_a_file_of_dead_ones_goes(store):
    with writing(store, command="test") as writer:
        snapshot = writer.commit(None, remove=["a/walk.amc"])
        assert [(e.ordinal, e.first) for e in snapshot.documents()][:2] == [(1, 41), (2, 67)]
        writer.commit(None, remove=ALL[3:])
        assert [file.number for file in writer.snapshot.files] == [1]
        with pytest.raises(ParameterError, match=r"no document 'c.bvh' to remove"):
            writer.commit(None, remove=["c.bvh"])
    with writing(store, command="test"):
        assert files_in(store) == ["000001.h5", "000001.idx"]


def test_a_number_is_never_used_twice(store):
    with writing(store, command="test") as writer:
        writer.commit(None, remove=ALL)
        assert writer.snapshot.files == ()
    with writing(store, command="test") as writer:
        writer.commit(make_batch({"a": 5}))
    assert files_in(store) == ["000003.h5", "000003.idx"]


def merged(frames_by_name):
    return make_batch(frames_by_name, seed=5)


FRAMES = dict(zip(("a/walk.amc", "a/jog.amc", "b/kick.amc"), (40, 25, 31), strict=True))


def test_a_merge_keeps_the_replaced_files_until_the_next_commit(store):
    with writing(store, command="test") as writer:
        writer.replace(merged({**FRAMES, ALL[3]: 12, ALL[4]: 7}), writer.snapshot.files)
        assert len(files_in(store)) == 6
        assert names_of(store) == ALL
        writer.commit(make_batch({"new": 3}))
        assert files_in(store) == ["000003.h5", "000003.idx", "000004.h5", "000004.idx"]


def test_a_merge_that_would_lose_a_document_is_refused(store):
    with (
        writing(store, command="test") as writer,
        pytest.raises(ParameterError, match="keep the documents"),
    ):
        writer.replace(merged(FRAMES), writer.snapshot.files)
    assert names_of(store) == ALL


def test_a_reader_beside_merges_sees_one_snapshot_to_its_end(store):
    before = read_everything(store)
    with open_store(store) as reader:
        with writing(store, command="test") as writer:
            writer.replace(merged({**FRAMES, ALL[3]: 12, ALL[4]: 7}), writer.snapshot.files)
            writer.commit(make_batch({"new": 3}))
            writer.commit(None, remove=["new"])
        assert [
            reader.manifest,
            *(
                data
                for file in reader.files
                for data in (
                    *(reader.array(file, name).tobytes() for name in sorted(file.datasets)),
                    reader.index_head(file),
                )
            ),
        ] == before
    assert names_of(store) == ALL


def test_what_a_killed_writer_left_is_removed_and_nothing_else(store):
    before = store_bytes(store)
    debris = ["000003.h5", "000003.idx.4711.tmp", "000001.h5.1.tmp"]
    debris += ["000003.h5.mocapidx.tmp", "damaged-000001.jsonl.mocapidx.tmp"]
    strangers = ["damaged-000001.h5", "notes.txt", "3.h5"]
    for name in debris + strangers:
        (store / "segments" / name).write_bytes(b"x")
    (store / "MANIFEST.99.tmp").write_bytes(b"x")
    with writing(store, command="test"):
        pass
    assert set(store_bytes(store)) == {*before, *(f"segments/{name}" for name in strangers)}


def test_two_writers_never_write_at_a_time(store):
    with (
        writing(store, command="index"),
        pytest.raises(LockedError, match="being written by `index`"),
        writing(store, command="compact"),
    ):
        pass


def test_what_a_query_is_measuring_is_not_swept_away(store):
    with (store / "SIGMA.mocapidx.tmp").open("wb") as held:  # as `save_sigma` does, without LOCK
        fcntl.flock(held, fcntl.LOCK_EX)
        with writing(store, command="test"):
            pass
        assert (store / "SIGMA.mocapidx.tmp").exists()
    with writing(store, command="test"):
        pass
    assert not (store / "SIGMA.mocapidx.tmp").exists()


def test_arrays_may_come_piece_by_piece(store, tmp_path):
    pieces = make_batch({"x": 5, "y": 6})
    arrays = {
        path: iter(values) if isinstance(values, list) else values
        for path, values in pieces.arrays.items()
    }
    whole = {
        path: np.concatenate(values) if isinstance(values, list) else values
        for path, values in pieces.arrays.items()
    }
    for name, given in (("pieces", arrays), ("whole", whole)):
        with writing(tmp_path / name, command="test", create=SETTINGS) as writer:
            writer.commit(write.Batch(pieces.documents, given, pieces.index, 100))
    assert store_bytes(tmp_path / "pieces") == store_bytes(tmp_path / "whole")


@pytest.mark.parametrize(
    "change",
    [
        {"frames/words": np.zeros(4, np.uint64)},
        {"frames/words": np.zeros(5, np.int64)},
        {"frames/poses": [np.zeros((5, 23, 3), np.float32)]},
        {"frames/poses": [np.zeros((4, 24, 3), np.float32)]},
        {"frames/poses": []},
        {"frames/more": np.zeros(5, np.uint64)},
        {"runs/upper/starts": np.zeros(5, np.uint32)},
    ],
)
def test_a_batch_that_contradicts_itself_changes_nothing(store, change):
    before = store_bytes(store)
    batch = make_batch({"x": 5})
    batch = write.Batch(batch.documents, {**batch.arrays, **change}, batch.index, 100)
    with writing(store, command="test") as writer, pytest.raises(ParameterError):
        writer.commit(batch)
    assert store_bytes(store) == before


def test_a_store_without_poses_says_so_when_asked_for_them(tmp_path):
    path = tmp_path / "slim.store"
    slim = StoreSettings(30.0, "tiny", "ab" * 32, "", poses=False)
    with writing(path, command="test", create=slim) as writer:
        writer.commit(make_batch({"a": 5}, poses=False))
    with open_store(path) as snapshot, pytest.raises(StoreError, match="--no-poses"):
        snapshot.array(snapshot.files[0], "frames/poses")


def test_a_store_keeps_its_feature_set_and_rate(store):
    for changes, kind in (
        ({"feature_set_digest": "cd" * 32}, StoreError),
        ({"rate": 60.0}, ParameterError),
    ):
        other = StoreSettings(
            **{name: getattr(SETTINGS, name) for name in SETTINGS.__slots__} | changes
        )
        with (
            pytest.raises(kind, match="another --store"),
            writing(store, command="test", create=other),
        ):
            pass
    with pytest.raises(StoreError, match="no store here"), writing(store / "no", command="test"):
        pass


def test_a_wrong_place_is_refused_before_anything_is_made(tmp_path, store):
    (tmp_path / "file").write_text("")
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("")
    for path, message in (
        (tmp_path / "none" / "takes.store", "there is no folder"),
        (tmp_path / "file", "is a file"),
        (tmp_path / "file" / "takes.store", "there is no folder"),
        (tmp_path / "home", "other things in it"),
    ):
        with pytest.raises(ParameterError, match=message):
            check_writable(path)
    check_writable(store)
    check_writable(tmp_path / "new.store")
    assert sorted(place.name for place in tmp_path.iterdir()) == ["file", "home", "takes.store"]


def test_a_read_only_place_is_a_write_error(store, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_args: False)
    for path in (store, tmp_path / "new.store"):
        with pytest.raises(WriteError, match="may not be written"):
            check_writable(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_folder_without_permission_is_a_write_error(store):
    store.chmod(0o500)
    try:
        with pytest.raises(WriteError), writing(store, command="test"):
            pass
    finally:
        store.chmod(0o700)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO, errno.EDQUOT])
@pytest.mark.parametrize("call", ["write", "fsync", "rename"])
@pytest.mark.parametrize("victim", ["000003.h5", "000003.idx", "MANIFEST"])
def test_a_disk_that_fails_leaves_the_store_as_it_was(store, monkeypatch, number, call, victim):
    before = store_bytes(store)
    opened = {}
    real_open, real = os.open, getattr(os, call)

    def watch(path, *args, **kwargs):
        descriptor = real_open(path, *args, **kwargs)
        opened[descriptor] = os.path.basename(path)
        return descriptor

    def fail(subject, *args):
        if opened.get(subject, os.path.basename(str(subject))).startswith(victim):
            raise OSError(number, os.strerror(number))
        return real(subject, *args)

    with writing(store, command="test") as writer:
        monkeypatch.setattr(os, "open", watch)
        monkeypatch.setattr(os, call, fail)
        with pytest.raises(WriteError, match=r"store unchanged \(5 documents\)"):
            writer.commit(make_batch({"x": 500}))
        monkeypatch.undo()
        assert store_bytes(store) == before
    with writing(store, command="test") as writer:
        writer.commit(make_batch({"x": 500}))
    assert names_of(store) == sorted([*ALL, "x"])


def test_a_folder_that_cannot_be_synced_after_the_commit_is_reported_as_open(store, monkeypatch):
    with writing(store, command="test") as writer:
        real = write.sync_folder

        def fail(folder):
            if folder == store:
                raise OSError(errno.EIO, "Input/output error")
            real(folder)

        monkeypatch.setattr(write, "sync_folder", fail)
        with pytest.raises(WriteError, match="may or may not be saved; running again is safe"):
            writer.commit(make_batch({"x": 5}))
        with pytest.raises(WriteError, match="run again"):
            writer.commit(make_batch({"y": 5}))
        monkeypatch.undo()
    assert names_of(store) == sorted([*ALL, "x"])
    with writing(store, command="test") as writer:
        writer.commit(make_batch({"y": 5}))
    assert names_of(store) == sorted([*ALL, "x", "y"])


SMALL_FILES = """
import resource, sys
from pathlib import Path
from mocapidx.errors import WriteError
from mocapidx.store.write import writing
from tests.made_store import make_batch
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
try:
    with writing(Path(sys.argv[1]), command="index") as writer:
        writer.commit(make_batch({"x": 500}))
except WriteError as exc:
    print(exc)
    sys.exit(exc.exit_code)
"""


@pytest.mark.parametrize("limit", [0, 100, 5000, 100_000])
def test_a_limit_on_the_size_of_files_is_no_crash(store, limit):
    before = store_bytes(store)
    done = subprocess.run(
        [sys.executable, "-c", SMALL_FILES, str(store), str(limit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (7, "")
    over = f"kB, over the limit for the size of a file (ulimit -f: {limit // 1000} kB); store"
    assert re.search(rf"needed about \d+ {re.escape(over)}", done.stdout)
    assert done.stdout.endswith("store unchanged (5 documents)\n")
    assert store_bytes(store) == before
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != limit


def test_a_store_that_can_not_be_locked_for_want_of_room_was_never_made(tmp_path, monkeypatch):
    real_open = os.open

    def refuse(path, *args, **options):
        if str(path).endswith("LOCK"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)
        return real_open(path, *args, **options)

    monkeypatch.setattr(os, "open", refuse)
    with (
        pytest.raises(WriteError, match="no room for one more file"),
        writing(tmp_path / "new.store", command="test", create=SETTINGS),
    ):
        pass
    assert not (tmp_path / "new.store").exists()


def test_what_was_committed_before_a_disk_was_full_is_told_to_stay(store, monkeypatch):
    with writing(store, command="test") as writer:
        writer.commit(make_batch({"y": 5}))
        monkeypatch.setattr(os, "write", full_disk)
        with pytest.raises(WriteError) as caught:
            writer.commit(make_batch({"z": 5}))
    kept = r"needed about \d+ kB, .*; what was saved before stays \(6 documents\); run again to "
    assert re.search(kept, str(caught.value))
    assert names_of(store) == sorted([*ALL, "y"])


def full_disk(*_args):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_damaged_files_are_set_aside_and_kept(store):
    with writing(store, command="verify") as writer:
        moved = writer.set_aside(writer.snapshot.files[:1])
        assert [place.name for place in moved] == ["damaged-000001.h5", "damaged-000001.idx"]
        writer.commit(make_batch({"new": 3}))
    assert names_of(store) == [*ALL[3:], "new"]
    assert "damaged-000001.h5" in files_in(store)


@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("name", ["takes.store", "new.store"])
def test_a_stop_beside_the_last_rename_leaves_a_whole_store(store, monkeypatch, when, name):
    path, real = store.parent / name, os.rename

    def stop(source, target):
        if os.path.basename(target) != "MANIFEST":
            real(source, target)
        elif when == "before":
            raise KeyboardInterrupt
        else:
            real(source, target)
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "rename", stop)
    with (
        pytest.raises(KeyboardInterrupt),
        writing(path, command="test", create=SETTINGS) as writer,
    ):
        writer.commit(make_batch({"x": 5}))
    monkeypatch.undo()
    old = ALL if path == store else []
    if old or when == "after":
        read_everything(path)
        assert names_of(path) == sorted([*old, "x"] if when == "after" else old)
    else:
        assert not path.exists()


def test_what_goes_wrong_in_the_body_is_no_trouble_of_the_store(store):
    with pytest.raises(FileNotFoundError), writing(store, command="test"):
        raise FileNotFoundError("walk.amc")


def test_a_long_run_keeps_one_manifest_not_one_for_each_commit(tmp_path):
    with writing(tmp_path / "takes.store", command="test", create=SETTINGS) as writer:
        before = [weakref.ref(writer.commit(make_batch({f"{n}": 5}))) for n in range(5)]
        gc.collect()
        assert [snapshot() is not None for snapshot in before] == [False] * 4 + [True]
        assert before[-1]() is writer.snapshot
