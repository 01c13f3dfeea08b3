import os
import shutil

import pytest

from tests.fuzz.attacking import Attacker
from tests.fuzz.seeds import make_seeds

FULL = os.environ.get("TORTURE", "short") == "full"


@pytest.fixture(scope="session")
def seeds(fixtures_dir, tmp_path_factory):
    """Sound files of every kind."""
    folder = tmp_path_factory.mktemp("seeds")
    make_seeds(folder, fixtures_dir)
    return folder


@pytest.fixture
def store(seeds, tmp_path):
    """A store of three short takes in two segment files."""
    return shutil.copytree(seeds / "take.store", tmp_path / "take.store")


@pytest.fixture(scope="session")
def attacker(seeds, tmp_path_factory):
    """A process with limits that reads damaged files."""
    found = Attacker(seeds, tmp_path_factory.mktemp("attacked"))
    yield found
    found.close()


@pytest.fixture
def count():
    """How many files are tried: fewer unless ``TORTURE=full``; ``TORTURE=N`` tries N."""

    def choose(short, full):
        asked = os.environ.get("TORTURE", "short")
        return int(asked) if asked.isdigit() else full if FULL else short

    return choose
