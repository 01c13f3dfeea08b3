from importlib import import_module

import click
import pytest

from mocapidx_cli.main import COMMANDS


@pytest.mark.parametrize(
    "option", [["--rate"], ["--lock-timeout"], ["--source-rate"], ["--unit"], ["--jobs"]]
)
def test_nan_is_no_number(mocapidx, tmp_path, option):
    done = mocapidx("index", tmp_path, "--store", tmp_path / "s.store", *option, "nan")
    assert done.returncode == 2
    assert done.stderr.startswith(f"Error: Invalid value for '{option[0]}': 'nan' is not a")
    assert not (tmp_path / "s.store").exists()


def every_command():
    for name, (place, _) in COMMANDS.items():
        module, _, attribute = place.partition(":")
        command = getattr(import_module(f"mocapidx_cli.{module}"), attribute)
        yield name, command
        for one in getattr(command, "commands", {}).values():
            yield f"{name} {one.name}", one


@pytest.mark.parametrize(("name", "command"), [pytest.param(*x, id=x[0]) for x in every_command()])
def test_help_says_in_words_what_a_value_is(name, command):
    for parameter in command.params:
        if isinstance(parameter, click.Option) and isinstance(
            parameter.type, (click.FloatRange, click.IntRange)
        ):
            assert parameter.metavar, f"{name} {parameter.opts[0]}"
    if " " in name:  # the others have their lines in the table
        assert not command.get_short_help_str().endswith("...")
    assert "Example" in command.get_help(click.Context(command))
