import errno
import os
import shutil

import numpy as np
import pytest

from mocapidx.errors import StoreError
from mocapidx.features.featureset import load_feature_set
from mocapidx.store import aside
from mocapidx.store.manifest import StoreSettings
from mocapidx.store.read import open_store
from mocapidx.store.write import Batch, writing
from mocapidx.tasks import verify as subject
from mocapidx.tasks.batch import make_batch
from mocapidx.tasks.info import store_info
from mocapidx.tasks.verify import verify_store
from tests.made_store import make_document, names_of, read_everything, store_bytes

F39 = load_feature_set("f39")
SETTINGS = StoreSettings(30.0, F39.name, F39.digest, F39.text)


def batch_of(frames_by_name, seed=0):
    """Documents of random words that hold for some frames each."""
    random = np.random.default_rng(seed)
    documents = [make_document(name, frames) for name, frames in frames_by_name.items()]
    words = [
        np.repeat(random.integers(0, 1 << 39, frames, np.uint64), 3)[:frames]
        for frames in frames_by_name.values()
    ]
    poses = [random.normal(size=(len(w), 24, 3)).astype(np.float32) for w in words]
    return make_batch(documents, words, lambda: iter(poses), F39)


@pytest.fixture
def store(tmp_path):
    path = tmp_path / "takes.store"
    with writing(path, command="test", create=SETTINGS) as writer:
        writer.commit(batch_of({"a": 90, "b": 40}))
        writer.commit(batch_of({"c": 30}, seed=1))
    return path


def flip(path, place=-1):
    data = bytearray(path.read_bytes())
    data[place] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("quick", [False, True])
def test_a_sound_store_is_found_sound_and_left_alone(store, quick):
    before = store_bytes(store)
    steps = []
    report = verify_store(
        store, quick=quick, progress=lambda done, total: steps.append((done, total))
    )
    assert report.problems == ()
    assert (report.documents, report.files) == (3, 2)
    assert report.size == sum(len(data) for name, data in before.items() if name != "MANIFEST")
    assert verify_store(store, quick=quick, repair=True).problems == ()
    assert store_bytes(store) == before
    assert steps == sorted(steps)
    assert steps[-1] == (4, 4)


@pytest.mark.parametrize("quick", [False, True])
def test_a_damaged_index_is_found_and_built_again(store, quick):
    expected = read_everything(store)[1:]
    flip(store / "segments" / "000001.idx")
    (line,) = verify_store(store, quick=quick).problems
    assert line == f"{store}/segments/000001.idx: it does not match its digest"
    report = verify_store(store, quick=quick, repair=True)
    assert [path.name for path in report.rebuilt] == ["000003.idx"]
    assert (report.set_aside, report.lost) == ((), ())
    assert verify_store(store).problems == ()
    assert names_of(store) == ["a", "b", "c"]
    assert sorted(map(repr, read_everything(store)[1:])) == sorted(map(repr, expected))


def test_a_damaged_hdf5_file_is_set_aside_and_its_sources_are_named(store):
    flip(store / "segments" / "000001.h5")
    assert len(verify_store(store).problems) == 1
    report = verify_store(store, repair=True)
    assert [str(path) for path in report.lost] == ["/takes/a", "/takes/b"]
    assert [path.name for path in report.set_aside] == ["damaged-000001.h5", "damaged-000001.idx"]
    assert all(path.exists() for path in report.set_aside)
    assert names_of(store) == ["c"]
    assert verify_store(store).problems == ()


def test_missing_files_are_found_and_repaired(store):
    (store / "segments" / "000001.idx").unlink()
    (store / "segments" / "000002.h5").unlink()
    assert len(verify_store(store).problems) == 2
    report = verify_store(store, repair=True)
    assert len(report.rebuilt) == 1
    assert [str(path) for path in report.lost] == ["/takes/c"]
    assert names_of(store) == ["a", "b"]
    assert verify_store(store).problems == ()


def test_lists_that_are_not_those_of_the_words_are_found_though_every_digest_is_right(tmp_path):
    honest, other = batch_of({"a": 90}), batch_of({"a": 90}, seed=1)
    store = tmp_path / "takes.store"
    with writing(store, command="test", create=SETTINGS) as writer:
        writer.commit(Batch(honest.documents, honest.arrays, other.index, other.index_head_size))
    (line,) = verify_store(store).problems
    assert line.endswith("000001.idx: its lists are not those of the runs")
    assert verify_store(store, quick=True).problems == ()
    verify_store(store, repair=True)
    assert verify_store(store).problems == ()


def test_runs_that_are_not_those_of_the_words_are_found_though_every_digest_is_right(tmp_path):
    honest = batch_of({"a": 90})
    words = np.asarray(honest.arrays["frames/words"]) ^ np.uint64(1)
    words[0] ^= np.uint64(3)
    store = tmp_path / "takes.store"
    with writing(store, command="test", create=SETTINGS) as writer:
        arrays = {**honest.arrays, "frames/words": words}
        writer.commit(Batch(honest.documents, arrays, honest.index, honest.index_head_size))
    lines = verify_store(store).problems
    assert any("does not follow from frames/words" in line for line in lines)
    assert [str(path) for path in verify_store(store, repair=True).lost] == ["/takes/a"]


