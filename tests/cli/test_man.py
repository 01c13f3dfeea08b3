import shutil
import subprocess

import pytest

from mocapidx_cli.main import COMMANDS


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    from click.testing import CliRunner

    from mocapidx_cli.group import mocapidx

    folder = tmp_path_factory.mktemp("man")
    done = CliRunner().invoke(mocapidx, ["--no-config", "man", "--output", str(folder)])
    assert done.exit_code == 0, done.output
    return folder / "man1"


def test_there_is_a_page_for_the_program_and_each_command(pages):
    names = {path.name for path in pages.iterdir()}
    assert {"mocapidx.1", "mocapidx-template-show.1"} <= names
    assert {f"mocapidx-{name}.1" for name in COMMANDS} <= names


def test_a_page_has_options_example_and_exit_codes(pages):
    text = (pages / "mocapidx-retrieve.1").read_text().replace("\\-", "-")
    assert "--class NAME" in text
    assert "mocapidx retrieve takes.store" in text
    assert ".SH EXIT STATUS" in text


@pytest.mark.skipif(not shutil.which("groff"), reason="groff isn't there")
def test_groff_finds_nothing_wrong(pages):
    for page in sorted(pages.iterdir()):
        done = subprocess.run(
            ["groff", "-man", "-ww", "-Tutf8", "-z", page],
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert (done.returncode, done.stderr) == (0, ""), page
