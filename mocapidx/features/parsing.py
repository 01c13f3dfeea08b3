"""Read the TOML text of a feature set and check everything that it says.

A set may come from anywhere, so nothing in it may crash, hang or exhaust memory, and each
mistake is one line that names the feature, the key and what was expected.
"""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NoReturn

from mocapidx.errors import FeatureSetError
from mocapidx.features.kinds import KINDS, UNITS, Place
from mocapidx.features.relations import (
    COMBINATIONS,
    Condition,
    Feature,
    Threshold,
    joint_names,
    leaves,
    mirrored,
    normal_form,
)
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.toml_files import parse_toml

__all__ = ["PARTS", "read_document"]

PARTS: Final = ("upper", "lower", "mix")
RESERVED: Final = (*PARTS, "all", "any", "none", "auto", "relax")
MAX_FEATURES: Final = 64
MAX_IN_PART: Final = 31  # a word of 32 ones means something else in a sub-index
MAX_CONDITIONS: Final = 64
MAX_LEVELS: Final = 8

SET_KEYS: Final = ("name", "source", "feature")
CONDITION_KEYS: Final = ("kind", "joints", "unit", "when", "on", "off", "of")
FEATURE_KEYS: Final = ("id", "name", "part", "mirror", *CONDITION_KEYS)
MIRRORED_KEYS: Final = ("id", "name", "mirror_of")


@dataclass(frozen=True, slots=True)
class _Place:
    """Where in a file something stands: the beginning of a message."""

    where: str

    def within(self, entry: str) -> "_Place":
        return _Place(f"{self.where}: {entry}")

    def fail(self, message: str) -> NoReturn:
        raise FeatureSetError(f"{self.where}: {message}")


def read_document(text: str, where: str) -> tuple[str, str, tuple[Feature, ...]]:
    """Return name, source and features of the TOML text of a feature set.

    Parameters
    ----------
    text : str
        The text, at most 1 MiB.
    where : str
        What messages call it.

    Returns
    -------
    name, source : str
    features : tuple of Feature

    Raises
    ------
    FeatureSetError
        If the text is not TOML or says something that a feature set can't.
    """
    place = _Place(where)
    document = parse_toml(text, where, FeatureSetError)
    _check_keys(document, SET_KEYS, place)
    name = _word(document, "name", place)
    source = _text(document, "source", place)
    tables = document.get("feature")
    if not isinstance(tables, list) or not tables:
        place.fail("key 'feature': expected one [[feature]] table for each feature")
    if len(tables) > MAX_FEATURES:
        place.fail(f"has {len(tables)} features; a set has at most {MAX_FEATURES}")
    return name, source, _features(tables, place)


def _features(tables: list[Any], place: _Place) -> tuple[Feature, ...]:
    """Read the features in the order of the file; a table may name those before it."""
    known: dict[str, Feature] = {}
    partners: dict[str, str | None] = {}
    counts = dict.fromkeys(PARTS, 0)
    for number, table in enumerate(tables, start=1):
        nth = place.within(f"feature number {number}")
        if not isinstance(table, dict):
            nth.fail("expected a [[feature]] table")
        key = _word(table, "id", nth)
        here = place.within(f"feature {key}")
        if key.lower() in RESERVED:
            here.fail(f"key 'id': {key!r} has a meaning of its own in selections")
        if key.lower() in (other.lower() for other in known):
            here.fail("key 'id': stands twice")
        if "mirror_of" in table:
            feature = _mirrored_feature(table, key, known, partners, here)
        else:
            feature = _written_feature(table, key, known, here)
            partners[key] = feature.mirror or None
        known[key] = feature
        counts[feature.part] += 1
        if counts[feature.part] > MAX_IN_PART:
            here.fail(f"key 'part': {feature.part!r} has more than {MAX_IN_PART} features")
    return tuple(_with_partner(feature, known, partners, place) for feature in known.values())


def _written_feature(
    table: Mapping[str, Any], key: str, known: Mapping[str, Feature], here: _Place
) -> Feature:
    _check_keys(table, FEATURE_KEYS, here)
    if (part := table.get("part")) not in PARTS:
        here.fail(f"key 'part': {_found(table, 'part')}, expected {_either(PARTS)}")
    mirror = _word(table, "mirror", here) if "mirror" in table else ""
    name = _text(table, "name", here) if "name" in table else key
    condition = _condition(
        {k: v for k, v in table.items() if k in CONDITION_KEYS}, known, here, level=1
    )
    return Feature(key, name, part, mirror, condition)


