"""From points on a body to the 24 canonical joints, by a marker map that fits their names."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.skeleton.canonical import completed_positions, made_joints
from mocapidx.skeleton.jointmap import JointMap, Mapping24
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.skeleton.markermap import Formula, MarkerMap, shipped_marker_maps

__all__ = ["PointMapping", "choose_marker_map", "marker_joints", "subjects_of"]

FEWEST_JOINTS: Final = 6  # fewer tell nothing of how a body moves
LISTED: Final = 8  # names in a message


@dataclass(frozen=True, slots=True)
class PointMapping:
    """A marker map that fits the points of a file.

    Parameters
    ----------
    marker_map : MarkerMap
        The map.
    subject : str
        Whose points they are, "" where names say nothing.
    columns : mapping of str to int
        The column of each point that is used, by its name in the map.
    steps : tuple of (str, Formula)
        What is computed one after the other; a joint may stand for a point of its name.
    joints : mapping of str to Formula
        How each canonical joint is found, those that are missing left out.
    """

    marker_map: MarkerMap
    subject: str
    columns: Mapping[str, int]
    steps: tuple[tuple[str, Formula], ...]
    joints: Mapping[str, Formula]

    @property
    def used(self) -> list[int]:
        """The columns that count, ascending."""
        return sorted(set(self.columns.values()))

    @property
    def real(self) -> list[str]:
        """The joints that are found by formulas which are no guesses."""
        return [joint for joint in CANONICAL_JOINTS if self.is_real(joint)]

    @property
    def made(self) -> tuple[str, ...]:
        """The joints that are guesses: by the map, or as rigs' are made up."""
        further = made_joints(self.as_mapping24())
        return tuple(
            joint
            for joint in CANONICAL_JOINTS
            if joint in further or (joint in self.joints and not self.is_real(joint))
        )

    @property
    def missing(self) -> tuple[str, ...]:
        """The joints that are not there at all."""
        there = {*self.joints, *self.made}
        return tuple(joint for joint in CANONICAL_JOINTS if joint not in there)

    def is_real(self, joint: str) -> bool:
        """Whether a joint is found by a formula that is no guess."""
        formula = self.joints.get(joint)
        return formula is not None and not formula.made

    def users(self) -> dict[int, tuple[str, ...]]:
        """Return, for each column that is used, the canonical joints that it helps to find."""
        takes: dict[str, set[int]] = {name: {column} for name, column in self.columns.items()}
        found: dict[int, list[str]] = {}
        for name, formula in self.steps:
            takes[name] = {c for part in formula.names for c in takes[part.casefold()]}
            for column in takes[name] if name in self.joints else ():
                found.setdefault(column, []).append(name)
        return {column: tuple(joints) for column, joints in found.items()}

    def as_mapping24(self) -> Mapping24:
        """Return which joints there are in the form that rigs have; the nodes mean nothing."""
        nodes = tuple(0 if joint in self.joints else -1 for joint in CANONICAL_JOINTS)
        return Mapping24(JointMap(self.marker_map.name, self.marker_map.source, {}), nodes)


def subjects_of(names: Iterable[str]) -> tuple[str, ...]:
    """Return what stands before the colon in names, each once, in their order.

    Parameters
    ----------
    names : iterable of str

    Returns
    -------
    tuple of str
        "" for names without a colon.
    """
    return tuple(dict.fromkeys(name.rpartition(":")[0] for name in names))


