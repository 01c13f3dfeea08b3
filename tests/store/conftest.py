import shutil

import pytest

from tests.made_store import make_store


@pytest.fixture(scope="session")
def made_store(tmp_path_factory):
    """The store that `store` is a copy of."""
    return make_store(tmp_path_factory.mktemp("made") / "takes.store")


@pytest.fixture
def store(made_store, tmp_path):
    """A store of two segment files with five documents."""
    return shutil.copytree(made_store, tmp_path / "takes.store")
