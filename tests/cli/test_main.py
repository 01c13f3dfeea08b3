import json
import os
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import click
import pytest

from mocapidx_cli.main import COMMANDS

PROGRAM = Path(sys.executable).parent / "mocapidx"


def one_line(text):
    return text.count("\n") == 1 and "Traceback" not in text


def test_help_names_every_command_and_imports_none_of_the_heavy_libraries():
    code = (
        "import sys\nfrom mocapidx_cli.main import main\nsys.argv = ['mocapidx', '--help']\n"
        "try:\n    main()\nfinally:\n"
        "    heavy = {'numpy', 'h5py', 'pyroaring', 'tqdm'} & set(sys.modules)\n"
        "    sys.stderr.write(' '.join(sorted(heavy)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert done.stderr == ""
    for name, (_, text) in COMMANDS.items():
        assert name in done.stdout
        assert text.split(".")[0][:40] in done.stdout


@pytest.mark.parametrize(("given", "expected"), [(None, "1"), ("3", "3")])
def test_numpy_starts_no_threads_unless_asked_to(given, expected):
    code = (
        "import os, sys\nfrom mocapidx_cli.main import main\nsys.argv = ['mocapidx', '--version']\n"
        "try:\n    main()\nfinally:\n    sys.stderr.write(os.environ['OPENBLAS_NUM_THREADS'])"
    )
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": given or ""}
    if given is None:
        del environment["OPENBLAS_NUM_THREADS"]
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=60
    )
    assert done.stderr == expected


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_begins_with_a_purpose_and_ends_with_an_example(mocapidx, name):
    done = mocapidx(name, "--help")
    assert done.returncode == 0
    assert f"  mocapidx {name}" in done.stdout
    assert "Example" in done.stdout


@pytest.mark.parametrize("name", COMMANDS)
def test_the_table_and_the_command_agree(name):
    module, _, attribute = COMMANDS[name][0].partition(":")
    command = getattr(import_module(f"mocapidx_cli.{module}"), attribute)
    assert isinstance(command, click.Command)
    assert command.name == name


def test_no_arguments_show_the_help_and_are_wrong_usage(mocapidx):
    done = mocapidx()
    assert done.returncode == 2
    assert "Usage: mocapidx" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["no-such-command"], "no-such-command"),
        (["index"], "INPUT"),
        (["query", "s.store", "--mode", "odd", "--example", "x"], "odd"),
        (["index", "nowhere", "--store", "s.store"], "nowhere"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(mocapidx, tmp_path, arguments, named):
    done = mocapidx(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert one_line(done.stderr)
    assert named in done.stderr


def test_a_missing_store_is_one_line_and_exit_4(mocapidx, tmp_path):
    done = mocapidx("info", tmp_path / "none.store")
    assert done.returncode == 4
    assert one_line(done.stderr)
    assert "make one with 'mocapidx index'" in done.stderr


def test_a_traceback_is_shown_only_with_debug(mocapidx, tmp_path):
    done = mocapidx("--debug", "info", tmp_path / "none.store")
    assert "Traceback" in done.stderr


def test_a_reader_that_goes_away_ends_the_program_silently(fixtures_store):
    command = f"{PROGRAM} info {fixtures_store} --format csv | head -1"
    done = subprocess.run(
        ["bash", "-c", command + "; exit ${PIPESTATUS[0]}"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode in (0, 141)
    assert done.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
def test_a_full_standard_output_is_one_line_and_exit_7(fixtures_store):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [PROGRAM, "info", fixtures_store],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
    assert done.returncode == 7
    assert one_line(done.stderr)


def test_an_ascii_terminal_gets_escapes_and_valid_json(fixtures_store):
    environment = os.environ | {"LC_ALL": "C", "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        [PROGRAM, "info", fixtures_store, "--format", "jsonl"],
        capture_output=True,
        env=environment,
        timeout=60,
    )
    assert done.returncode == 0
    json.loads(done.stdout)


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_signals_stop_indexing_with_one_line_and_their_exit_code(
    fixtures_dir, tmp_path, number, code
):
    process = subprocess.Popen(
        [PROGRAM, "index", fixtures_dir, "--store", tmp_path / "s.store", "--jobs", "2"],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 30
    while not (tmp_path / "s.store" / "LOCK").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.2)
    os.killpg(process.pid, number)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == code
    assert one_line(errors)
    assert "run again to continue" in errors
