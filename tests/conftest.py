"""What several tests share: motion that the project generates, real data where there is some."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parent.parent

# On a busy machine, or with sanitizers, an example may take long: that says nothing.
settings.register_profile("mocapidx", deadline=None)
settings.load_profile("mocapidx")


@pytest.fixture(scope="session")
def fixtures_dir(tmp_path_factory):
    """A small set of generated clips, takes and labels, made once a session."""
    from fixtures.generate import generate

    folder = tmp_path_factory.mktemp("fixtures")
    generate(folder, quick=True)
    return folder


@pytest.fixture(scope="session")
def real_data():
    """The folder of real motion capture, named by MOCAP_DATA; tests on it are skipped without."""
    folder = Path(os.environ.get("MOCAP_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no real motion capture here; MOCAP_DATA can name a folder of it")
    return folder


@pytest.fixture(scope="session")
def mocapidx():
    """Run the installed program in a process of its own; give what it printed and its code."""
    program = Path(sys.executable).parent / "mocapidx"

    def run(*arguments, **options):
        options = {"capture_output": True, "text": True, "timeout": 120} | options
        return subprocess.run([program, *map(str, arguments)], **options)

    return run


@pytest.fixture(scope="session")
def fixtures_store(fixtures_dir, tmp_path_factory, mocapidx):
    """A store of the generated motion."""
    store = tmp_path_factory.mktemp("stores") / "fixtures.store"
    done = mocapidx("index", fixtures_dir, "--store", store, "--jobs", "1")
    assert done.returncode == 0, done.stderr
    return store


@pytest.fixture
def reported():
    """Add to the table of counts that ``make torture`` prints, where one is wanted."""
    begin, table = time.monotonic(), os.environ.get("TORTURE_REPORT", "")

    def report(kind, tried, wrong):
        if table:
            seconds = time.monotonic() - begin
            with Path(table).open("a") as file:
                file.write(f"{kind}\t{tried}\t{wrong}\t{seconds:.0f}\n")

    return report