def _mirrored_feature(
    table: Mapping[str, Any],
    key: str,
    known: Mapping[str, Feature],
    partners: dict[str, str | None],
    here: _Place,
) -> Feature:
    _check_keys(table, MIRRORED_KEYS, here)
    other = _word(table, "mirror_of", here)
    if other not in known:
        here.fail(f"key 'mirror_of': no feature {other!r} stands before this one")
    if partners[other] not in (None, key):
        here.fail(f"key 'mirror_of': {other} is the mirror of {partners[other]} already")
    partners[other], partners[key] = key, other
    name = _text(table, "name", here) if "name" in table else key
    condition = mirrored(known[other].condition)
    return Feature(key, name, known[other].part, other, condition)


def _with_partner(
    feature: Feature,
    known: Mapping[str, Feature],
    partners: Mapping[str, str | None],
    place: _Place,
) -> Feature:
    """Check that the mirror of a feature is what it says on the other side of the body."""
    here = place.within(f"feature {feature.id}")
    partner = partners[feature.id]
    image = normal_form(mirrored(feature.condition))
    if partner is None:
        if image != normal_form(feature.condition):
            here.fail(
                "key 'mirror': missing; the feature is not its own mirror image, so add a "
                f"feature with mirror_of = {feature.id!r}"
            )
        return replace(feature, mirror=feature.id)
    if partner not in known:
        here.fail(f"key 'mirror': there is no feature {partner!r}")
    if partners[partner] != feature.id:
        here.fail(
            f"key 'mirror': is {partner}, whose own mirror is {partners[partner] or 'not given'}"
        )
    if known[partner].part != feature.part or image != normal_form(known[partner].condition):
        here.fail(
            f"key 'mirror': {partner} is not this feature with left and right exchanged; "
            f"write it as mirror_of = {feature.id!r}"
        )
    return replace(feature, mirror=partner)


def _condition(
    table: Mapping[str, Any], known: Mapping[str, Feature], here: _Place, level: int
) -> Condition:
    """Read a generic feature or a combination from its table."""
    kind = table.get("kind")
    if kind in COMBINATIONS:
        return _combination(table, str(kind), known, here, level)
    if not isinstance(kind, str) or kind not in KINDS:
        expected = _either((*KINDS, *COMBINATIONS))
        here.fail(f"key 'kind': {_found(table, 'kind')}, expected {expected}")
    _check_keys(table, [k for k in CONDITION_KEYS if k != "of"], here)
    units = UNITS[KINDS[kind].quantity]
    if (unit := table.get("unit")) not in units:
        here.fail(f"key 'unit': {_found(table, 'unit')}, {kind} has {_either(units)}")
    joints = _joints(table, kind, here)
    when, on, off = _thresholds(table, kind, here)
    return Condition(kind=kind, joints=joints, unit=unit, when=when, on=on, off=off)


def _combination(
    table: Mapping[str, Any], kind: str, known: Mapping[str, Feature], here: _Place, level: int
) -> Condition:
    _check_keys(table, ("kind", "of"), here)
    entries = table.get("of")
    if not isinstance(entries, list) or not entries:
        here.fail("key 'of': expected a list of conditions, or of ids of features above")
    if kind == "not" and len(entries) != 1:
        here.fail(f"key 'of': 'not' has one condition, found {len(entries)}")
    if level > MAX_LEVELS or len(entries) > MAX_CONDITIONS:
        here.fail(f"key 'of': more than {MAX_LEVELS} levels or {MAX_CONDITIONS} conditions")
    parts = []
    for number, entry in enumerate(entries, start=1):
        inner = here.within(f"condition {number} of '{kind}'")
        if isinstance(entry, str):
            if entry not in known:
                inner.fail(f"no feature {_shown(entry)} stands before this one")
            parts.append(known[entry].condition)
        elif isinstance(entry, dict):
            _check_keys(entry, CONDITION_KEYS, inner)
            parts.append(_condition(entry, known, inner, level + 1))
        else:
            inner.fail(f"expected a table or the id of a feature, found {_shown(entry)}")
    combination = Condition(kind=kind, of=tuple(parts))
    if sum(1 for part in parts for _ in leaves(part)) > MAX_CONDITIONS:
        here.fail(f"key 'of': more than {MAX_CONDITIONS} conditions in all")
    return combination