def test_a_store_beside_a_merge_is_verified_again(store, monkeypatch):
    real, calls = subject._problems, []

    def merge_first(snapshot, *args):
        if not calls:
            with writing(store, command="compact") as writer:
                writer.commit(batch_of({"a": 91, "b": 41, "c": 31}))
                writer.commit(batch_of({"d": 5}))
        calls.append(1)
        return real(snapshot, *args)

    monkeypatch.setattr(subject, "_problems", merge_first)
    assert verify_store(store).problems == ()
    assert len(calls) == 2


def test_a_damaged_manifest_is_an_error(store):
    flip(store / "MANIFEST")
    for repair in (False, True):
        with pytest.raises(StoreError, match="index the sources again"):
            verify_store(store, repair=repair)


def test_a_feature_set_that_is_not_the_one_of_its_digest_is_an_error(tmp_path):
    for name, text in (("other", F39.text), ("broken", "[["), ("gone", "")):
        settings = StoreSettings(30.0, F39.name, "ab" * 32, text)
        with writing(tmp_path / name, command="test", create=settings) as writer:
            writer.commit(batch_of({"a": 9}))
        with pytest.raises(StoreError, match="index the sources into a new store"):
            verify_store(tmp_path / name)
        assert verify_store(tmp_path / name, quick=True).problems == ()


def test_what_an_earlier_repair_has_lost_is_named_until_it_is_indexed_again(store, mocapidx):
    flip(store / "segments" / "000001.h5")
    verify_store(store, repair=True)
    for arguments in ([store], [store, "--repair"]):
        done = mocapidx("verify", *arguments)
        assert (done.returncode, done.stdout) == (4, "/takes/a\n/takes/b\n")
        assert "2 documents lost in an earlier repair; run 'mocapidx index' again as" in done.stderr
    for listed in (store / "segments").glob("damaged-*"):
        listed.unlink()
    done = mocapidx("verify", store)
    assert (done.returncode, done.stdout) == (0, "")


def test_a_store_without_its_folder_of_segments_is_mended(store):
    shutil.rmtree(store / "segments")
    report = verify_store(store, repair=True)
    assert [str(path) for path in report.lost] == ["/takes/a", "/takes/b", "/takes/c"]
    assert names_of(store) == []
    assert verify_store(store).problems == ()
    assert len(verify_store(store).lost) == 3


def test_a_link_in_the_place_of_a_list_is_not_followed(store, tmp_path):
    (tmp_path / "precious").write_text("mine")
    (store / "segments/damaged-000001.jsonl").symlink_to(tmp_path / "precious")
    flip(store / "segments" / "000001.h5")
    report = verify_store(store, repair=True)
    assert [str(path) for path in report.lost] == ["/takes/a", "/takes/b"]
    assert (tmp_path / "precious").read_text() == "mine"
    assert [str(path) for path in verify_store(store).lost] == ["/takes/a", "/takes/b"]


def test_what_was_lost_is_told_where_its_list_can_not_be_read(store, monkeypatch):
    flip(store / "segments" / "000001.h5")
    monkeypatch.setattr(aside, "_read", lambda _: b"not a list")
    report = verify_store(store, repair=True)
    assert [str(path) for path in report.lost] == ["/takes/a", "/takes/b"]


@pytest.mark.parametrize("number", [errno.EACCES, errno.EIO, errno.ESTALE, errno.EMFILE])
def test_what_the_system_refuses_to_read_is_not_damaged(store, monkeypatch, number):
    before, opened = store_bytes(store), os.open

    def refusing(path, flags, *mode, **options):
        if str(path).endswith("000002.h5"):
            raise OSError(number, os.strerror(number), str(path))
        return opened(path, flags, *mode, **options)

    with monkeypatch.context() as patched:
        patched.setattr(os, "open", refusing)
        for repair in (False, True):
            with pytest.raises(StoreError, match=r"000002\.h5: can't be read \(") as told:
                verify_store(store, repair=repair)
            assert "--repair" not in str(told.value)
        with pytest.raises(StoreError, match=r"000002\.h5: can't be read \("):
            open_store(store)
    assert store_bytes(store) == before


def test_what_a_repair_will_cost_is_told_before(store, mocapidx):
    flip(store / "segments" / "000001.h5")
    done = mocapidx("verify", store)
    assert done.returncode == 4
    assert "and takes out 2 documents of damaged files, to be indexed again" in done.stderr
    assert "lost_in_repairs" not in mocapidx("info", store).stdout
    verify_store(store, repair=True)
    assert store_info(store)["lost_in_repairs"] == 2
