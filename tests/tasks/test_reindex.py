import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from mocapidx.errors import ParameterError, StoreError
from mocapidx.store.read import open_store
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.query import query_store
from mocapidx.tasks.reindex import reindex_store
from mocapidx.tasks.stored import kept_rest
from tests.made_store import make_store

OWN = """
name = "hands"
source = "made up for a test"
[[feature]]
id = "H1"
part = "upper"
kind = "nplane"
joints = ["chest", "neck", "neck", "rwrist"]
unit = "sw"
on = 0.2
off = 0.0
[[feature]]
id = "H2"
mirror_of = "H1"
"""


@pytest.fixture(scope="module")
def motions(fixtures_dir):
    return [fixtures_dir / "clips" / "squat", fixtures_dir / "bvh"]


@pytest.fixture(scope="module")
def old(motions, tmp_path_factory):
    store = tmp_path_factory.mktemp("stores") / "f39.store"
    index_files(motions, store)
    return store


def contents(path):
    """Words, poses and records of every document."""
    with open_store(path) as store:
        found = {}
        for placed in store.documents():
            rows = (placed.frame_offset, placed.frame_offset + placed.document.frames)
            arrays = [store.array(placed.file, f"frames/{n}", *rows) for n in ("words", "poses")]
            found[placed.document.name] = (placed.document, *map(np.array, arrays))
        return found


@pytest.mark.parametrize("name", ["f31", "own"])
def test_reindexing_gives_what_indexing_the_sources_gives(old, motions, tmp_path, name):
    if name == "own":
        name = str(tmp_path / "hands.toml")
        Path(name).write_text(OWN)
    summary = reindex_store(old, tmp_path / "new.store", name)
    index_files(motions, tmp_path / "fresh.store", IndexOptions(feature_set=name))
    again, fresh = contents(tmp_path / "new.store"), contents(tmp_path / "fresh.store")
    assert again.keys() == fresh.keys()
    assert summary.written == len(fresh)
    for key in fresh:
        assert again[key][0] == fresh[key][0]
        np.testing.assert_array_equal(again[key][1], fresh[key][1])
        np.testing.assert_array_equal(again[key][2], fresh[key][2])


def test_a_second_run_has_nothing_to_do_and_neither_has_index(old, motions, tmp_path):
    reindex_store(old, tmp_path / "new.store", "f31")
    summary = reindex_store(old, tmp_path / "new.store", "f31")
    assert (summary.written, summary.frames) == (0, 0)
    assert summary.unchanged == len(contents(old))
    indexed = index_files(motions, tmp_path / "new.store", IndexOptions(feature_set="f31"))
    assert (indexed.added, indexed.changed) == (0, 0)


def test_only_what_changed_is_done_again(motions, tmp_path):
    clip = sorted(motions[0].glob("*.amc"))[0]
    takes = tmp_path / "takes"
    takes.mkdir()
    skeleton = next(motions[0].parent.glob("ann.asf"))
    (takes / skeleton.name).write_bytes(skeleton.read_bytes())
    (takes / clip.name).write_bytes(clip.read_bytes())
    index_files([takes], tmp_path / "old.store")
    reindex_store(tmp_path / "old.store", tmp_path / "new.store", "f31")
    (takes / f"{clip.stem}_b.amc").write_bytes(clip.read_bytes())
    index_files([takes], tmp_path / "old.store")
    summary = reindex_store(tmp_path / "old.store", tmp_path / "new.store", "f31")
    assert (summary.written, summary.unchanged) == (1, 1)


def test_small_batches_give_the_same_documents(old, tmp_path):
    reindex_store(old, tmp_path / "one.store", "f31")
    reindex_store(old, tmp_path / "many.store", "f31", batch_bytes=1)
    one, many = contents(tmp_path / "one.store"), contents(tmp_path / "many.store")
    assert all((one[key][1] == many[key][1]).all() for key in one)


def test_short_documents_that_wait_take_their_own_memory_alone(old, tmp_path):
    """Each is read with a whole block of the file, and none of those may stay with it."""
    size = sum(file.stat().st_size for file in (old / "segments").iterdir())
    reindex_store(old, tmp_path / "once.store", "f31")  # what is loaded is no matter
    tracemalloc.start()
    reindex_store(old, tmp_path / "new.store", "f31")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 16 * size


def test_a_new_store_can_be_asked_for_its_own_features(old, tmp_path, motions):
    (tmp_path / "hands.toml").write_text(OWN)
    reindex_store(old, tmp_path / "new.store", tmp_path / "hands.toml", poses=False)
    clip = sorted(motions[0].glob("*.amc"))[0]
    assert query_store(tmp_path / "new.store", clip, select="H1").hits


def test_a_store_without_poses_can_not_be_reindexed(motions, tmp_path):
    index_files(motions, tmp_path / "s.store", IndexOptions(poses=False))
    with pytest.raises(StoreError, match="keeps no poses"):
        reindex_store(tmp_path / "s.store", tmp_path / "new.store", "f31")
    assert not (tmp_path / "new.store").exists()


def test_a_store_is_never_mixed_of_two_feature_sets(old, tmp_path):
    with pytest.raises(ParameterError, match="give another --store"):
        reindex_store(old, old, "f31")
    reindex_store(old, tmp_path / "new.store", "f31")
    with pytest.raises(StoreError, match="another feature set"):
        reindex_store(old, tmp_path / "new.store", "f39")


def test_documents_of_older_stores_do_without_a_zero_pose(tmp_path):
    make_store(tmp_path / "s.store")
    summary = reindex_store(tmp_path / "s.store", tmp_path / "new.store", "f31")
    assert summary.written == 5


def test_a_zero_pose_is_kept_to_the_last_bit_and_gaps_are_none():
    rest = np.random.default_rng(0).normal(size=(24, 3))
    rest[5] = np.nan
    kept = kept_rest(rest)
    assert kept[5] is None
    assert kept[6] == rest[6].tolist()


def test_the_command_says_what_it_did(mocapidx, old, tmp_path):
    done = mocapidx("reindex", old, "--store", tmp_path / "new.store", "--feature-set", "f31")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "written, 0 unchanged" in done.stderr
    missing = mocapidx("reindex", old, "--store", tmp_path / "x.store", "--feature-set", "f99")
    assert missing.returncode == 3
    assert missing.stderr.count("\n") == 1