def choose_marker_map(
    names: Sequence[str],
    marker_map: MarkerMap | None = None,
    subject: str | None = None,
    where: str = "",
) -> PointMapping:
    """Find the map that fits the names of points.

    Parameters
    ----------
    names : sequence of str
        As the file has them.
    marker_map : MarkerMap, optional
        The map to use; by default the shipped map that fits and finds most joints.
    subject : str, optional
        Whose points count, where there are several people or things.
    where : str
        The file, for messages.

    Returns
    -------
    PointMapping

    Raises
    ------
    FormatError
        If no map fits, or maps fit several subjects.
    """
    subjects = subjects_of(names)
    if subject is not None and subject not in subjects:
        raise FormatError(f"{where}: has no subject '{shown(subject)}', {_whose(subjects)}")
    candidates = shipped_marker_maps() if marker_map is None else (marker_map,)
    fits: dict[str, PointMapping] = {}
    misses: list[tuple[int, int, str, str]] = []
    for one in subjects if subject is None else (subject,):
        own = {name: i for i, name in enumerate(names) if name.rpartition(":")[0] == one}
        for candidate in candidates:
            mapping, missing = _fit(own, candidate, one)
            if missing:
                known = len(mapping.columns)
                misses.append((-known, len(missing), candidate.name, missing[0]))
            elif one not in fits or len(mapping.real) > len(fits[one].real):
                fits[one] = mapping
    if len(fits) > 1:
        raise FormatError(f"{where}: {_whose(tuple(fits))}; name one with --subject")
    if fits:
        return next(iter(fits.values()))
    known, _, name, missed = min(misses)
    nearest = f"the nearest, '{shown(name)}', {missed}; " if known else ""
    raise FormatError(
        f"{where}: no marker map fits its points ({_listed(names)}); {nearest}"
        "write a map of your own and name it with --joint-map"
    )


def marker_joints(mapping: PointMapping, positions: FloatArray, unit: float) -> FloatArray:
    """Compute the canonical joints from points.

    Parameters
    ----------
    mapping : PointMapping
        How each joint follows.
    positions : ndarray of float, shape (T, P, 3)
        All points of the file, in its units and axes; NaN where one was not seen.
    unit : float
        Metres in one file unit.

    Returns
    -------
    ndarray of float64, shape (T, 24, 3)
        In file units and axes; NaN where a joint can't be told.
    """
    known = {name: positions[:, column] for name, column in mapping.columns.items()}
    for name, formula in mapping.steps:
        point = sum(weight * known[part.casefold()] for part, weight in formula.weights)
        if formula.along:
            first, last = (known[part.casefold()] for part in formula.along)
            way = last - first
            length = np.linalg.norm(way, axis=1, keepdims=True)
            point = point + formula.metres / unit * way / np.where(length > 0, length, np.nan)
        known[name] = np.asarray(point)
    joints = np.full((len(positions), len(CANONICAL_JOINTS), 3), np.nan)
    for joint in mapping.joints:
        joints[:, INDEX[joint]] = known[joint]
    return completed_positions(joints, mapping.as_mapping24())


def _fit(
    own: Mapping[str, int], marker_map: MarkerMap, subject: str
) -> tuple[PointMapping, list[str]]:
    """Return how the joints follow, and what keeps the map from fitting."""
    prefix = re.compile(f"^(?:{marker_map.strip})")
    place: dict[str, int] = {}
    for name, column in own.items():
        place.setdefault(prefix.sub("", name.rpartition(":")[2].strip()).casefold(), column)
    found: set[str] = set()
    steps: list[tuple[str, Formula]] = []
    for name, formulas in marker_map.points.items():
        steps += _first(name, formulas, place.keys() | found)
        found.update(name.casefold() for name, _ in steps[-1:])
    lacking = [n for n in marker_map.needs if n.casefold() not in place.keys() | found]
    missing = [f"needs '{shown(name)}'" for name in lacking]
    missing += [f"does not expect '{shown(n)}'" for n in marker_map.lacks if n.casefold() in place]
    joints: dict[str, Formula] = {}
    for joint, formulas in marker_map.joints.items():
        for name, formula in _first(joint, formulas, place.keys() | found):
            steps.append((name, formula))
            joints[joint] = formula
            found.add(name)
    needed = {part.casefold() for _, formula in steps for part in formula.names}
    columns = {name: column for name, column in place.items() if name in needed}
    mapping = PointMapping(marker_map, subject, columns, tuple(steps), joints)
    if not missing and len(mapping.real) < FEWEST_JOINTS:
        missing.append(f"finds {len(mapping.real)} of 24 joints")
    return mapping, missing


def _first(
    name: str, formulas: Iterable[Formula], there: Iterable[str]
) -> Iterator[tuple[str, Formula]]:
    """Yield the first formula all of whose points are there, if there is one."""
    known = set(there)
    for formula in formulas:
        if all(part.casefold() in known for part in formula.names):
            yield name.casefold(), formula
            return


def _whose(subjects: tuple[str, ...]) -> str:
    named = ", ".join(f"'{shown(subject)}'" for subject in subjects if subject)
    return f"it has the subjects {named}" if named else "its points name no subjects"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(shown(name, 30) for name in names[:LISTED]) + more
