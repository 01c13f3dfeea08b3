"""Patterns and scenes as TOML files that people write."""

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.featureset import FeatureSet
from mocapidx.printable import shown
from mocapidx.queries.language import (
    MOST_STEPS,
    Step,
    parse_short,
    parse_step,
    pattern_from_steps,
)
from mocapidx.queries.pattern import Pattern
from mocapidx.queries.scene import Condition, Place, Scene
from mocapidx.toml_files import parse_toml, read_toml_text

__all__ = ["parse_pattern", "parse_scene", "read_query_text", "shipped_scenes"]

SCENES: Final = Path(__file__).parent / "scenes"
MOST_PROGRESSIONS: Final = 32
MOST_CONDITIONS: Final = 256
DEEPEST: Final = 8
LONGEST: Final = 1e9  # seconds
CONDITION: Final = re.compile(
    r"(?P<one>\S+) +(?P<relation>overlaps|during|before|after|near) +(?P<other>\S+)"
    r"(?: +within +(?P<within>[0-9.]+) *s?)?",
    re.ASCII,
)
PLACE: Final = re.compile(r"(?P<name>[^.\s]+)(?:\.(?P<step>[0-9]{1,4}))?", re.ASCII)


def shipped_scenes() -> tuple[str, ...]:
    """Return the names of the scenes that come with mocapidx."""
    return tuple(sorted(path.stem for path in SCENES.glob("*.toml")))


def read_query_text(path: str | Path, *, shipped: bool = False) -> str:
    """Read the text of a pattern or a scene.

    Parameters
    ----------
    path : str or Path
    shipped : bool
        Whether it may be the name of a shipped scene.

    Returns
    -------
    str

    Raises
    ------
    FormatError
        If there is no such file, or it can't be read.
    """
    if shipped and str(path) in shipped_scenes():
        return (SCENES / f"{path}.toml").read_text(encoding="utf-8")
    others = f"; shipped are {', '.join(shipped_scenes())}" if shipped else ""
    return read_toml_text(path, hint=others)


def parse_pattern(
    text: str, feature_set: FeatureSet, rate: float, where: str = "pattern"
) -> tuple[str, Pattern]:
    """Understand the TOML text of a pattern.

    Parameters
    ----------
    text : str
    feature_set : FeatureSet
        The store's.
    rate : float
        The store's, in Hz.
    where : str
        What messages call it.

    Returns
    -------
    name : str
        Empty where the file has none.
    pattern : Pattern

    Raises
    ------
    FormatError
        If it is not TOML, or says something that a pattern can't; the message names the step.
    """
    tree = parse_toml(text, where)
    _only(tree, {"name", "steps", "of"}, where)
    name = _text(tree.get("name", ""), "name", where)
    return name, _pattern(tree, feature_set, rate, where)


def parse_scene(
    text: str, feature_set: FeatureSet, rate: float, where: str = "scene"
) -> tuple[str, Scene]:
    """Understand the TOML text of a scene.

    Parameters
    ----------
    text, feature_set, rate, where
        As for `parse_pattern`.

    Returns
    -------
    name : str
        Empty where the file has none.
    scene : Scene

    Raises
    ------
    FormatError
        If it is not TOML, or says something that a scene can't; the message names the place.
    """
    tree = parse_toml(text, where)
    _only(tree, {"name", "progressions", "conditions"}, where)
    progressions = tree.get("progressions")
    if type(progressions) is not dict or not 1 <= len(progressions) <= MOST_PROGRESSIONS:
        raise FormatError(f"{where}: needs tables [progressions.NAME], 1 to {MOST_PROGRESSIONS}")
    patterns = []
    for name, table in progressions.items():
        place = f"{where}: progression '{shown(name)}'"
        if not PLACE.fullmatch(f"{name}.1"):
            raise FormatError(f"{place}: a name has no points or blanks")
        if type(table) is not dict:
            raise FormatError(f"{place}: must be a table")
        _only(table, {"steps", "of"}, place)
        patterns.append(_pattern(table, feature_set, rate, place))
    texts = tree.get("conditions", [])
    if type(texts) is not list or len(texts) > MOST_CONDITIONS:
        raise FormatError(f"{where}: 'conditions' must be a list of at most {MOST_CONDITIONS}")
    names = tuple(progressions)
    conditions = tuple(
        _condition(_text(text, "conditions", where), names, rate, where) for text in texts
    )
    try:
        scene = Scene(names, tuple(patterns), conditions)
    except ParameterError as exc:
        raise FormatError(f"{where}: {exc}") from exc
    return _text(tree.get("name", ""), "name", where), scene


