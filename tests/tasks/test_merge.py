"""Stores that independent jobs built, joined: found is what one store would find."""

import errno
import os

import pytest

import mocapidx
from mocapidx.errors import ParameterError, StoreError, WriteError
from mocapidx.store.read import open_store
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.merge import merge_stores
from mocapidx.tasks.verify import verify_store
from tests.made_store import store_bytes


@pytest.fixture(scope="module")
def parts(fixtures_dir, tmp_path_factory):
    """Two halves of the clips as stores of their own, and all of them in one."""
    folder = tmp_path_factory.mktemp("parts")
    root = fixtures_dir / "clips"
    options = IndexOptions(root=root, jobs=1)
    classes = sorted(path for path in root.iterdir() if path.is_dir())
    index_files(classes[::2], folder / "one.store", options)
    index_files(classes[1::2], folder / "two.store", options)
    index_files(classes, folder / "whole.store", options)
    return folder


def found(store, clip):
    return mocapidx.query_store(store, str(clip), select="F17,F20").hits


def names(store):
    with open_store(store) as opened:
        return sorted(each.document.name for each in opened.documents())


def test_a_merged_store_finds_what_one_store_finds(parts, fixtures_dir, tmp_path):
    merged = merge_stores([parts / "one.store", parts / "two.store"], tmp_path / "m.store")
    assert merged.documents == merged.added == len(names(parts / "whole.store"))
    assert merged.files == 2
    assert names(tmp_path / "m.store") == names(parts / "whole.store")
    clip = sorted(fixtures_dir.glob("clips/kickFrontRight/*.amc"))[0]
    assert found(tmp_path / "m.store", clip) == found(parts / "whole.store", clip)
    assert verify_store(tmp_path / "m.store").problems == ()


def test_files_are_linked_and_the_parts_stay_as_they_are(parts, tmp_path):
    before = store_bytes(parts / "one.store")
    merge_stores([parts / "one.store"], tmp_path / "m.store")
    assert store_bytes(parts / "one.store") == before
    (linked,) = (tmp_path / "m.store" / "segments").glob("*.h5")
    assert os.path.samefile(linked, next((parts / "one.store" / "segments").glob("*.h5")))


def test_where_there_are_no_links_files_are_copied_and_checked(parts, tmp_path, monkeypatch):
    def no_links(*_, **__):
        raise OSError(errno.EXDEV, os.strerror(errno.EXDEV))

    monkeypatch.setattr(os, "link", no_links)
    merge_stores([parts / "one.store"], tmp_path / "m.store")
    (copied,) = (tmp_path / "m.store" / "segments").glob("*.h5")
    assert copied.stat().st_nlink == 1
    assert names(tmp_path / "m.store") == names(parts / "one.store")
    assert verify_store(tmp_path / "m.store").problems == ()


def test_merging_again_adds_nothing(parts, tmp_path):
    merge_stores([parts / "one.store", parts / "one.store"], tmp_path / "m.store")
    before = store_bytes(tmp_path / "m.store")
    again = merge_stores([parts / "one.store"], tmp_path / "m.store")
    assert again.added == 0
    assert store_bytes(tmp_path / "m.store") == before
    more = merge_stores([parts / "whole.store"], tmp_path / "m.store")
    assert more.added == len(names(parts / "two.store"))
    assert names(tmp_path / "m.store") == names(parts / "whole.store")


def test_a_failure_half_way_leaves_the_store_as_it_was(parts, tmp_path, monkeypatch):
    merge_stores([parts / "one.store"], tmp_path / "m.store")
    before = store_bytes(tmp_path / "m.store")
    link, calls = os.link, []

    def full(*arguments, **options):
        calls.append(arguments)
        if len(calls) == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        link(*arguments, **options)

    monkeypatch.setattr(os, "link", full)
    with pytest.raises(
        WriteError, match=r"no space left on .*needed about \d+ kB.*store unchanged"
    ):
        merge_stores([parts / "two.store"], tmp_path / "m.store")
    assert store_bytes(tmp_path / "m.store") == before


def test_what_can_not_be_joined_is_told(parts, fixtures_dir, tmp_path):
    one = parts / "one.store"
    with pytest.raises(ParameterError, match="is one of the stores to merge"):
        merge_stores([one], one)
    walks = sorted(fixtures_dir.glob("clips/walk/*.amc"))
    root = fixtures_dir / "clips"
    index_files(walks[:1], tmp_path / "rate.store", IndexOptions(rate=60.0, root=root))
    with pytest.raises(ParameterError, match="60 Hz, not 30"):
        merge_stores([one, tmp_path / "rate.store"], tmp_path / "m.store")
    index_files(walks[:1], tmp_path / "set.store", IndexOptions(feature_set="f31", root=root))
    with pytest.raises(StoreError, match="its feature set is f31"):
        merge_stores([one, tmp_path / "set.store"], tmp_path / "m.store")
    index_files(walks[:1], tmp_path / "bare.store", IndexOptions(poses=False, root=root))
    with pytest.raises(ParameterError, match="only one of them keeps poses"):
        merge_stores([one, tmp_path / "bare.store"], tmp_path / "m.store")
    assert not (tmp_path / "m.store").exists()


def test_two_documents_of_one_name_are_an_error_that_shows_both(fixtures_dir, tmp_path):
    for number, clip in enumerate(sorted(fixtures_dir.glob("clips/walk/*.amc"))[:2]):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "a.amc").write_bytes(clip.read_bytes())
        skeleton = next(fixtures_dir.glob(f"clips/{clip.name[:3]}*.asf"))
        (folder / "a.asf").write_bytes(skeleton.read_bytes())
        index_files([folder], tmp_path / f"{number}.store", IndexOptions(jobs=1))
    with pytest.raises(ParameterError, match=r"0\.store hold different documents named 'a\.amc'"):
        merge_stores([tmp_path / "0.store", tmp_path / "1.store"], tmp_path / "m.store")
    assert not (tmp_path / "m.store").exists()
