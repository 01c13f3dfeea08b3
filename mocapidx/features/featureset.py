"""Feature sets: which relational features there are, as data that anybody can write."""

import json
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from hashlib import blake2b
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from mocapidx.errors import FeatureSetError, ParameterError
from mocapidx.features.parsing import PARTS, read_document
from mocapidx.features.relations import Feature
from mocapidx.model import IndexArray
from mocapidx.printable import meant
from mocapidx.toml_files import read_toml_text

__all__ = [
    "PARTS",
    "AnyFeatureSet",
    "Feature",
    "FeatureSet",
    "load_feature_set",
    "parse_feature_set",
    "shipped_sets",
]

SETS: Final = Path(__file__).parent / "sets"

# Part of every digest: raise it when a formula changes, so that older stores are told apart.
DEFINITIONS: Final = 1


@dataclass(frozen=True)
class FeatureSet:
    """An ordered set of features; feature i is bit i of a feature word.

    Parameters
    ----------
    name : str
        Name of the set, such as ``f39``.
    source : str
        Where its features and thresholds come from.
    features : tuple of Feature
        At most 64, and at most 31 of one part.
    text : str
        The TOML text that it was read from.
    """

    name: str
    source: str
    features: tuple[Feature, ...]
    text: str

    def __hash__(self) -> int:
        """Hash the text alone, which is quick; sets that are equal have it in common."""
        return hash(self.text)

    @cached_property
    def digest(self) -> str:
        """BLAKE2b of all that decides the bits, in hexadecimal; not comments, names, source."""
        return _digest(self.features)

    @property
    def ids(self) -> tuple[str, ...]:
        """The ids of the features, in the order of the bits."""
        return tuple(feature.id for feature in self.features)

    @property
    def mirror(self) -> IndexArray:
        """Permutation of the features that exchanges left and right, shape (F,)."""
        place = {feature.id: i for i, feature in enumerate(self.features)}
        return np.array([place[feature.mirror] for feature in self.features], dtype=np.int64)

    def part_mask(self, part: str) -> int:
        """Return the bits of the features of one part."""
        if part not in PARTS:
            raise ParameterError(f"there is no part {part!r}; parts are {', '.join(PARTS)}")
        return sum(1 << i for i, feature in enumerate(self.features) if feature.part == part)

    def select(self, expression: str) -> int:
        """Return the bits of the features that an expression names.

        Parameters
        ----------
        expression : str
            Ids, names, parts and ``all``, separated by commas: ``F17,F18``, ``upper``,
            ``lower,F39``, ``right knee bent``. Upper and lower case are the same.

        Returns
        -------
        int

        Raises
        ------
        ParameterError
            If a word of the expression names nothing in this set, or there is no word.
        """
        named = {"all": (1 << len(self.features)) - 1}
        named |= {part: self.part_mask(part) for part in PARTS}
        for i, feature in enumerate(self.features):
            named[feature.id.lower()] = named[feature.name.lower()] = 1 << i
        mask = 0
        for word in expression.split(","):
            if word.strip().lower() not in named:
                raise ParameterError(
                    f"{word.strip()!r} names no feature of the set {self.name}; "
                    f"expected ids ({_span(self.ids)}), names, {', '.join(PARTS)} or all"
                    f"{meant(word.strip(), named)}"
                )
            mask |= named[word.strip().lower()]
        return mask


AnyFeatureSet: TypeAlias = str | Path | FeatureSet


def load_feature_set(name_or_path: AnyFeatureSet) -> FeatureSet:
    """Return a shipped feature set by its name, or read one from a TOML file.

    Parameters
    ----------
    name_or_path : str, Path or FeatureSet
        A shipped name such as ``f39``, or the path of a file; a set is returned as it is.

    Returns
    -------
    FeatureSet

    Raises
    ------
    FeatureSetError
        If there is no such set or file, it can't be read, or it is wrong.
    """
    if isinstance(name_or_path, FeatureSet):
        return name_or_path
    if str(name_or_path) in shipped_sets():
        return _load_shipped(str(name_or_path))
    shipped = f"; shipped sets are {', '.join(shipped_sets())}"
    return parse_feature_set(
        read_toml_text(name_or_path, FeatureSetError, shipped), str(name_or_path)
    )


def shipped_sets() -> tuple[str, ...]:
    """Return the names of the sets that come with mocapidx."""
    return tuple(sorted(path.stem for path in SETS.glob("*.toml")))


@lru_cache
def _load_shipped(name: str) -> FeatureSet:
    text = (SETS / f"{name}.toml").read_text(encoding="utf-8")
    return parse_feature_set(text, f"{name}.toml")


def parse_feature_set(text: str, where: str = "feature set") -> FeatureSet:
    """Read and check the TOML text of a feature set.

    Parameters
    ----------
    text : str
        The text; see ``docs/features.md`` for its form.
    where : str
        What messages call it, usually the path of the file.

    Returns
    -------
    FeatureSet

    Raises
    ------
    FeatureSetError
        If the text is not TOML or says something that a feature set can't; the message names
        the feature and the key.
    """
    name, source, features = read_document(text, where)
    return FeatureSet(name=name, source=source, features=features, text=text)


def _digest(features: Iterable[Feature]) -> str:
    meaning = [{k: v for k, v in asdict(feature).items() if k != "name"} for feature in features]
    canonical = json.dumps([DEFINITIONS, meaning], sort_keys=True, separators=(",", ":"))
    return blake2b(canonical.encode(), digest_size=32).hexdigest()


def _span(ids: tuple[str, ...]) -> str:
    numbers = [re.fullmatch(r"F(\d+)", i) for i in ids]
    return f"{ids[0]} to {ids[-1]}" if all(numbers) else ", ".join(ids)
