"""Answer a query by example from a store."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.features.extract import extract_features, untrusted_features
from mocapidx.features.featureset import FeatureSet
from mocapidx.features.words import pack_words
from mocapidx.model import FloatArray, Hit, WordArray
from mocapidx.printable import shown
from mocapidx.queries.evaluate import MODES as EVALUATORS
from mocapidx.queries.evaluate import GroupHits, evaluate
from mocapidx.queries.rank import length_costs, ranking_order
from mocapidx.queries.steps import FuzzyQuery, steps_from_example
from mocapidx.store.manifest import SegmentFile
from mocapidx.store.read import open_store
from mocapidx.tasks.hits import make_hit
from mocapidx.tasks.read import ReadOptions, read_take
from mocapidx.tasks.segment_sources import document_groups, segment_source, store_feature_set

__all__ = ["MODES", "RANKINGS", "Example", "Found", "parse_example", "query_store"]

MODES: Final = tuple(EVALUATORS)
RANKINGS: Final = ("length", "none")

PART_OF_FILE: Final = re.compile(r"(?P<file>.*)@(?P<start>[0-9.]*):(?P<end>[0-9.]*)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Example:
    """A motion file, or a part of it.

    Parameters
    ----------
    path : Path
    start, end : float or None
        In seconds; None: from the beginning, to the end.
    """

    path: Path
    start: float | None = None
    end: float | None = None

    @property
    def label(self) -> str:
        """The name that its hits get."""
        return self.path.stem


@dataclass(frozen=True, slots=True)
class Found:
    """The answer to a query.

    Parameters
    ----------
    hits : tuple of Hit
        Best first.
    remarks : tuple of str
        What a person should know about the answer, a sentence each.
    """

    hits: tuple[Hit, ...]
    remarks: tuple[str, ...]


def parse_example(text: str) -> Example:
    """Understand ``FILE`` or ``FILE@START:END``, times in seconds, either may be left out.

    Raises
    ------
    ParameterError
        If a time is no number, or the end is not after the start.
    """
    match = PART_OF_FILE.fullmatch(text)
    if match is None or Path(text).exists():
        return Example(Path(text))
    try:
        start, end = (float(match[key]) if match[key] else None for key in ("start", "end"))
    except ValueError:
        raise ParameterError(f"{shown(text)}: START and END are seconds, such as @1.5:3") from None
    if end is not None and end <= (start or 0.0):
        raise ParameterError(f"{shown(text)}: END must be later than START")
    return Example(Path(match["file"]), start, end)


def query_store(
    store: str | Path,
    example: str | Path | Example,
    *,
    select: str = "all",
    mode: str = "adaptive",
    rank: str = "length",
    top: int | None = None,
    read: ReadOptions | None = None,
) -> Found:
    """Find every stretch of a store that goes through the same feature words as an example.

    Parameters
    ----------
    store : str or Path
    example : str, Path or Example
        As text: ``FILE`` or ``FILE@START:END``.
    select : str
        The features that count, as in `FeatureSet.select`.
    mode : {"exact", "fuzzy", "adaptive"}
    rank : {"length", "none"}
        Costs from the lengths of the steps, or all 0.
    top : int, optional
        Keep the best only.
    read : ReadOptions, optional
        How the example's file is understood.

    Returns
    -------
    Found
        Hits by cost, then by document name, then by start.

    Raises
    ------
    FormatError
        If the example can't be used.
    ParameterError, StoreError
    """
    if not isinstance(example, Example):
        example = parse_example(str(example))
    remarks: list[str] = []
    with open_store(Path(store)) as snapshot:
        feature_set = store_feature_set(snapshot)
        rate = snapshot.manifest.settings.rate
        mask = feature_set.select(select)
        words, untrusted = _example_words(example, feature_set, rate, read or ReadOptions())
        if mask & untrusted:
            remarks.append(
                f"the example's skeleton can't tell {_names(feature_set, mask & untrusted)}; "
                "the query leaves it open"
            )
        query = steps_from_example(words, mask & ~untrusted)
        hits: list[Hit] = []
        costs: list[FloatArray] = []
        left_open: dict[int, int] = {}
        for file in snapshot.files:
            source = segment_source(snapshot, file, feature_set)
            for answer in evaluate(query, mode, source, document_groups(file)):
                if unknown := answer.group.untrusted & query.mask:
                    left_open[unknown] = left_open.get(unknown, 0) + len(answer.group.documents)
                costs.append(_costs(answer, rank))
                hits.extend(_hits(answer, file, rate, example.label, costs[-1]))
    remarks += _untrusted_remarks(left_open, query, feature_set)
    return Found(tuple(_ranked(hits, top)), tuple(remarks))


def _example_words(
    example: Example, feature_set: FeatureSet, rate: float, options: ReadOptions
) -> tuple[WordArray, int]:
    """Feature words of the example at the store's rate, and the features it can't be trusted in."""
    motion = read_take(example.path, options).motion
    words = pack_words(extract_features(motion, feature_set, rate))
    # Cut after extraction: velocities and hysteresis then know what came before.
    start = round((example.start or 0.0) * rate)
    end = len(words) if example.end is None else min(len(words), round(example.end * rate))
    if start >= end:
        raise ParameterError(
            f"{shown(str(example.path))}: lasts {len(words) / rate:.2f} s, "
            f"the example starts at {start / rate:.2f} s"
        )
    return words[start:end], untrusted_features(motion, feature_set)


def _costs(answer: GroupHits, rank: str) -> FloatArray:
    if rank == "none" or answer.pattern is None:
        return np.zeros(len(answer.documents))
    return length_costs(answer.bounds, answer.pattern.lengths)


def _hits(
    answer: GroupHits, file: SegmentFile, rate: float, label: str, costs: FloatArray
) -> Iterable[Hit]:
    starts, ends = answer.bounds[:, 0].tolist(), answer.bounds[:, -1].tolist()
    rows = zip(answer.documents.tolist(), starts, ends, costs.tolist(), strict=True)
    for number, start, end, cost in rows:
        yield make_hit(file.documents[number], start, end, rate, cost, label)


def _ranked(hits: Sequence[Hit], top: int | None) -> Iterable[Hit]:
    order = ranking_order(
        np.array([hit.cost for hit in hits]),
        [hit.document for hit in hits],
        np.array([hit.start_frame for hit in hits], np.int64),
        np.array([hit.end_frame for hit in hits], np.int64),
    )
    return (hits[place] for place in order[:top].tolist())


def _untrusted_remarks(
    left_open: dict[int, int], query: FuzzyQuery, feature_set: FeatureSet
) -> Iterable[str]:
    for mask, documents in left_open.items():
        names = _names(feature_set, mask)
        if mask == query.mask:
            yield f"{documents} documents can't be asked: their skeletons can't tell {names}"
        else:
            yield f"in {documents} documents {names} is left open: their skeletons can't tell it"


def _names(feature_set: FeatureSet, mask: int) -> str:
    return ", ".join(
        identifier for bit, identifier in enumerate(feature_set.ids) if mask >> bit & 1
    )
