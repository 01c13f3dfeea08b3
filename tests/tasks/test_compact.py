"""What `compact` merges, what it leaves alone, and what a stop leaves of it."""

import itertools
import signal

import pytest

from mocapidx.errors import Interrupted
from mocapidx.store.read import open_store
from mocapidx.store.write import Writer
from mocapidx.tasks import compact
from mocapidx.tasks.compact import compact_store
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.query import query_store


@pytest.fixture
def takes(fixtures_dir):
    """Clips of several classes with their skeletons."""
    return fixtures_dir / "clips"


@pytest.fixture
def store(takes, tmp_path):
    """A store of a segment file for each clip."""
    options = IndexOptions(root=takes, batch_bytes=1)
    index_files([takes / "squat", takes / "walk"], tmp_path / "s.store", options)
    return tmp_path / "s.store"


def sizes(store):
    with open_store(store) as snapshot:
        return [
            sorted(document.frames for document in file.documents if document.live)
            for file in snapshot.files
        ]


def found(store, takes):
    example = str(sorted((takes / "squat").glob("*.amc"))[0])
    return query_store(store, example, select="F20,F21").hits


def test_a_large_store_keeps_as_many_files_as_it_takes(store, takes, monkeypatch):
    before, hits = sizes(store), found(store, takes)
    assert len(before) > 3
    most = sum(map(sum, before)) // 2
    monkeypatch.setattr(compact, "MOST_FRAMES", most)
    assert compact_store(store) == (len(before), len(sizes(store)))
    assert 2 <= len(sizes(store)) <= 4
    assert all(sum(file) <= most for file in sizes(store))
    assert sorted(itertools.chain(*sizes(store))) == sorted(itertools.chain(*before))
    assert found(store, takes) == hits


def test_a_file_larger_than_a_merged_one_may_be_stays(store, monkeypatch):
    monkeypatch.setattr(compact, "MOST_FRAMES", 1)
    before = sizes(store)
    assert compact_store(store) == (len(before), len(before))
    assert sizes(store) == before


def test_what_was_removed_goes_from_large_files_too(store, monkeypatch):
    compact_store(store)
    with open_store(store) as snapshot:
        name = snapshot.documents()[0].document.name
    with compact.writing(store, command="test") as writer:
        writer.commit(None, remove=[name])
    monkeypatch.setattr(compact, "MOST_FRAMES", 1)
    assert compact_store(store) == (1, 1)
    with open_store(store) as snapshot:
        assert all(d.live and d.name != name for file in snapshot.files for d in file.documents)


def test_a_stop_between_two_merges_keeps_the_first(store, takes, monkeypatch):
    before, hits = sizes(store), found(store, takes)
    monkeypatch.setattr(compact, "MOST_FRAMES", sum(map(sum, before)) // 2)
    replace, done = Writer.replace, []

    def stopped(self, *arguments):
        if done:
            raise Interrupted(signal.SIGTERM)
        done.append(arguments)
        return replace(self, *arguments)

    monkeypatch.setattr(Writer, "replace", stopped)
    with pytest.raises(Interrupted, match=r"stopped after 1 of \d merges; run again to continue"):
        compact_store(store)
    assert 1 < len(sizes(store)) < len(before)
    monkeypatch.setattr(Writer, "replace", replace)
    compact_store(store)
    assert found(store, takes) == hits
