"""Settings files: values that options take where the command line says nothing."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mocapidx.errors import FormatError
from mocapidx.printable import shown
from mocapidx.toml_files import parse_toml, read_toml_text

__all__ = ["EVERYWHERE", "SETTINGS_NAME", "Settings", "find_settings", "read_settings"]

SETTINGS_NAME: Final = "mocapidx.toml"
"""The project file that is looked for in the working folder and above."""

EVERYWHERE: Final = "all"
"""The section whose values go to each command that has such an option."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What a settings file says.

    Parameters
    ----------
    path : Path
        The file.
    sections : mapping of str to mapping
        For each section, ``all`` or a command with its words apart (``template show``), the
        values by the names of their options, without the leading dashes.
    """

    path: Path
    sections: Mapping[str, Mapping[str, Any]]


def find_settings(folder: Path, owners: frozenset[int] | None = None) -> Path | None:
    """Look for the project file in a folder and in those above it.

    A file that somebody else put there, as anybody could in ``/tmp``, doesn't count.

    Parameters
    ----------
    folder : Path
    owners : frozenset of int, optional
        User ids whose files count; by default this user's and root's.

    Returns
    -------
    Path or None
        The nearest one.
    """
    trusted = frozenset({os.getuid(), 0}) if owners is None else owners
    for place in (folder, *folder.parents):
        path = place / SETTINGS_NAME
        try:
            if path.is_file() and path.stat().st_uid in trusted:
                return path
        except OSError:
            continue
    return None


def read_settings(path: Path) -> Settings:
    """Read a settings file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Settings

    Raises
    ------
    FormatError
        If there is no such file, it is no TOML, or has something other than values in sections.
    """
    where = shown(path, None)
    table = parse_toml(read_toml_text(path), where)
    loose = next((key for key, value in table.items() if not isinstance(value, dict)), None)
    if loose is not None:
        raise FormatError(
            f"{where}: '{shown(loose)}' stands in no section; write [{EVERYWHERE}] above it, or "
            "the name of a command"
        )
    return Settings(path, dict(_sections(table, "")))


def _sections(table: Mapping[str, Any], above: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Take sections of commands within a group, such as ``[template.show]``, apart."""
    for name, entries in table.items():
        words = f"{above} {name}".strip()
        yield words, {key: each for key, each in entries.items() if not isinstance(each, dict)}
        inner = {key: each for key, each in entries.items() if isinstance(each, dict)}
        yield from _sections(inner, words)