def _only(tree: Mapping[str, Any], keys: set[str], where: str) -> None:
    if unknown := sorted(set(tree) - keys):
        raise FormatError(
            f"{where}: '{shown(unknown[0])}' is no key here; there are {', '.join(sorted(keys))}"
        )


def _text(value: Any, key: str, where: str) -> str:
    if type(value) is not str:
        raise FormatError(f"{where}: '{key}' must be text, not {shown(repr(value), 40)}")
    return value


def _pattern(tree: Mapping[str, Any], feature_set: FeatureSet, rate: float, where: str) -> Pattern:
    steps = tree.get("steps")
    try:
        if type(steps) is str:
            given = parse_short(_text(tree.get("of"), "of", where), steps, feature_set)
        elif type(steps) is list and "of" not in tree:
            given = []
            for step in _steps(steps, feature_set, where, 1):
                given.append(step)
                if len(given) > MOST_STEPS:
                    raise FormatError(f"{where}: more than {MOST_STEPS} steps")
        else:
            raise FormatError(
                f"{where}: needs 'steps', a list, or 'of' (features) and 'steps' (words of digits)"
            )
        return pattern_from_steps(given, rate)
    except ParameterError as exc:
        raise FormatError(f"{where}: {exc}") from exc


def _steps(items: list[Any], feature_set: FeatureSet, where: str, depth: int) -> Iterator[Step]:
    for number, item in enumerate(items, start=1):
        place = f"{where}: step {number}"
        try:
            if type(item) is str:
                yield Step(parse_step(item, feature_set))
            elif type(item) is dict and "is" in item:
                _only(item, {"is", "min", "max"}, place)
                low, high = (
                    _seconds(item, "min", 0.0, place),
                    _seconds(item, "max", math.inf, place),
                )
                if low > high:
                    raise FormatError(f"{place}: at least {low:g} s but at most {high:g} s")
                yield Step(parse_step(_text(item["is"], "is", place), feature_set), low, high)
            elif type(item) is dict and depth < DEEPEST:
                _only(item, {"times", "steps"}, place)
                times, inner = item.get("times"), item.get("steps")
                if (
                    type(times) is not int
                    or not 1 <= times <= MOST_STEPS
                    or type(inner) is not list
                    or not inner
                ):
                    raise FormatError(
                        f"{place}: needs 'is', or 'times' (1 to {MOST_STEPS}) and 'steps' (a list)"
                    )
                for _ in range(times):
                    yield from _steps(inner, feature_set, place, depth + 1)
            else:
                raise FormatError(f"{place}: must be text or a table")
        except ParameterError as exc:
            raise FormatError(f"{place}: {exc}") from exc


def _seconds(tree: Mapping[str, Any], key: str, default: float, where: str) -> float:
    value = tree.get(key, default)
    if type(value) not in (int, float) or not value >= 0 or LONGEST < value < math.inf:
        raise FormatError(f"{where}: '{key}' must be seconds, 0 or more")
    return float(value)


def _condition(text: str, names: tuple[str, ...], rate: float, where: str) -> Condition:
    where = f"{where}: condition '{shown(text)}'"
    found = CONDITION.fullmatch(text.strip())
    if found is None:
        raise FormatError(
            f"{where}: must read like 'kick.2 overlaps foot.2', or with during, before, after or "
            "near for overlaps, and with 'within 1.5 s' at its end"
        )
    one, other = (_place(found[key], names, where) for key in ("one", "other"))
    relation, within = found["relation"], None
    if found["within"] is not None:
        if relation in ("overlaps", "during"):
            raise FormatError(f"{where}: '{relation}' takes no 'within'")
        within = math.floor(_number(found["within"], where) * rate + 1e-6)
    elif relation == "near":
        raise FormatError(f"{where}: 'near' needs 'within' and seconds")
    if relation == "after":
        one, other, relation = other, one, "before"
    return Condition(one, relation, other, within)


def _place(text: str, names: tuple[str, ...], where: str) -> Place:
    found = PLACE.fullmatch(text)
    if found is None or found["name"] not in names:
        raise FormatError(
            f"{where}: '{shown(text)}' is none of the progressions {', '.join(map(shown, names))}, "
            "nor a step of one such as NAME.2"
        )
    step = None if found["step"] is None else int(found["step"]) - 1
    return Place(names.index(found["name"]), step)


def _number(text: str, where: str) -> float:
    try:
        return min(float(text), 1e9)
    except ValueError:
        raise FormatError(f"{where}: '{text}' is no number of seconds") from None
