"""Marker maps: how the 24 canonical joints follow from points on a body.

A joint is a weighted sum of points; some lie a little way from one point in the direction of
others. A map has several formulas for one joint where sets of markers differ, the best first.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from mocapidx.errors import FeatureSetError
from mocapidx.printable import shown
from mocapidx.skeleton.mapfile import check_joint, parse_map
from mocapidx.toml_files import read_toml_text

__all__ = ["Formula", "MarkerMap", "load_marker_map", "parse_marker_map", "shipped_marker_maps"]

FORMS: Final = frozenset({"mean", "sum", "between"})
MOST_WEIGHT: Final = 10.0


@dataclass(frozen=True, slots=True)
class Formula:
    """One way to find a point.

    Parameters
    ----------
    weights : tuple of (str, float)
        What each point counts; together 1.
    along : tuple of (str, str) or None
        The point lies `metres` farther on, in the direction from the first to the second.
    metres : float
        How far.
    made : bool
        Whether this is a guess that features must not trust.
    """

    weights: tuple[tuple[str, float], ...]
    along: tuple[str, str] | None = None
    metres: float = 0.0
    made: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The points that it takes."""
        return (*(name for name, _ in self.weights), *(self.along or ()))

    def __str__(self) -> str:
        equal = len({weight for _, weight in self.weights}) == 1
        if len(self.weights) == 1:
            text = self.weights[0][0]
        elif equal:
            text = f"mean({', '.join(name for name, _ in self.weights)})"
        else:
            text = " + ".join(f"{weight:.3g} {name}" for name, weight in self.weights)
        if self.along:
            text += f" + {self.metres:g} m along {self.along[0]}-{self.along[1]}"
        return text.replace("+ -", "- ")


@dataclass(frozen=True, slots=True)
class MarkerMap:
    """One set of markers, as a TOML file has it.

    Parameters
    ----------
    name, source : str
        What it is called and where it comes from.
    points : mapping of str to tuple of Formula
        Points that formulas speak of besides the markers, in an order in which they can be
        found; for each, the ways to find it, the best first.
    joints : mapping of str to tuple of Formula
        The same for canonical joints.
    strip : str
        A regular expression; what it matches at the beginning of a name is not looked at.
    needs, lacks : tuple of str
        Points that must be there, or must not, for the map to fit.
    """

    name: str
    source: str
    points: Mapping[str, tuple[Formula, ...]]
    joints: Mapping[str, tuple[Formula, ...]]
    strip: str = ""
    needs: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()


@cache
def shipped_marker_maps() -> tuple[MarkerMap, ...]:
    """Return the maps that come with mocapidx, in the order of their names.

    Returns
    -------
    tuple of MarkerMap
    """
    paths = sorted((Path(__file__).parent / "maps" / "markers").glob("*.toml"))
    return tuple(parse_marker_map(p.read_text(encoding="utf-8"), p.name) for p in paths)


def load_marker_map(path: Path) -> MarkerMap:
    """Read a user's own map.

    Parameters
    ----------
    path : Path
        A TOML file.

    Returns
    -------
    MarkerMap

    Raises
    ------
    FeatureSetError
        If the file can't be read or is no marker map; the message names entry and key.
    """
    text = read_toml_text(path, FeatureSetError, "; expected a marker map in TOML")
    return parse_marker_map(text, shown(path, None))


def parse_marker_map(text: str, where: str) -> MarkerMap:
    """Read and check the text of a marker map.

    Parameters
    ----------
    text : str
        TOML. Joint maps of skeletons are understood too, with points in the place of nodes.
    where : str
        The file, for messages.

    Returns
    -------
    MarkerMap

    Raises
    ------
    FeatureSetError
        If the text is no marker map; the message names entry and key.
    """
    table, head = parse_map(text, where, ("points",))
    joints = _section(table, "joints", where)
    for joint in joints:
        check_joint(joint, where)
    if not joints:
        raise FeatureSetError(f"{where}: [joints] is missing or empty")
    points = _section(table, "points", where)
    return MarkerMap(head.name, head.source, points, joints, head.strip, head.needs, head.lacks)


def _section(table: dict[str, Any], key: str, where: str) -> dict[str, tuple[Formula, ...]]:
    section = table.get(key, {})
    if not isinstance(section, dict):
        raise FeatureSetError(f"{where}: {key}: expected a table")
    found = {}
    for name, entry in section.items():
        entries = entry if isinstance(entry, list) else [entry]
        if not entries:
            raise FeatureSetError(f"{where}: {shown(name)}: expected a name or a formula")
        found[name] = tuple(_formula(one, f"{where}: {shown(name)}") for one in entries)
    return found


def _formula(entry: Any, where: str) -> Formula:
    if isinstance(entry, str) and entry:
        return Formula(((entry, 1.0),))
    if not isinstance(entry, dict) or len(FORMS & entry.keys()) != 1:
        raise FeatureSetError(
            f"{where}: expected a name, {{ mean = [NAMES] }}, {{ sum = {{ NAME = WEIGHT }} }} or "
            '{ between = ["NAME", "NAME"], at = NUMBER }'
        )
    form = next(iter(FORMS & entry.keys()))
    own = {"between": {"at"}}.get(form, {"along", "metres", "made"})
    for key in entry.keys() - own - {form}:
        raise FeatureSetError(f"{where}: unknown key '{shown(key)}' beside {form}")
    if form == "between":
        first, last = _pair(entry["between"], f"{where}: between")
        at = _number(entry.get("at"), f"{where}: at")
        return Formula(((first, 1 - at), (last, at)), made=True)
    if form == "mean":
        names = _names(entry["mean"], f"{where}: mean")
        weights = tuple((name, 1 / len(names)) for name in names)
    else:
        weights = _weights(entry["sum"], where)
    if ("along" in entry) != ("metres" in entry):
        raise FeatureSetError(f"{where}: along and metres go together")
    along = _pair(entry["along"], f"{where}: along") if "along" in entry else None
    metres = _number(entry["metres"], f"{where}: metres") if along else 0.0
    made = entry.get("made", False)
    if not weights or not isinstance(made, bool):
        raise FeatureSetError(f"{where}: expected points, and made = true or false")
    return Formula(weights, along, metres, made)


def _weights(value: Any, where: str) -> tuple[tuple[str, float], ...]:
    if not isinstance(value, dict):
        raise FeatureSetError(f"{where}: sum: expected {{ NAME = WEIGHT, ... }}")
    weights = tuple((n, _number(w, f"{where}: weight of {shown(n)}")) for n, w in value.items())
    total = sum(weight for _, weight in weights)
    if abs(total - 1) > 1e-6:
        raise FeatureSetError(
            f"{where}: the weights of its points make {total:g}, expected 1: else it is no place"
        )
    return weights


def _number(value: Any, where: str) -> float:
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not abs(value) <= MOST_WEIGHT
    ):
        raise FeatureSetError(f"{where}: expected a number from -10 to 10")
    return float(value)


def _pair(value: Any, where: str) -> tuple[str, str]:
    names = _names(value, where)
    if len(names) != 2:
        raise FeatureSetError(f"{where}: expected two names")
    return names[0], names[1]


def _names(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(n, str) and n for n in value):
        raise FeatureSetError(f"{where}: expected a list of names")
    return tuple(value)
