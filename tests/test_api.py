"""Everything that a command does is one call away from `import mocapidx`."""

import subprocess
import sys
from pathlib import Path

import pytest

import mocapidx


@pytest.mark.parametrize("name", mocapidx.__all__)
def test_every_public_name_is_there_and_documented(name):
    assert getattr(mocapidx, name).__doc__


def test_every_public_name_is_in_the_reference():
    page = Path(__file__).parent.parent / "docs" / "reference" / "python.rst"
    listed = {line.strip() for line in page.read_text().splitlines() if line.startswith("   ")}
    assert set(mocapidx.__all__) <= listed


def test_importing_the_package_imports_nothing_heavy():
    code = "import sys, mocapidx; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_thing"):
        mocapidx.no_such_thing  # noqa: B018
