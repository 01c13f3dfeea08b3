"""How the program ends: with whatever streams and signals it is left alone."""

import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(sys.executable).parent / "mocapidx"


def in_shell(tail, *arguments):
    return subprocess.run(
        ["bash", "-c", f'"$@" {tail}', "bash", PROGRAM, *arguments],
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.mark.parametrize("arguments", [["--help"], ["index", "--help"], ["--version"]])
def test_help_that_nobody_reads_ends_silently(arguments):
    done = in_shell("| true; exit ${PIPESTATUS[0]}", *arguments)
    assert done.returncode in (0, 141)
    assert done.stderr == ""


def test_a_closed_standard_output_is_one_line_and_exit_7_where_something_was_to_be_said(
    fixtures_store,
):
    done = in_shell(">&-", "info", fixtures_store)
    assert done.returncode == 7
    assert done.stderr == "Error: could not write to the standard output: bad file descriptor\n"
    assert in_shell(">&- <&-", "verify", fixtures_store).returncode == 0


@pytest.mark.parametrize("tail", ["2>&-", "2>/dev/full", "2>&- <&-"])
def test_messages_that_nobody_can_hear_leave_the_exit_code(fixtures_store, tmp_path, tail):
    assert in_shell(tail, "verify", fixtures_store).returncode == 0
    assert in_shell(tail, "info", tmp_path / "none.store").returncode == 4


def test_a_full_standard_output_is_named():
    done = in_shell(">/dev/full", "--help")
    assert done.returncode == 7
    assert done.stderr.startswith("Error: could not write to the standard output: no space left")
    assert done.stderr.count("\n") == 1


def test_no_argument_steers_a_terminal(tmp_path):
    # Through a pipe click would take the sequences away by itself.
    for arguments in (
        ["info", tmp_path / "\x1b[2J\u202e.store"],
        ["index", "\x1b]0;x\x07", "--store", tmp_path / "s.store"],
        ["query", tmp_path, "--example", "x", "--mode", "\x1b[2J"],
        ["\x1b[31m"],
    ):
        ours, theirs = pty.openpty()
        done = subprocess.run(
            [PROGRAM, *arguments],
            stdout=theirs,
            stderr=theirs,
            env=os.environ | {"NO_COLOR": "1"},
            timeout=60,
        )
        os.close(theirs)
        shown = os.read(ours, 10_000).decode()
        os.close(ours)
        assert done.returncode in (2, 4)
        assert "\x1b" not in shown
        assert "\\x1b" in shown
        assert shown.count("\n") == 1


def run(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=20,
        env=os.environ | environment,
    )


def test_a_stop_while_the_program_is_loaded_is_one_line(tmp_path):
    (tmp_path / "click.py").write_text("import os\nos.kill(os.getpid(), 2)\nx = 1\n")
    done = run("from mocapidx_cli.main import main\nmain()", PYTHONPATH=str(tmp_path))
    assert done.returncode == 128 + signal.SIGINT
    assert done.stderr == "Error: interrupted; nothing was written\n"


def test_a_stop_after_a_file_was_written_does_not_deny_it(tmp_path):
    done = run(
        "import os, pathlib\n"
        "from mocapidx.durable import durable_replace\n"
        "from mocapidx_cli import main, group\n"
        "def writing(**_):\n"
        f"    durable_replace(pathlib.Path({str(tmp_path / 'out')!r}), b'all')\n"
        "    os.kill(os.getpid(), 15)\n"
        "group.mocapidx.main = writing\n"
        "main.main()\n"
    )
    assert done.returncode == 128 + signal.SIGTERM
    assert done.stderr == "Error: interrupted; what was written is whole\n"
    assert (tmp_path / "out").read_bytes() == b"all"


def test_a_stop_after_the_end_changes_nothing():
    done = run(
        "import atexit, os\n"
        "from mocapidx_cli import main, group\n"
        "atexit.register(os.kill, os.getpid(), 15)\n"
        "group.mocapidx.main = lambda **_: 5\n"
        "main.main()\n"
    )
    assert (done.returncode, done.stderr) == (5, "")


def test_want_of_memory_is_one_line_in_plain_words():
    done = run(
        "from mocapidx_cli import main, group\n"
        "def greedy(**_):\n"
        "    bytearray(1 << 60)\n"
        "group.mocapidx.main = greedy\n"
        "main.main()\n"
    )
    assert done.returncode == 1
    assert done.stderr.startswith("Error: out of memory")
    assert done.stderr.endswith("run again where there is more, or on less\n")
    assert done.stderr.count("\n") == 1


def test_a_stop_that_a_library_makes_another_error_of_is_still_a_stop():
    done = run(
        "import os, sys\n"
        "from mocapidx_cli import main, group\n"
        "def broken(**_):\n"
        "    try:\n"
        "        os.kill(os.getpid(), 15)\n"
        "    except BaseException as exc:\n"
        "        raise ImportError('a library') from exc\n"
        "group.mocapidx.main = broken\n"
        "main.main()\n"
    )
    assert done.returncode == 128 + signal.SIGTERM
    assert done.stderr == "Error: interrupted; nothing was written\n"


def test_a_stop_that_python_swallows_is_raised_again():
    done = run(
        "import os, time\n"
        "from mocapidx.errors import Interrupted\n"
        "from mocapidx_cli.main import listen_to_signals\n"
        "class Swallowing:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), 15)\n"
        "        time.sleep(0)\n"
        "listen_to_signals()\n"
        "try:\n"
        "    Swallowing()\n"
        "    time.sleep(10)\n"
        "except Interrupted as exc:\n"
        "    print('stopped by', exc.signal_number)\n"
    )
    assert (done.stdout, done.stderr) == ("stopped by 15\n", "")


INTERRUPTED_IMPORTS = """
import os, signal, sys
from mocapidx_cli.start import start

class Interrupting:
    def find_spec(self, name, path, target=None):
        if name == sys.argv[1]:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupting())
start()
"""


@pytest.mark.parametrize(
    ("module", "ending"),
    [
        ("mocapidx_cli.main", -signal.SIGINT),
        ("mocapidx.errors", -signal.SIGINT),
        ("mocapidx_cli.group", 130),
        ("click", 130),
    ],
)
def test_ctrl_c_while_the_program_is_loaded_shows_no_traceback(module, ending):
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED_IMPORTS, module, "--help"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == ending
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") <= 1
