"""Documents leave a store by a condition, and nothing else does."""

import pytest

from mocapidx.errors import LockedError, ParameterError
from mocapidx.store.read import open_store
from mocapidx.store.write import writing
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.info import list_documents
from mocapidx.tasks.remove import remove_documents


@pytest.fixture
def store(fixtures_dir, tmp_path):
    clips = fixtures_dir / "clips"
    index_files([clips / "squat", clips / "walk"], tmp_path / "s.store", IndexOptions(root=clips))
    return tmp_path / "s.store"


def names(store):
    with open_store(store) as snapshot:
        return sorted(entry.document.name for entry in snapshot.documents())


def test_what_meets_the_condition_leaves_and_can_come_back(store, fixtures_dir):
    before = names(store)
    walks = tuple(name for name in before if name.startswith("walk/"))
    assert [row["document"] for row in list_documents(store, "document = walk/*")] == list(walks)
    assert remove_documents(store, "document = walk/*") == walks
    assert names(store) == [name for name in before if name not in walks]
    assert remove_documents(store, "document = walk/*") == ()
    clips = fixtures_dir / "clips"
    assert index_files([clips], store, IndexOptions(root=clips)).added >= len(walks)
    assert set(walks) <= set(names(store))


def test_a_condition_that_is_none_changes_nothing(store):
    before = names(store)
    with pytest.raises(ParameterError):
        remove_documents(store, "documnt = walk/*")
    with writing(store, command="test"), pytest.raises(LockedError):
        remove_documents(store, "document = *")
    assert names(store) == before


def test_the_command_prints_the_names(store, mocapidx):
    walks = [name for name in names(store) if name.startswith("walk/")]
    done = mocapidx("remove", store, "--where", "document = walk/*")
    assert (done.stdout.splitlines(), done.returncode) == (walks, 0)
    assert done.stderr == f"{store}: {len(walks)} documents removed\n"
    again = mocapidx("remove", store, "--where", "document = walk/*", "--quiet")
    assert (again.stdout, again.stderr, again.returncode) == ("", "", 0)
    assert mocapidx("remove", store).returncode == 2
