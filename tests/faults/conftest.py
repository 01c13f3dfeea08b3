import os

import pytest

from tests.faults.faulting import Faulting, build_library
from tests.faults.world import make_world


@pytest.fixture(scope="session")
def pristine(fixtures_dir, tmp_path_factory):
    """The world before any command; nobody changes it."""
    return make_world(tmp_path_factory.mktemp("pristine") / "world", fixtures_dir)


@pytest.fixture(scope="session")
def faulting(tmp_path_factory):
    """A process that runs the program with faults."""
    work = tmp_path_factory.mktemp("faults")
    library = build_library(work)
    if library is None:
        pytest.skip("no C compiler here, and the library that makes calls fail needs one")
    found = Faulting(library, work)
    yield found
    found.close()


@pytest.fixture
def is_full():
    """Whether everything is tried, or as much as takes seconds."""
    return os.environ.get("TORTURE", "short") == "full"
