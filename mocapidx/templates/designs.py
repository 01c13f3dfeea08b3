"""Templates from TOML: changes to learned ones, and new ones without any training."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NoReturn

from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.featureset import FeatureSet
from mocapidx.printable import shown
from mocapidx.templates.edit import UNDECIDED, new_template, set_entries, with_keyframes
from mocapidx.templates.template import LONGEST_TEMPLATE, MotionTemplate, TemplateSet
from mocapidx.toml_files import parse_toml

__all__ = ["Block", "Design", "Designs", "apply_design", "parse_designs"]

FILE_KEYS: Final = ("feature_set", "rate", "template")
TEMPLATE_KEYS: Final = (
    "class",
    "as",
    "frames",
    "delta",
    "tau",
    "keyframes",
    "keyframe_tolerance",
    "set",
)
BLOCK_KEYS: Final = ("features", "frames", "seconds", "value")


@dataclass(frozen=True, slots=True)
class Block:
    """Entries that get one value.

    Parameters
    ----------
    features : str
        As in `FeatureSet.select`.
    value : float
        From 0 to 1; 0.5 is undecided.
    start, end : float or None
        Half open; None: from the beginning, to the end.
    unit : {"frames", "seconds"}
        Of start and end.
    """

    features: str
    value: float
    start: float | None = None
    end: float | None = None
    unit: Literal["frames", "seconds"] = "frames"

    def frames(self, rate: float) -> tuple[int, int | None]:
        """Return start and end in frames; None: to the end."""
        scale = rate if self.unit == "seconds" else 1.0
        end = None if self.end is None else round(self.end * scale)
        return round((self.start or 0) * scale), end


@dataclass(frozen=True, slots=True)
class Design:
    """What is to be done with one class.

    Parameters
    ----------
    label : str
        The class.
    new_label : str or None
        Leave the class as it is and give this name to the changed copy.
    frames : int or None
        Length of a new template; None: change the one there is.
    delta, tau : float or None
        None: as they are.
    keyframes : tuple of int or None
        None: as they are.
    keyframe_tolerance : int
    blocks : tuple of Block
        In their order; a later one wins where two meet.
    where : str
        What messages call it.
    """

    label: str
    new_label: str | None
    frames: int | None
    delta: float | None
    tau: float | None
    keyframes: tuple[int, ...] | None
    keyframe_tolerance: int
    blocks: tuple[Block, ...]
    where: str


@dataclass(frozen=True, slots=True)
class Designs:
    """What a file says.

    Parameters
    ----------
    feature_set : str or None
        Name or path, for new templates.
    rate : float or None
        In Hz, for new templates.
    designs : tuple of Design
    """

    feature_set: str | None
    rate: float | None
    designs: tuple[Design, ...]


def apply_design(
    design: Design, templates: TemplateSet, feature_set: FeatureSet
) -> tuple[MotionTemplate, ...]:
    """Make the templates that a design describes.

    Parameters
    ----------
    design : Design
    templates : TemplateSet
        Those there are; a new template gets their feature set and rate.
    feature_set : FeatureSet
        The same, parsed.

    Returns
    -------
    tuple of MotionTemplate
        All of one class; the class is changed as a whole, with its stretch templates.

    Raises
    ------
    FormatError
        If there is no such class, or a value does not fit; the message names the place.
    """
    label = design.label if design.new_label is None else design.new_label
    try:
        if design.frames is None:
            given = templates.of(design.label)
        else:
            features, rate = len(feature_set.features), templates.rate
            given = (new_template(label, design.frames, features, feature_set.digest, rate),)
        return tuple(_changed(replace(each, label=label), design, feature_set) for each in given)
    except ParameterError as exc:
        raise FormatError(f"{design.where}: {exc}") from exc


def _changed(template: MotionTemplate, design: Design, feature_set: FeatureSet) -> MotionTemplate:
    if design.delta is not None:
        template = replace(
            template, delta=design.delta, positive_cost=None, background_cost=None, tau=None
        )
    for block in design.blocks:
        mask = feature_set.select(block.features)
        template = set_entries(template, block.value, mask, *block.frames(template.rate))
    if design.tau is not None:
        template = replace(template, tau=design.tau)
    if design.keyframes is not None:
        template = with_keyframes(template, design.keyframes, design.keyframe_tolerance)
    return template


@dataclass(frozen=True, slots=True)
class _Table:
    """A TOML table and where it stands: the beginning of a message."""

    values: dict[str, Any]
    where: str

    def fail(self, message: str) -> NoReturn:
        raise FormatError(f"{self.where}: {message}")

    def check_keys(self, known: Sequence[str]) -> None:
        for key in self.values:
            if key not in known:
                self.fail(f"unknown key '{shown(key)}'; expected {', '.join(known)}")

    def text(self, key: str) -> str | None:
        value = self.values.get(key)
        if value is not None and (type(value) is not str or not value.strip()):
            self.fail(f"key '{key}': expected a text")
        return value

    def needed(self, key: str) -> str:
        value = self.text(key)
        if value is None:
            self.fail(f"key '{key}' is missing")
        return value

    def number(self, key: str, low: float, high: float) -> float | None:
        value = self.values.get(key)
        if value is not None and not _is_number(value, low, high):
            self.fail(f"key '{key}': expected a number from {low:g} to {high:g}")
        return None if value is None else float(value)

    def count(self, key: str, low: int, high: int) -> int | None:
        value = self.values.get(key)
        if value is not None and (type(value) is not int or not low <= value <= high):
            self.fail(f"key '{key}': expected a whole number from {low} to {high}")
        return value

    def tables(self, key: str) -> list["_Table"]:
        values = self.values.get(key, [])
        if type(values) is not list or any(type(value) is not dict for value in values):
            self.fail(f"key '{key}': expected [[{key}]] tables")
        return [
            _Table(value, f"{self.where}: {key} number {number}")
            for number, value in enumerate(values, start=1)
        ]


def parse_designs(text: str, where: str) -> Designs:
    """Read and check the TOML text of changes to templates.

    Parameters
    ----------
    text : str
        See ``docs/template-editing.md`` for its form.
    where : str
        What messages call it, usually the path of the file.

    Returns
    -------
    Designs

    Raises
    ------
    FormatError
        If the text is not TOML or says something that can't be; the message names table and key.
    """
    document = _Table(parse_toml(text, where), where)
    document.check_keys(FILE_KEYS)
    tables = document.tables("template")
    if not tables:
        document.fail("has no [[template]] table")
    return Designs(
        feature_set=document.text("feature_set"),
        rate=document.number("rate", 1.0, 1000.0),
        designs=tuple(map(_design, tables)),
    )


def _design(table: _Table) -> Design:
    table.check_keys(TEMPLATE_KEYS)
    keyframes = table.values.get("keyframes")
    if keyframes is not None and (
        type(keyframes) is not list or any(type(row) is not int for row in keyframes)
    ):
        table.fail("key 'keyframes': expected a list of frames")
    delta = table.number("delta", 0.0, 0.5)
    return Design(
        label=table.needed("class"),
        new_label=table.text("as"),
        frames=table.count("frames", 1, LONGEST_TEMPLATE),
        delta=delta,
        tau=table.number("tau", 0.0, 1.0),
        keyframes=None if keyframes is None else tuple(keyframes),
        keyframe_tolerance=table.count("keyframe_tolerance", 0, 64) or 0,
        blocks=tuple(map(_block, table.tables("set"))),
        where=table.where,
    )


def _block(table: _Table) -> Block:
    table.check_keys(BLOCK_KEYS)
    if "value" not in table.values:
        table.fail("key 'value' is missing")
    undecided = table.values["value"] == "undecided"
    value = UNDECIDED if undecided else table.number("value", 0.0, 1.0)
    if "frames" in table.values and "seconds" in table.values:
        table.fail("has both 'frames' and 'seconds'; say one")
    unit: Literal["frames", "seconds"] = "seconds" if "seconds" in table.values else "frames"
    start, end = _range(table, unit)
    return Block(table.needed("features"), float(value or 0.0), start, end, unit)


def _range(table: _Table, unit: str) -> tuple[float | None, float | None]:
    limits = table.values.get(unit)
    if limits is None:
        return None, None
    if (
        type(limits) is not list
        or len(limits) != 2
        or not all(_is_number(limit, 0, math.inf) for limit in limits)
        or not limits[0] < limits[1]
    ):
        table.fail(f"key '{unit}': expected two rising numbers, [START, END], END left out")
    if unit == "frames" and any(type(limit) is not int for limit in limits):
        table.fail("key 'frames': expected whole numbers")
    return limits[0], limits[1]


def _is_number(value: Any, low: float, high: float) -> bool:
    return type(value) in (int, float) and low <= value <= high and value < 1e15
