"""Help and completion answer at once: they import nothing that takes long."""

import os
import subprocess
import sys
from importlib import import_module

import click
import pytest

from mocapidx_cli.main import COMMANDS

HEAVY = ("numpy", "h5py", "scipy", "matplotlib", "pyroaring", "tqdm", "concurrent.futures")

# Each call in a fork, which begins with what the program imports in any case.
CALLS = """
import os, sys
from mocapidx_cli.main import main

completing, heavy = sys.argv[1] == "completing", sys.argv[2:]
for line in sys.stdin.read().splitlines():
    child = os.fork()
    if not child:
        words = line.split()
        sys.argv = ["mocapidx"] if completing else ["mocapidx", *words]
        if completing:
            os.environ["COMP_WORDS"] = "mocapidx " + line
            os.environ["COMP_CWORD"] = str(len(words))
            os.environ["_MOCAPIDX_COMPLETE"] = "bash_complete"
        code = 0
        try:
            main()
        except SystemExit as exit:
            code = exit.code
        finally:
            loaded = [name for name in heavy if name in sys.modules]
            sys.stdout.flush()
            os.write(2, f"{line}|{code or 0}|{' '.join(loaded)}\\n".encode())
            os._exit(0)
    os.waitpid(child, 0)
"""


def all_commands():
    """Every command and subcommand, as the words that call it."""
    for name, (where, _) in COMMANDS.items():
        module, _, attribute = where.partition(":")
        yield from below([name], getattr(import_module(f"mocapidx_cli.{module}"), attribute))


def below(words, command):
    yield words
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from below([*words, name], command.get_command(context, name))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
@pytest.mark.parametrize("mode", ["help", "completing"])
def test_nothing_heavy_is_imported(mode):
    ending = "--help" if mode == "help" else "--"
    lines = [ending, *(" ".join([*words, ending]) for words in all_commands())]
    done = subprocess.run(
        [sys.executable, "-c", CALLS, mode, *HEAVY],
        input="\n".join(lines),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0
    assert done.stderr.splitlines() == [f"{line}|0|" for line in lines]
    assert done.stdout.count("--help") >= len(lines)