def _joints(table: Mapping[str, Any], kind: str, here: _Place) -> tuple[Place, ...]:
    count = KINDS[kind].count
    found = table.get("joints", [])
    if not isinstance(found, list) or len(found) != count:
        here.fail(f"key 'joints': {_found(table, 'joints')}, {kind} needs {count} joints")
    places = tuple(_one_place(entry, kind, here) for entry in found)
    for first, second in KINDS[kind].apart:
        shared = set(joint_names(places[first : first + 1])) & set(
            joint_names(places[second : second + 1])
        )
        if shared:
            here.fail(
                f"key 'joints': {kind} needs different joints in the places {first + 1} and "
                f"{second + 1}, found {shared.pop()!r} in both"
            )
    return places


def _one_place(entry: Any, kind: str, here: _Place) -> Place:
    if isinstance(entry, list) and kind == "touch":
        if len(entry) != 2 or any(isinstance(joint, list) for joint in entry):
            here.fail(f"key 'joints': a segment has two joints, found {_shown(entry)}")
        start, end = (str(_one_place(joint, kind, here)) for joint in entry)
        if start == end:
            here.fail(f"key 'joints': a segment has two different joints, found {start!r} twice")
        return start, end
    if not isinstance(entry, str) or entry not in CANONICAL_JOINTS:
        here.fail(
            f"key 'joints': {_shown(entry)} is no joint; the joints are "
            f"{', '.join(CANONICAL_JOINTS)}"
        )
    return entry


def _thresholds(
    table: Mapping[str, Any], kind: str, here: _Place
) -> tuple[str, Threshold, Threshold]:
    """Read both thresholds; the weaker one must hold wherever the stronger one does."""
    on, off = _threshold(table, "on", here), _threshold(table, "off", here)
    if isinstance(on, tuple) and isinstance(off, tuple):
        if "when" in table:
            here.fail("key 'when': a range has no sides; leave it out")
        if not off[0] <= on[0] <= on[1] <= off[1]:
            here.fail(f"key 'off': the range {list(off)} must contain the range {list(on)} of 'on'")
        return "within", on, off
    if isinstance(on, tuple) or isinstance(off, tuple):
        here.fail("key 'off': give two numbers or two ranges for 'on' and 'off'")
    when = table.get("when", "below" if kind == "touch" else "above")
    if when not in ("above", "below"):
        here.fail(f"key 'when': {_found(table, 'when')}, expected 'above' or 'below'")
    if on < off if when == "above" else on > off:
        order = "not above" if when == "above" else "not below"
        here.fail(f"key 'off': with when = '{when}', off ({off:g}) must be {order} on ({on:g})")
    return when, on, off


def _threshold(table: Mapping[str, Any], key: str, here: _Place) -> Threshold:
    found: Any = table.get(key)
    numbers: list[Any] = found if isinstance(found, list) else [found]
    if not all(_is_number(number) for number in numbers) or len(numbers) not in (1, 2):
        here.fail(f"key '{key}': {_found(table, key)}, expected a number or a range [low, high]")
    if isinstance(found, list):
        if len(numbers) != 2:
            here.fail(f"key '{key}': a range has two numbers, found {_shown(found)}")
        return float(numbers[0]), float(numbers[1])
    return float(numbers[0])


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= 1e9 and math.isfinite(value)


def _check_keys(table: Mapping[str, Any], allowed: Iterable[str], here: _Place) -> None:
    for key in table:
        if key not in allowed:
            here.fail(f"unknown key {_shown(key)}; expected {_either(tuple(allowed))}")


def _word(table: Mapping[str, Any], key: str, here: _Place) -> str:
    word = table.get(key)
    if not isinstance(word, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_.-]{0,63}", word):
        here.fail(
            f"key '{key}': {_found(table, key)}, expected a letter and up to 63 letters, digits, "
            "dots, hyphens or underscores"
        )
    return word


def _text(table: Mapping[str, Any], key: str, here: _Place) -> str:
    text = table.get(key)
    if not isinstance(text, str) or not 0 < len(text) <= 500 or not text.isprintable():
        here.fail(f"key '{key}': {_found(table, key)}, expected one line of text")
    return text


def _found(table: Mapping[str, Any], key: str) -> str:
    return f"found {_shown(table[key])}" if key in table else "missing"


def _shown(value: Any, limit: int = 80) -> str:
    """Return a value as a message may show it: short, printable, on one line."""
    text = ascii(value)
    return text if len(text) <= limit else f"{text[:limit]}..."


def _either(words: tuple[str, ...]) -> str:
    *most, last = words
    return f"{', '.join(most)} or {last}" if most else last
