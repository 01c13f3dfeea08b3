"""What joint maps and marker maps have in common, as TOML files that people write."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from mocapidx.errors import FeatureSetError
from mocapidx.printable import shown
from mocapidx.skeleton.joints import INDEX
from mocapidx.toml_files import parse_toml

__all__ = ["MapHead", "check_joint", "listed", "parse_map"]

HEAD: Final = frozenset({"name", "source", "strip", "needs", "lacks", "joints"})


@dataclass(frozen=True, slots=True)
class MapHead:
    """What a map says of itself.

    Parameters
    ----------
    name, source : str
        What it is called and where it comes from.
    strip : str
        A regular expression; what it matches at the beginning of a name is not looked at.
    needs, lacks : tuple of str
        Names that must be there, or must not, for the map to fit.
    """

    name: str
    source: str
    strip: str
    needs: tuple[str, ...]
    lacks: tuple[str, ...]


def parse_map(text: str, where: str, further: Iterable[str] = ()) -> tuple[dict[str, Any], MapHead]:
    """Read the text of a map and check its head.

    Parameters
    ----------
    text : str
        TOML.
    where : str
        The file, for messages.
    further : iterable of str
        Keys that it may have besides those of every map.

    Returns
    -------
    table : dict
        All of it.
    head : MapHead

    Raises
    ------
    FeatureSetError
        If something is wrong; the message names the key.
    """
    table = parse_toml(text, where, FeatureSetError)
    keys = HEAD | {*further}
    for key in table.keys() - keys:
        raise FeatureSetError(f"{where}: unknown key '{shown(key)}', expected {listed(keys)}")
    strip = _text(table, "strip", where)
    try:
        re.compile(strip)
    except (re.error, RecursionError, OverflowError) as exc:
        raise FeatureSetError(f"{where}: strip is no regular expression: {shown(exc)}") from exc
    name = _text(table, "name", where)
    if not name:
        raise FeatureSetError(f"{where}: name: expected a text")
    return table, MapHead(
        name=name,
        source=_text(table, "source", where),
        strip=strip,
        needs=_names(table, "needs", where),
        lacks=_names(table, "lacks", where),
    )


def check_joint(joint: str, where: str) -> None:
    """Raise FeatureSetError if a name is not that of a canonical joint."""
    if joint not in INDEX:
        raise FeatureSetError(f"{where}: [joints] has '{shown(joint)}', expected {listed(INDEX)}")


def listed(names: Iterable[str]) -> str:
    """Return names in their order, with commas between."""
    return ", ".join(sorted(names))


def _text(table: dict[str, Any], key: str, where: str) -> str:
    value = table.get(key, "")
    if not isinstance(value, str):
        raise FeatureSetError(f"{where}: {key}: expected a text")
    return value


def _names(table: dict[str, Any], key: str, where: str) -> tuple[str, ...]:
    value = table.get(key, [])
    if not isinstance(value, list) or not all(isinstance(n, str) and n for n in value):
        raise FeatureSetError(f"{where}: {key}: expected a name or a list of names")
    return tuple(value)
