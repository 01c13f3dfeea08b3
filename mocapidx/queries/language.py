"""Steps in words of the body: ``right knee bent, not right foot raised | left knee bent``.

The grammar, for one step::

    step        = "*" | alternative { "|" alternative }
    alternative = condition { "," condition }
    condition   = [ "not" ] feature [ "=" ( "0" | "1" ) ]

A feature is an id or a name of the feature set, in upper or lower case. ``*`` is open.
"""

import difflib
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.features.featureset import FeatureSet
from mocapidx.printable import count, shown
from mocapidx.queries.pattern import UNLIMITED, Block, Pattern
from mocapidx.queries.steps import FuzzyQuery, FuzzySet

__all__ = ["MOST_STEPS", "Step", "describe", "parse_short", "parse_step", "pattern_from_steps"]

MOST_STEPS: Final = 1000
MOST_TEXT: Final = 1 << 16  # characters of a short form
REPEATED: Final = re.compile(r"([0-9]{1,4})x\(([^()]*)\)", re.ASCII)
SHORT: Final = re.compile(r"(?P<word>\*|[01x|]+)(?:@(?P<low>[0-9.]*):(?P<high>[0-9.]*))?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a pattern.

    Parameters
    ----------
    demand : FuzzySet or None
        None: open.
    low, high : float
        How long it may last, in seconds.
    """

    demand: FuzzySet | None
    low: float = 0.0
    high: float = math.inf


def parse_step(text: str, feature_set: FeatureSet) -> FuzzySet | None:
    """Understand what a step demands.

    Parameters
    ----------
    text : str
        By the grammar of this module.
    feature_set : FeatureSet

    Returns
    -------
    FuzzySet or None
        None for ``*``.

    Raises
    ------
    ParameterError
        If a condition names no feature, or contradicts another one.
    """
    if text.strip() == "*":
        return None
    return FuzzySet(tuple(_alternative(part, feature_set) for part in text.split("|")))


def _alternative(text: str, feature_set: FeatureSet) -> tuple[int, int]:
    mask = value = 0
    for condition in text.split(","):
        name, equals, digit = condition.partition("=")
        name, wanted = " ".join(name.split()), True
        if equals and digit.strip() not in ("0", "1"):
            raise ParameterError(f"'{shown(condition.strip())}': a feature is = 0 or = 1")
        if name.lower().startswith("not "):
            name, wanted = name[4:], False
        bit = _feature(name, feature_set)
        bits = bit if wanted != (digit.strip() == "0") else 0
        if mask & bit and value & bit != bits:
            raise ParameterError(f"'{shown(text.strip())}': demands '{shown(name)}' to be 0 and 1")
        mask, value = mask | bit, value | bits
    return mask, value


def _feature(name: str, feature_set: FeatureSet) -> int:
    """Give the bit of a feature by its id or name."""
    names: dict[str, int] = {}
    for bit, feature in enumerate(feature_set.features):
        names[feature.id.lower()] = names[" ".join(feature.name.lower().split())] = 1 << bit
    if name.lower() in names:
        return names[name.lower()]
    near = difflib.get_close_matches(name.lower(), names, n=1)
    hint = f"; is '{near[0]}' meant?" if near else f", such as '{feature_set.features[0].name}'"
    raise ParameterError(
        f"'{shown(name)}' is no id or name of a feature of {shown(feature_set.name)}{hint}"
    )


def parse_short(features: str, text: str, feature_set: FeatureSet) -> list[Step]:
    """Understand the short form: words of 0, 1 and x (either) over some features.

    Parameters
    ----------
    features : str
        Ids or names, separated by commas; the digits of a word are in their order.
    text : str
        Words such as ``00 10 1x 01|10 *``; ``10@0.2:1.5`` lasts 0.2 to 1.5 seconds, either of
        them may be left out; ``3x(1 0)`` is ``1 0 1 0 1 0``.
    feature_set : FeatureSet

    Returns
    -------
    list of Step

    Raises
    ------
    ParameterError
        If a word can't be understood, or has not one digit for each feature.
    """
    bits = [_feature(" ".join(name.split()), feature_set) for name in features.split(",")]
    if len(set(bits)) < len(bits):
        raise ParameterError(f"'{shown(features)}': names a feature twice")
    words = _written_out(text).split()
    if not words:
        raise ParameterError("a pattern needs a step")
    return [_short_step(word, bits) for word in words]


def _written_out(text: str) -> str:
    """Write repetitions out, the inner ones first."""
    while found := REPEATED.search(text):
        times, body = int(found[1]), found[2].split()
        if not 1 <= times * len(body) <= MOST_STEPS or len(text) > MOST_TEXT:
            raise ParameterError(f"'{shown(found[0])}': repeats 1 to {MOST_STEPS} steps in all")
        text = f"{text[: found.start()]} {' '.join(body * times)} {text[found.end() :]}"
    return text


def _short_step(text: str, bits: Sequence[int]) -> Step:
    found = SHORT.fullmatch(text)
    if found is None:
        raise ParameterError(
            f"'{shown(text)}' is no step: words of 0, 1, x such as 10, 1x, 01|10, or *, and "
            "their seconds such as 10@0.2:1.5"
        )
    try:
        low, high = float(found["low"] or 0), float(found["high"] or math.inf)
    except ValueError:
        raise ParameterError(f"'{shown(text)}': seconds such as @0.2:1.5") from None
    if low > high:
        raise ParameterError(f"'{shown(text)}': at least {low:g} s but at most {high:g} s")
    if found["word"] == "*":
        return Step(None, low, high)
    cubes = []
    for word in found["word"].split("|"):
        if len(word) != len(bits):
            raise ParameterError(
                f"'{shown(text)}': {count(len(word), 'digit')} for {count(len(bits), 'feature')}"
            )
        digits = list(zip(word, bits, strict=True))
        mask = sum(bit for digit, bit in digits if digit != "x")
        cubes.append((mask, sum(bit for digit, bit in digits if digit == "1")))
    if any(mask == 0 for mask, _ in cubes):
        return Step(None, low, high)
    return Step(FuzzySet(tuple(cubes)), low, high)


def pattern_from_steps(steps: Sequence[Step], rate: float) -> Pattern:
    """Turn steps into a pattern.

    Parameters
    ----------
    steps : sequence of Step
    rate : float
        Frames a second, in Hz.

    Returns
    -------
    Pattern
        Open steps are the gaps between its blocks; those next to each other are one.

    Raises
    ------
    ParameterError
        If all steps are open, there are too many, or an open one at an end has a duration.
    """
    if len(steps) > MOST_STEPS:
        raise ParameterError(f"{len(steps)} steps; a pattern has at most {MOST_STEPS}")
    if not steps:
        raise ParameterError("a pattern needs a step")
    closed = [place for place, step in enumerate(steps) if step.demand is not None]
    if not closed:
        raise ParameterError("every step is open, so every motion would match")
    for step in (*steps[: closed[0]], *steps[closed[-1] + 1 :]):
        if step != Step(None):
            raise ParameterError("an open step at the beginning or the end can't have a duration")
    blocks: list[Block] = []
    gaps: list[tuple[int, int]] = []
    for open_, some in _grouped(steps[closed[0] : closed[-1] + 1]):
        if open_:
            gap = Step(None, sum(step.low for step in some), sum(step.high for step in some))
            gaps.append(_frames(gap, rate))
        else:
            blocks.append(_block(some, rate))
    return Pattern(tuple(blocks), tuple(gaps))


def _grouped(steps: Sequence[Step]) -> Iterator[tuple[bool, list[Step]]]:
    some: list[Step] = []
    for step in steps:
        if some and (step.demand is None) != (some[-1].demand is None):
            yield some[-1].demand is None, some
            some = []
        some.append(step)
    yield some[-1].demand is None, some


def _block(steps: Sequence[Step], rate: float) -> Block:
    bounds = np.array([_frames(step, rate) for step in steps], np.int64)
    query = FuzzyQuery(
        tuple(step.demand for step in steps if step.demand is not None),
        np.zeros(len(steps), np.int64),
    )
    return Block(query, bounds[:, 0], bounds[:, 1], np.ones(len(steps), np.bool_))


def _frames(step: Step, rate: float) -> tuple[int, int]:
    """Give the least and the greatest number of frames; a hair of rounding is forgiven."""
    low, high = min(step.low * rate, UNLIMITED), min(step.high * rate, UNLIMITED)
    return math.ceil(low - 1e-6), math.floor(high + 1e-6)


def describe(step: FuzzySet, feature_set: FeatureSet, longest: int = 6) -> str:
    """Say what a step demands, by the names of the features.

    Parameters
    ----------
    step : FuzzySet
    feature_set : FeatureSet
    longest : int
        Of more features than these only those that are on are named, and the rest counted; of
        more alternatives only the first.

    Returns
    -------
    str
        By the grammar of this module, where nothing is left out.
    """
    texts = [_conditions(mask, value, feature_set, longest) for mask, value in step.cubes[:longest]]
    more = len(step.cubes) - longest
    return " | ".join(texts) + (f" | {more} more" if more > 0 else "")


def _conditions(mask: int, value: int, feature_set: FeatureSet, longest: int) -> str:
    names = {1 << bit: feature.name for bit, feature in enumerate(feature_set.features)}
    on = [name for bit, name in names.items() if value & bit]
    off = [name for bit, name in names.items() if mask & ~value & bit]
    if len(on) + len(off) <= longest:
        return ", ".join([*on, *(f"not {name}" for name in off)])
    return ", ".join([*on, f"none of {len(off)} others"])
