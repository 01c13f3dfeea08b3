"""Parameters of a motion: what a user steers, such as where the foot of a kick goes.

They are given in TOML, one table ``[[parameter]]`` for each; ``docs/blending.md`` has them all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.toml_files import parse_toml

__all__ = ["Measure", "Parameters", "When", "measure", "parse_parameters"]

QUANTITIES: Final = {
    "position": "m", "height": "m", "distance": "m", "speed": "m/s",
    "angle": "degrees", "facing": "degrees", "duration": "s",
}  # fmt: skip
JOINTED: Final = frozenset(QUANTITIES) - {"facing", "duration"}
MOMENTS: Final = ("start", "end", "mean", "max", "min")
KEYS: Final = {
    "position": {"axes", "relative_to"}, "distance": {"from"}, "angle": {"between"},
}  # fmt: skip
DEGREES_LIKE_A_METRE: Final = 180 / np.pi
MOST: Final = 6
"""Numbers that a motion can be steered by; the examples needed grow with their power."""


@dataclass(frozen=True, slots=True)
class When:
    """At which moment something is measured.

    Parameters
    ----------
    kind : {"start", "end", "mean", "max", "min", "time"}
        Of the motion; ``max`` and ``min``: where `of`, or else the quantity itself, is largest
        or smallest; ``time``: at a time of the first example.
    of : Measure or None
    seconds : float
        From the start of the first example, for ``time``.
    """

    kind: str
    of: "Measure | None" = None
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class Measure:
    """One table of a parameter file: a quantity at a moment.

    Parameters
    ----------
    what : str
        One of the quantities.
    when : When
    joints : tuple of str
        The joint measured, and those it is measured against.
    axes : str
        Of a position: some of ``xyz``.
    """

    what: str
    when: When
    joints: tuple[str, ...] = ()
    axes: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each number."""
        parts = [*self.joints[:1], self.what]
        name = " ".join(p for p in parts if p != "position")
        return tuple(f"{name} {axis}" for axis in self.axes) or (name,)

    @property
    def all_joints(self) -> tuple[str, ...]:
        """The joints that have to be known."""
        own = ("root", "lhip", "rhip") if self.what == "facing" else self.joints
        return own + (self.when.of.all_joints if self.when.of else ())


