import pytest

from tests.made_store import make_store


@pytest.fixture
def store(tmp_path):
    """A store of two segment files with five documents."""
    return make_store(tmp_path / "takes.store")
