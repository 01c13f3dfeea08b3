import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mocapidx_cli.main import COMMANDS

PROGRAM = Path(sys.executable).parent / "mocapidx"


def completed(*words):
    """What bash is told after these words; the last is incomplete."""
    environment = os.environ | {
        "_MOCAPIDX_COMPLETE": "bash_complete",
        "COMP_WORDS": " ".join(("mocapidx", *words)),
        "COMP_CWORD": str(len(words)),
    }
    done = subprocess.run([PROGRAM], env=environment, capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    return [line.split(",")[1] for line in done.stdout.splitlines()]


def test_commands_are_completed_from_the_table():
    assert completed("an") == ["annotate"]
    assert set(completed("")) >= set(COMMANDS)


def test_options_and_their_values_are_completed():
    assert completed("retrieve", "--keyf") == ["--keyframes", "--keyframe-tolerance"]
    assert completed("retrieve", "--steps", "pr") == ["printed"]


@pytest.mark.parametrize(
    "words", [("query", "a.store", "--example"), ("align",), ("index", ".", "--feature-set")]
)
def test_a_value_that_begins_with_a_file_is_completed_as_one(words):
    assert completed(*words, "tak") == ["tak"]


def test_completing_a_command_imports_none():
    code = (
        "import sys\nfrom mocapidx_cli.main import main\nsys.argv = ['mocapidx']\n"
        "try:\n    main()\nfinally:\n"
        "    heavy = {n for n in sys.modules if n.startswith('mocapidx_cli.')}\n"
        "    heavy |= {'numpy', 'h5py', 'pyroaring', 'tqdm'} & set(sys.modules)\n"
        "    sys.stderr.write(' '.join(sorted(heavy)))"
    )
    environment = os.environ | {
        "_MOCAPIDX_COMPLETE": "bash_complete",
        "COMP_WORDS": "mocapidx re",
        "COMP_CWORD": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60
    )
    assert "retrieve" in done.stdout
    assert set(done.stderr.split()) == {
        "mocapidx_cli.group",
        "mocapidx_cli.main",
        "mocapidx_cli.settings",
    }


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_takes_its_script(mocapidx, tmp_path, shell):
    done = mocapidx("completion", shell)
    assert done.returncode == 0
    assert "_MOCAPIDX_COMPLETE" in done.stdout
    if shutil.which(shell):
        script = tmp_path / "script"
        script.write_text(done.stdout)
        checked = subprocess.run([shell, "-n", script], capture_output=True, text=True, timeout=60)
        assert checked.returncode == 0, checked.stderr
