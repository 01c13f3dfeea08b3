"""Damaged files are kept, and what they held is named, wherever a repair is ended."""

import errno
import os

import pytest

from mocapidx.errors import WriteError
from mocapidx.store.aside import lost_sources
from mocapidx.store.read import open_store
from mocapidx.store.write import writing
from tests.made_store import make_batch, names_of, store_bytes

KEPT = ["damaged-000001.h5", "damaged-000001.idx", "damaged-000001.jsonl"]


def set_aside_first(store):
    with writing(store, command="verify") as writer:
        return writer.set_aside(writer.snapshot.files[:1])


def kept_in(store):
    return sorted(place.name for place in (store / "segments").glob("damaged-*"))


def lost(store):
    with open_store(store) as snapshot:
        held = [entry.document for entry in snapshot.documents()]
    return [str(path) for path in lost_sources(store, held)]


@pytest.fixture
def first(store):
    """What is in the first segment file: names, sources, and its bytes."""
    with open_store(store) as snapshot:
        documents = snapshot.files[0].documents
    data = {name: (store / "segments" / name).read_bytes() for name in ("000001.h5", "000001.idx")}
    return [each.name for each in documents], sorted(str(d.source) for d in documents), data


def test_what_was_in_a_file_that_was_set_aside_is_named_until_it_is_there_again(store, first):
    names, sources, data = first
    set_aside_first(store)
    assert kept_in(store) == KEPT
    assert {name: (store / f"segments/damaged-{name}").read_bytes() for name in data} == data
    assert lost(store) == sources
    with writing(store, command="index") as writer:
        writer.commit(make_batch({names[0]: 5}))
    assert len(lost(store)) == len(sources) - 1
    with writing(store, command="index") as writer:
        writer.commit(make_batch(dict.fromkeys(names, 5)))
    assert lost(store) == []


def test_a_repair_that_is_ended_after_its_commit_has_kept_and_named_everything(
    store, first, monkeypatch
):
    names, sources, data = first

    def end(source, target):
        if os.path.basename(target) in KEPT[:2]:
            raise SystemExit
        os.replace(source, target)

    with monkeypatch.context() as patched:
        patched.setattr(os, "rename", end)
        with pytest.raises(SystemExit):
            set_aside_first(store)
    with writing(store, command="next"):
        pass  # sweeps
    assert not set(names) & set(names_of(store))
    assert kept_in(store) == KEPT
    assert {name: (store / f"segments/damaged-{name}").read_bytes() for name in data} == data
    assert lost(store) == sources


@pytest.mark.parametrize("call", ["rename", "link", "fsync", "write"])
def test_a_repair_that_can_not_commit_leaves_the_store_as_it_was(store, monkeypatch, call):
    before = store_bytes(store)

    def full(*_args, **_options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(os, call, full)
        with pytest.raises(WriteError, match="store unchanged"):
            set_aside_first(store)
    assert store_bytes(store) == before
    assert kept_in(store) == []


def test_a_repair_that_was_ended_before_its_commit_is_done_again(store, first, monkeypatch):
    def end(_path):
        raise SystemExit

    with monkeypatch.context() as patched:
        patched.setattr("mocapidx.store.write.encode_manifest", end)
        patched.setattr(os, "unlink", lambda *_args: None)
        with pytest.raises(SystemExit):
            set_aside_first(store)
    assert lost(store) == []
    set_aside_first(store)
    assert kept_in(store) == KEPT
    assert lost(store) == first[1]


def test_file_systems_without_second_names_have_files_renamed(store, first, monkeypatch):
    def refuse(*_args, **_options):
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "link", refuse)
    moved = set_aside_first(store)
    assert [place.name for place in moved] == KEPT[:2]
    assert kept_in(store) == KEPT
    assert lost(store) == first[1]


@pytest.mark.parametrize(
    "text", ["5", "[]", '["a"]', "[[], []]", '["a", 5]', '["a", "\\ud800"]', "[" * 9999, "\x00", ""]
)
def test_lists_that_nobody_wrote_name_nothing(store, text):
    (store / "segments/damaged-000009.jsonl").write_text(text)
    (store / "segments/damaged-000008.jsonl").symlink_to("/etc/passwd")
    assert lost(store) == []
