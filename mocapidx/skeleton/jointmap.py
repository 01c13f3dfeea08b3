"""Joint maps: which node of a rig is which canonical joint.

A map is chosen by the whole set of a skeleton's names, never name by name: LeftShoulder is the
collar bone in one convention and the shoulder in another.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from mocapidx.errors import FeatureSetError, FormatError
from mocapidx.model import BoolArray, Skeleton
from mocapidx.printable import shown
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.skeleton.mapfile import check_joint, parse_map
from mocapidx.toml_files import read_toml_text

__all__ = [
    "Between",
    "JointMap",
    "Mapping24",
    "choose_map",
    "load_joint_map",
    "parse_joint_map",
    "shipped_maps",
]

OPTIONAL: Final = frozenset({"ltoes", "rtoes", "lfingers", "rfingers", "headtop"})


@dataclass(frozen=True, slots=True)
class Between:
    """A joint made on the line between two others.

    Parameters
    ----------
    first, last : str
        Canonical joints.
    at : float
        0 is `first`, 1 is `last`; beyond that the line goes on.
    """

    first: str
    last: str
    at: float


@dataclass(frozen=True, slots=True)
class JointMap:
    """One convention of naming, as a TOML file has it.

    Parameters
    ----------
    name, source : str
        What it is called and where it comes from.
    joints : mapping of str to tuple of str
        For each canonical joint the names that it may have in a file, the best first.
    made : mapping of str to Between
        Joints that this convention lacks and the map makes from others.
    strip : str
        A regular expression; what it matches at the beginning of a name is not looked at.
    needs, lacks : tuple of str
        Names that must be there, or must not, for the map to fit.
    """

    name: str
    source: str
    joints: Mapping[str, tuple[str, ...]]
    made: Mapping[str, Between] = field(default_factory=dict)
    strip: str = ""
    needs: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Mapping24:
    """A joint map that fits a skeleton.

    Parameters
    ----------
    joint_map : JointMap
        The map.
    nodes : tuple of int
        The node of each canonical joint, -1 where the skeleton has none.
    """

    joint_map: JointMap
    nodes: tuple[int, ...]


def choose_map(skeleton: Skeleton, joint_map: JointMap | None = None, where: str = "") -> Mapping24:
    """Find the map that fits the names of a skeleton.

    Parameters
    ----------
    skeleton : Skeleton
        As its file has it.
    joint_map : JointMap, optional
        The map to use; by default the shipped map that fits and finds most.
    where : str
        The file, for messages.

    Returns
    -------
    Mapping24
        The map and the node of each canonical joint.

    Raises
    ------
    FormatError
        If no map fits; the message names the map that comes nearest and what it misses.
    """
    names, has_length = skeleton.names, np.any(skeleton.offsets, axis=1)
    if joint_map is None:
        found = _choose_shipped(names, has_length.tobytes())
    else:
        found = _choose(names, has_length, (joint_map,))
    if isinstance(found, Mapping24):
        return found
    name, missed = found
    raise FormatError(
        f"{where}: no joint map fits its names; the nearest, '{shown(name)}', {missed}; "
        "write a map of your own and name it with --joint-map"
    )


@lru_cache(maxsize=64)
def _choose_shipped(names: tuple[str, ...], has_length: bytes) -> Mapping24 | tuple[str, str]:
    """Choose once for all takes of a skeleton."""
    return _choose(names, np.frombuffer(has_length, dtype=np.bool_), shipped_maps())


def _choose(
    names: tuple[str, ...], has_length: BoolArray, candidates: Iterable[JointMap]
) -> Mapping24 | tuple[str, str]:
    """Return the map that finds most, or the name of the nearest and what it misses."""
    fits: list[Mapping24] = []
    misses: list[tuple[int, str, str]] = []
    for candidate in candidates:
        mapping, missing = _fit(names, has_length, candidate)
        if mapping is not None:
            fits.append(mapping)
        else:
            misses.append((len(missing), candidate.name, missing[0]))
    if fits:
        return max(fits, key=lambda m: (sum(n >= 0 for n in m.nodes), len(m.joint_map.needs)))
    return min(misses)[1:]


def _fit(
    names: tuple[str, ...], has_length: BoolArray, joint_map: JointMap
) -> tuple[Mapping24 | None, list[str]]:
    """Return the nodes of the joints, or what is missing for them."""
    best: list[str] = []
    for place in _places(names, joint_map.strip):
        missing = [f"needs '{shown(n)}'" for n in joint_map.needs if n not in place]
        missing += [f"does not expect '{shown(n)}'" for n in joint_map.lacks if n in place]
        nodes = []
        for joint in CANONICAL_JOINTS:
            alternatives = joint_map.joints.get(joint, ())
            node = _first_node(has_length, place, alternatives)
            nodes.append(node)
            if alternatives and node < 0 and joint not in OPTIONAL:
                missing.append(f"needs '{shown(alternatives[0])}' for {joint}")
        if not missing:
            return Mapping24(joint_map, tuple(nodes)), []
        if not best or len(missing) < len(best):
            best = missing
    return None, best


@lru_cache(maxsize=256)
def _places(names: tuple[str, ...], strip: str) -> tuple[dict[str, int], ...]:
    """Return name to node, without what exporters put before names; the mildest way first."""
    prefix = re.compile(f"^(?:{strip})")
    plain = tuple(prefix.sub("", n) for n in names)
    bare = tuple(prefix.sub("", n.rsplit(":", 1)[-1]).replace(" ", "_") for n in names)
    common = len(_common_prefix(bare))
    forms = dict.fromkeys((plain, bare, tuple(n[common:] for n in bare)))
    places = ({name: i for i, name in enumerate(form)} for form in forms)
    return tuple(place for place in places if len(place) == len(names))


def _common_prefix(names: tuple[str, ...]) -> str:
    """Return what all names begin with, up to and with its last underscore."""
    low, high = min(names), max(names)
    length = next((i for i, (a, b) in enumerate(zip(low, high, strict=False)) if a != b), len(low))
    return low[: low.rfind("_", 0, length) + 1]


def _first_node(has_length: BoolArray, place: dict[str, int], names: Iterable[str]) -> int:
    """Return the first node there is; an End Site on its own joint is no point of its own."""
    for name in names:
        node = place.get(name, -1)
        if node >= 0 and (has_length[node] or not name.endswith("/End")):
            return node
    return -1


@cache
def shipped_maps() -> tuple[JointMap, ...]:
    """Return the maps that come with mocapidx, in the order of their names.

    Returns
    -------
    tuple of JointMap
        One a convention.
    """
    paths = sorted((Path(__file__).parent / "maps").glob("*.toml"))
    return tuple(parse_joint_map(p.read_text(encoding="utf-8"), p.name) for p in paths)


def load_joint_map(path: Path) -> JointMap:
    """Read a user's own map.

    Parameters
    ----------
    path : Path
        A TOML file.

    Returns
    -------
    JointMap
        The map.

    Raises
    ------
    FeatureSetError
        If the file can't be read or is no joint map; the message names entry and key.
    """
    text = read_toml_text(path, FeatureSetError, "; expected a joint map in TOML")
    return parse_joint_map(text, shown(path, None))


def parse_joint_map(text: str, where: str) -> JointMap:
    """Read and check the text of a joint map.

    Parameters
    ----------
    text : str
        TOML.
    where : str
        The file, for messages.

    Returns
    -------
    JointMap
        The map.

    Raises
    ------
    FeatureSetError
        If the text is no joint map; the message names entry and key.
    """
    table, head = parse_map(text, where)
    joints, made = _joints(table.get("joints"), where)
    return JointMap(head.name, head.source, joints, made, head.strip, head.needs, head.lacks)


def _joints(table: Any, where: str) -> tuple[dict[str, tuple[str, ...]], dict[str, Between]]:
    if not isinstance(table, dict) or not table:
        raise FeatureSetError(f"{where}: [joints] is missing or empty")
    joints: dict[str, tuple[str, ...]] = {}
    made: dict[str, Between] = {}
    for joint, entry in table.items():
        check_joint(joint, where)
        if isinstance(entry, dict):
            made[joint] = _between(entry, f"{where}: joint {joint}")
        else:
            names = [entry] if isinstance(entry, str) else entry
            joints[joint] = _names(names, f"joint {joint}", where)
    for joint in ("lhip", "rhip", "lknee", "rknee", "lankle", "rankle", "head"):
        if joint not in joints:
            raise FeatureSetError(f"{where}: [joints] lacks {joint}, which every map must name")
    for joint, line in made.items():
        for end in (line.first, line.last):
            if end not in joints:
                raise FeatureSetError(
                    f"{where}: joint {joint} is made from {end}, which has no name of its own"
                )
    return joints, made


def _between(entry: dict[str, Any], where: str) -> Between:
    ends, at = entry.get("between"), entry.get("at")
    if (
        entry.keys() != {"between", "at"}
        or not isinstance(ends, list)
        or len(ends) != 2
        or not all(isinstance(end, str) and end in INDEX for end in ends)
        or isinstance(at, bool)
        or not isinstance(at, int | float)
        or not -10 <= at <= 10
    ):
        raise FeatureSetError(
            f'{where}: expected {{ between = ["JOINT", "JOINT"], at = NUMBER }} with '
            "canonical joints"
        )
    return Between(ends[0], ends[1], float(at))


def _names(value: Any, key: str, where: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not value or not all(isinstance(n, str) and n for n in value):
        raise FeatureSetError(f"{where}: {key}: expected a name or a list of names")
    return tuple(value)
