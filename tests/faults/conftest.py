import os
import shutil

import pytest

from tests.faults.attack import Attack
from tests.faults.faulting import Faulting, build_library
from tests.faults.killing import Course, Warm, make_archive
from tests.faults.world import WRITERS, make_world


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


@pytest.fixture(scope="session")
def course(fixtures_dir, tmp_path_factory):
    """Make a `Course` from its name."""
    work = tmp_path_factory.mktemp("courses")
    warm = Warm(work)
    archive = make_archive(work / "archive", fixtures_dir, warm)
    pristine = shutil.copytree(archive, work / "pristine")
    yield lambda name, *rest, **more: Course(name, archive, pristine, warm, *rest, **more)
    warm.close()


@pytest.fixture
def is_full():
    """Whether everything is tried, or as much as takes seconds."""
    return os.environ.get("TORTURE", "short") == "full"


@pytest.fixture
def attacked(pristine, faulting, tmp_path):
    """Make the attack on a command."""

    def make(name):
        return Attack(WRITERS[name], pristine, faulting, tmp_path / "world")

    return make
