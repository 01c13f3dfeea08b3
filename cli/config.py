"""The command `config`."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mocapidx.errors import ParameterError
from mocapidx.printable import meant, shown

from .main import COMMANDS
from .rows import note, print_rows, row_options
from .settings import given, known_settings

if TYPE_CHECKING:
    from mocapidx.tasks.settings import Settings

__all__ = ["config"]

COLUMNS = ("command", "option", "value", "origin")


@click.group()
def config() -> None:
    """Show the settings that the commands take from files.

    A file mocapidx.toml in the working folder, or in the nearest folder above that has one, gives
    options other defaults; `mocapidx --config FILE.toml ...` names another file. The command line
    goes first, then the section of the command, then [all], then the program's own default.

    \b
    Example of a file:
      [all]
      store = "takes.store"   # files are named from the folder of the settings
      jobs = 2
      [retrieve]
      templates = "sports.h5"
      top = 20
    \b
    Example:
      mocapidx config show retrieve
    """


@config.command(short_help="Show options, their values and origins.")
@click.argument("command", nargs=-1, metavar="[COMMAND]...")
@row_options
@click.pass_context
def show(ctx: click.Context, command: tuple[str, ...], row_format: str, output: Path) -> None:
    """Show the options of COMMAND with their values, and where each comes from.

    Without COMMAND, all that the settings say, for every command that it reaches; what no command
    knows is an error.

    \b
    Example:
      mocapidx config show index
    """
    root = ctx.find_root()
    settings, group = root.obj, root.command
    note(f"settings: {shown(settings.path, None) if settings else 'no file'}", False)
    if command:
        words = " ".join(command)
        records = list(rows(named(group, root, command), words, settings))
    else:
        records = set_rows(group, root, settings)
    print_rows(records, row_format, output, COLUMNS)


def rows(
    command: click.Command, words: str, settings: "Settings | None"
) -> Iterator[dict[str, Any]]:
    """Lay out all options of a command."""
    found = known_settings(command, words, settings)
    for param in command.params:
        if param.name in found:
            yield row(words, param, found[param.name].value, found[param.name].section)
        elif isinstance(param, click.Option):
            default = None if callable(param.default) else param.default
            yield row(words, param, default if default != () else None, "")


def set_rows(group: Any, ctx: click.Context, settings: "Settings | None") -> list[dict[str, Any]]:
    """Lay out what the settings set, and refuse what reaches no command."""
    records, reached = [], set()
    for words, command in all_commands(group, ctx):
        found = known_settings(command, words, settings)
        reached |= {(each.section, each.key) for each in found.values()}
        records += [
            row(words, param, found[param.name].value, found[param.name].section)
            for param in command.params
            if param.name in found
        ]
    for section, entries in settings.sections.items() if settings else ():
        for key, value in entries.items():
            if value is not False and (section, key) not in reached:
                raise ParameterError(
                    f"{shown(settings and settings.path, None)}: [{shown(section)}]: no command "
                    f"takes '{shown(key)}' from there"
                )
    return records


def row(words: str, param: click.Parameter, value: Any, section: str) -> dict[str, Any]:
    """Lay out one option; a flag is given or not, whatever value it stands for."""
    is_option = isinstance(param, click.Option)
    if isinstance(param, click.Option) and param.is_flag:
        value = value == given(param)
    elif isinstance(value, (list, tuple)):
        value = " ".join(map(str, value))
    return {
        "command": words,
        "option": max(param.opts, key=len) if is_option else param.human_readable_name,
        "value": value if isinstance(value, bool) else text(value),
        "origin": f"[{section.replace(' ', '.')}]" if section else "default",
    }


def text(value: Any) -> str:
    """Show a value as it would be typed; click has an object of its own for none."""
    return "-" if value is None or type(value).__name__ == "Sentinel" else str(value)


def named(group: click.Command, ctx: click.Context, words: tuple[str, ...]) -> click.Command:
    """Find a command by its words."""
    command: click.Command = group
    for word in words:
        found = command.get_command(ctx, word) if isinstance(command, click.Group) else None
        if found is None:
            near = meant(
                word, command.list_commands(ctx) if isinstance(command, click.Group) else ()
            )
            raise ParameterError(f"there is no command '{shown(' '.join(words))}'{near}")
        command = found
    return command


def all_commands(group: Any, ctx: click.Context) -> Iterator[tuple[str, click.Command]]:
    """List all commands with their words, those within groups too."""
    for name in COMMANDS:
        command = group.get_command(ctx, name)
        yield name, command
        if isinstance(command, click.Group):
            yield from ((f"{name} {word}", inner) for word, inner in command.commands.items())
