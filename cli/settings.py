"""Values from a settings file as defaults of options; what the command line says goes first."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mocapidx.errors import ParameterError
from mocapidx.printable import shown

if TYPE_CHECKING:
    from mocapidx.tasks.settings import Settings

__all__ = ["Setting", "defaults", "given", "known_settings", "load", "settings_options"]


def settings_options(command: Any) -> Any:
    """Give the program ``--config`` and ``--no-config``."""
    command = click.option("--no-config", is_flag=True, help="Take no settings from any file.")(
        command
    )
    return click.option(
        "--config",
        type=click.Path(path_type=Path),
        metavar="FILE.toml",
        help="Settings.  [default: mocapidx.toml here or in a folder above]",
    )(command)


def load(path: Path | None, no_config: bool) -> "Settings | None":
    """Read the settings that count: the file that was named, else the project's."""
    from mocapidx.tasks.settings import find_settings, read_settings

    if no_config:
        return None
    try:
        found = path or find_settings(Path.cwd())
    except FileNotFoundError:  # the working folder is gone
        return None
    return read_settings(found) if found else None


def defaults(group: click.Group, ctx: click.Context, settings: "Settings") -> dict[str, Any]:
    """Lay out the settings of the command that was asked for as click takes them.

    Raises
    ------
    ParameterError
        If a section of this command names an option that it doesn't have, or a wrong value.
    """
    name = ctx.invoked_subcommand
    command = group.get_command(ctx, name) if name else None
    return {} if command is None or name is None else {name: _nested(command, name, settings)}


def _nested(command: click.Command, words: str, settings: "Settings") -> dict[str, Any]:
    found = {name: each.value for name, each in known_settings(command, words, settings).items()}
    if isinstance(command, click.Group):
        for name, inner in command.commands.items():
            found[name] = _nested(inner, f"{words} {name}", settings)
    return found


@dataclass(frozen=True, slots=True)
class Setting:
    """A value for a parameter of a command, and where it stands in the file."""

    value: Any
    section: str
    key: str


def known_settings(
    command: click.Command, words: str, settings: "Settings | None"
) -> dict[str, Setting]:
    """Find what the settings say about a command, by the names of its parameters.

    Raises
    ------
    ParameterError
        As for `defaults`.
    """
    from mocapidx.tasks.settings import EVERYWHERE

    found: dict[str, Setting] = {}
    if settings is None:
        return found
    spelled = {name: param for param in command.params for name in _names(param)}
    for section in (EVERYWHERE, words):
        for key, value in settings.sections.get(section, {}).items():
            param = spelled.get(key.replace("_", "-"))
            if param is not None and param.name is not None:
                read = _value(param, key, value, settings, section)
                if read is not None:
                    found[param.name] = Setting(read, section, key)
            elif section != EVERYWHERE:
                raise ParameterError(
                    f"{_place(settings, section)}: '{words}' has no option "
                    f"'--{shown(key)}' (see 'mocapidx {words} --help')"
                )
    return found


def _names(param: click.Parameter) -> list[str]:
    """Name a parameter as a settings file does: an option without its dashes, or the store."""
    if isinstance(param, click.Option):
        return [name[2:] for name in param.opts if name.startswith("--")]
    return ["store"] if param.name == "store" and param.nargs == 1 else []


def _value(param: click.Parameter, key: str, value: Any, settings: "Settings", section: str) -> Any:
    """Turn a value of TOML into what the option takes; None leaves the option alone."""
    place = f"{_place(settings, section)}: {shown(key)}"
    if isinstance(param, click.Option) and param.is_flag:
        if not isinstance(value, bool):
            raise ParameterError(f"{place}: expected true or false, got '{shown(value)}'")
        return given(param) if value else None
    several = getattr(param, "multiple", False) or param.nargs != 1
    if several and param.nargs == 1 and isinstance(value, (str, int, float)):
        value = value if isinstance(value, bool) else [value]
    if isinstance(value, bool) or isinstance(value, list) != several:
        expected = "a list" if several else "a text or a number"
        raise ParameterError(f"{place}: expected {expected}, got '{shown(value)}'")
    folder = settings.path.parent
    read = (
        [_word(param, each, folder) for each in value] if several else _word(param, value, folder)
    )
    try:
        param.type_cast_value(click.Context(click.Command(section)), read)
    except click.UsageError as exc:
        raise ParameterError(f"{place}: {' '.join(exc.message.split())}") from exc
    return read


def given(flag: click.Option) -> bool:
    """Return the value of a flag that was given; ``--no-poses`` makes ``poses`` False."""
    return flag.flag_value is not False


def _word(param: click.Parameter, value: Any, folder: Path) -> str:
    """Write a value as the command line would; files are named from the settings' folder."""
    if isinstance(param.type, click.Path) and str(value) != "-":
        return str(folder / str(value))
    return str(value)


def _place(settings: "Settings", section: str) -> str:
    return f"{shown(settings.path, None)}: [{shown(section.replace(' ', '.'))}]"