@dataclass(frozen=True, slots=True)
class Parameters:
    """What a motion is steered by.

    Parameters
    ----------
    name : str
    measures : tuple of Measure
    text : str
        The TOML.
    """

    name: str
    measures: tuple[Measure, ...]
    text: str

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each number."""
        return tuple(name for measure in self.measures for name in measure.names)

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of each number."""
        return tuple(QUANTITIES[m.what] for m in self.measures for _ in m.names)

    @property
    def scales(self) -> FloatArray:
        """How much of each counts as much as a metre: a metre a second, a second, a radian."""
        return np.array([DEGREES_LIKE_A_METRE if u == "degrees" else 1.0 for u in self.units])

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that have to be known."""
        return tuple(dict.fromkeys(j for measure in self.measures for j in measure.all_joints))


def parse_parameters(text: str, where: str) -> Parameters:
    """Read a parameter file.

    Parameters
    ----------
    text : str
        TOML.
    where : str
        What messages call it.

    Returns
    -------
    what : Parameters

    Raises
    ------
    FormatError
        If it is none; the message names the parameter and the key.
    """
    document = parse_toml(text, where)
    extra = document.keys() - {"name", "parameter"}
    if extra:
        raise FormatError(f"{where}: unknown key '{shown(min(extra), 40)}'")
    tables = document.get("parameter")
    if type(tables) is not list or not tables or any(type(t) is not dict for t in tables):
        raise FormatError(f"{where}: no [[parameter]] in it; see docs/blending.md")
    name = document.get("name", "")
    if type(name) is not str:
        raise FormatError(f"{where}: 'name' is no text")
    measures = tuple(
        _measure(table, f"{where}: parameter {number}")
        for number, table in enumerate(tables, start=1)
    )
    parameters = Parameters(name, measures, text)
    if len(parameters.names) > MOST:
        raise FormatError(f"{where}: {len(parameters.names)} numbers to steer by, at most {MOST}")
    return parameters


def _measure(table: Mapping[str, Any], where: str, *, inner: bool = False) -> Measure:
    joints: tuple[str, ...]
    what = table.get("what", "position")
    if type(what) is not str or what not in QUANTITIES:
        expected = ", ".join(QUANTITIES)
        raise FormatError(f"{where}: 'what' is {shown(repr(what), 40)}, expected one of {expected}")
    known = {"what", "when"} | KEYS.get(what, set()) | ({"joint"} if what in JOINTED else set())
    extra = table.keys() - known
    if extra:
        raise FormatError(f"{where}: '{shown(min(extra), 40)}' is no key for {what}")
    joints = (_joint(table, "joint", where),) if what in JOINTED else ()
    axes = ""
    if what == "position":
        axes = table.get("axes", "xyz")
        if (
            type(axes) is not str
            or not axes
            or not set(axes) <= set("xyz")
            or (len(set(axes)) < len(axes))
        ):
            raise FormatError(f"{where}: 'axes' is {shown(repr(axes), 40)}, expected some of xyz")
        if table.get("relative_to", "start") != "start":
            joints += (_joint(table, "relative_to", where),)
    elif what == "distance":
        joints += (_joint(table, "from", where),)
    elif what == "angle":
        ends = table.get("between")
        if type(ends) is not list or len(ends) != 2:
            raise FormatError(f"{where}: 'between' must name two joints")
        joints += tuple(_joint({"between": end}, "between", where) for end in ends)
    if inner and what == "position":
        raise FormatError(f"{where}: a position has no largest or smallest; use height or distance")
    when = When("end") if inner or what == "duration" else _when(table.get("when"), what, where)
    return Measure(what, when, joints, axes)


def _joint(table: Mapping[str, Any], key: str, where: str) -> str:
    name = table.get(key)
    if type(name) is not str or name not in CANONICAL_JOINTS:
        found = "is missing" if name is None else f"is {shown(repr(name), 40)}"
        raise FormatError(
            f"{where}: '{key}' {found}; expected one of the joints {', '.join(CANONICAL_JOINTS)}"
        )
    return name


def _when(value: Any, what: str, where: str) -> When:
    if type(value) in (int, float) and 0 <= value < 1e6:
        return When("time", seconds=float(value))
    if type(value) is str and value in MOMENTS:
        if what == "position" and value in ("max", "min"):
            raise FormatError(
                f"{where}: a position has no {value}; say of what, as in "
                f'when = {{ {value} = "height", joint = "rankle" }}'
            )
        return When(value)
    if type(value) is dict:
        kinds = [kind for kind in ("max", "min") if kind in value]
        if len(kinds) == 1:
            rest = {key: v for key, v in value.items() if key != kinds[0]}
            table = rest | {"what": value[kinds[0]]}
            if "when" not in rest and table["what"] != "duration":
                return When(kinds[0], _measure(table, f"{where}: when", inner=True))
    found = "is missing" if value is None else f"is {shown(repr(value), 40)}"
    raise FormatError(
        f"{where}: 'when' {found}; expected one of {', '.join(MOMENTS)}, seconds of the first "
        'example, or { max = "height", joint = "rankle" }'
    )


def measure(
    parameters: Parameters, points: FloatArray, times: FloatArray, first_times: FloatArray
) -> FloatArray:
    """Measure a motion.

    Parameters
    ----------
    parameters : Parameters
    points : ndarray of float, shape (T, 24, 3)
        The canonical joints, in metres, in the frame that the motion starts in.
    times : ndarray of float, shape (T,)
        When the frames are, in seconds; increasing.
    first_times : ndarray of float, shape (T,)
        The times of the first example that go with them, in seconds; increasing.

    Returns
    -------
    ndarray of float64, shape (D,)
        In the units of `Parameters.units`.
    """
    return np.concatenate([_at(m, points, times, first_times) for m in parameters.measures])


def _at(
    measure: Measure, points: FloatArray, times: FloatArray, first_times: FloatArray
) -> FloatArray:
    when = measure.when
    if measure.what == "duration":
        return times[-1:] - times[:1]
    values = _course(measure, points, times)
    if when.kind in ("start", "end"):
        chosen: FloatArray = values[0 if when.kind == "start" else -1]
        return chosen
    if when.kind == "time":
        return np.array([np.interp(when.seconds, first_times, column) for column in values.T])
    if when.kind == "mean":
        spans = np.diff(times)
        middles = (values[1:] + values[:-1]) / 2
        mean: FloatArray = spans @ middles / spans.sum()
        return mean
    course = values if when.of is None else _course(when.of, points, times)
    at = _extreme(course[:, 0] if when.kind == "max" else -course[:, 0], times)
    return _between(values, times, at)


def _course(measure: Measure, points: FloatArray, times: FloatArray) -> FloatArray:
    """Return a quantity over time, shape (T, numbers)."""
    own = [points[:, INDEX[joint]] for joint in measure.joints]
    if measure.what == "position":
        place = own[0] if len(own) == 1 else own[0] - own[1]
        chosen: FloatArray = place[:, ["xyz".index(axis) for axis in measure.axes]]
        return chosen
    return _number(measure.what, own, points, times)[:, None]


def _number(
    what: str, own: Sequence[FloatArray], points: FloatArray, times: FloatArray
) -> FloatArray:
    """Return a quantity of one number over time, shape (T,)."""
    result: FloatArray
    if what == "height":
        result = own[0][:, 1]
    elif what == "speed":
        result = np.linalg.norm(np.gradient(own[0], times, axis=0, edge_order=2), axis=1)
    elif what == "distance":
        result = np.linalg.norm(own[0] - own[1], axis=1)
    elif what == "angle":
        one, two = own[1] - own[0], own[2] - own[0]
        sine = np.linalg.norm(np.cross(one, two), axis=1)
        result = np.degrees(np.arctan2(sine, np.sum(one * two, axis=1)))
    else:
        across = points[:, INDEX["lhip"]] - points[:, INDEX["rhip"]]
        result = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    return result


def _extreme(course: FloatArray, times: FloatArray) -> float:
    """Return when a course is largest, between frames too: the top of a parabola.

    Without that the value would jump from frame to frame as weights change little by little.
    """
    top = int(np.argmax(course))
    if top in (0, len(course) - 1):
        return float(times[top])
    (a, b, c), (r, s, t) = course[top - 1 : top + 2], times[top - 1 : top + 2]
    before, after = (b - a) / (s - r), (c - b) / (t - s)
    bend = before - after
    if bend <= 0:
        return float(s)
    at = (r + s) / 2 + before / bend * (t - r) / 2
    return float(np.clip(at, r, t))


def _between(values: FloatArray, times: FloatArray, at: float) -> FloatArray:
    """Return values between frames, by a parabola through the three nearest."""
    middle = int(np.clip(np.argmin(np.abs(times - at)), 1, max(len(times) - 2, 1)))
    near = slice(middle - 1, middle + 2)
    result = np.zeros(values.shape[1])
    for k, own in enumerate(times[near]):
        others = np.delete(times[near], k)
        result += values[near][k] * np.prod((at - others) / (own - others))
    return result
