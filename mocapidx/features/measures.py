"""The values beneath features, many at a time.

What is measured alike, such as all angles between two segments, is computed in one go over a
stretch of frames: short takes then cost few array operations, long ones stay in the cache.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mocapidx.features.geometry import Joints, Poses
from mocapidx.features.kinds import KINDS, Kind, Place
from mocapidx.features.relations import Condition
from mocapidx.model import FloatArray, IndexArray

__all__ = ["Measures", "measure_values", "measures_of"]


@dataclass(frozen=True, slots=True)
class _Group:
    """Generic features of one kind that are computed together.

    Parameters
    ----------
    kind : Kind
    places : tuple
        What the formula names, each place of it for all M features of the group.
    rows : ndarray of int64
        The conditions that have these values.
    members : ndarray of int64
        Which feature of the group each of them is, from 0.
    """

    kind: Kind
    places: tuple[Joints | tuple[Joints, Joints], ...]
    rows: IndexArray
    members: IndexArray


@dataclass(frozen=True, slots=True)
class Measures:
    """Generic features in the groups that are computed together.

    Parameters
    ----------
    units : tuple of str
        The unit of each.
    groups : tuple of _Group
    """

    units: tuple[str, ...]
    groups: tuple[_Group, ...]


def measures_of(conditions: Sequence[Condition]) -> Measures:
    """Find out what can be computed together.

    Parameters
    ----------
    conditions : sequence of Condition
        Generic features, no combinations.

    Returns
    -------
    Measures
    """
    alike: dict[tuple[object, ...], dict[tuple[Place, ...], list[int]]] = {}
    for row, condition in enumerate(conditions):
        of_all = KINDS[condition.kind].of_all
        shape = condition.joints if of_all else map(type, condition.joints)
        members = alike.setdefault((condition.kind, *shape), {})
        members.setdefault(condition.joints, []).append(row)
    return Measures(
        tuple(condition.unit for condition in conditions),
        tuple(_group(KINDS[str(kind)], members) for (kind, *_), members in alike.items()),
    )


def _group(kind: Kind, members: Mapping[tuple[Place, ...], Sequence[int]]) -> _Group:
    places: tuple[Joints | tuple[Joints, Joints], ...]
    if kind.of_all:
        (places,) = members
    else:
        places = tuple(map(_together, zip(*members, strict=True)))
    rows = [row for member in members.values() for row in member]
    numbers = [i for i, member in enumerate(members.values()) for _ in member]
    return _Group(kind, places, np.array(rows), np.array(numbers))


def _together(places: Sequence[Place]) -> Joints | tuple[Joints, Joints]:
    segments = [place for place in places if isinstance(place, tuple)]
    if segments:
        return [start for start, _ in segments], [end for _, end in segments]
    return [place for place in places if isinstance(place, str)]


def measure_values(poses: Poses, measures: Measures, scales: Mapping[str, float]) -> FloatArray:
    """Compute the values of generic features in their units.

    Parameters
    ----------
    poses : Poses
        Of T frames.
    measures : Measures
        Of C generic features.
    scales : mapping of str to float
        Metres in each length.

    Returns
    -------
    ndarray of float64, shape (C, T)
    """
    values = np.empty((len(measures.units), poses.points.shape[2]))
    # Infinite positions and widths of 0 give unknown values, not warnings.
    with np.errstate(all="ignore"):
        for group in measures.groups:
            found = group.kind.value(poses, *group.places)
            values[group.rows] = found if found.ndim == 1 else found[group.members]
        units = [unit.removesuffix("/s") for unit in measures.units]
        values /= np.array([1.0 if u == "deg" else scales[u] for u in units])[:, None]
    return values
