"""Learn the thresholds of a feature from stretches where it should be on, or off."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.describe import common_threshold
from mocapidx.features.extract import feature_values, untrusted_features
from mocapidx.features.featureset import FeatureSet
from mocapidx.features.learn import Separation, Wanted, learn_thresholds
from mocapidx.features.relations import Condition, Feature, open_interval
from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.tasks.labels import Label, read_labels
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.records import Record
from mocapidx.tasks.takes import Take, takes_in

__all__ = ["learn_feature", "separation_facts"]

DIGITS: Final = 4
"""Of a threshold: more would say something about the examples only."""


def learn_feature(
    inputs: Sequence[Path],
    feature_set: FeatureSet,
    feature: str,
    positive: Path,
    negative: Path,
    *,
    rate: float | None = None,
    read: ReadOptions | None = None,
) -> Separation:
    """Learn both thresholds of a feature; those that it has play no part.

    Parameters
    ----------
    inputs : sequence of Path
        Motion files, folders and stores that hold the labelled documents.
    feature_set : FeatureSet
    feature : str
        Id or name of one of its features: a generic one, or a combination whose parts all have
        the same thresholds.
    positive, negative : Path
        Labels files: where the feature should be on, and where off. What the labels are called
        makes no difference.
    rate : float, optional
        In Hz; by default 30 for files, and the rate that a store has.
    read : ReadOptions, optional
        How files are understood.

    Returns
    -------
    Separation
        Thresholds as a feature set has them: in the unit of the feature, `on` below `off` where
        it turns on below.

    Raises
    ------
    FormatError
        If a labels file is wrong, a labelled document is missing, or a frame should be both.
    ParameterError, StoreError

    References
    ----------
    .. [1] Mueller, Roeder, "A relational approach to content-based analysis of motion capture
       data", section 4.3.
    """
    mask = feature_set.select(feature)
    if mask.bit_count() != 1:
        raise ParameterError(f"'{shown(feature)}' names {mask.bit_count()} features, expected one")
    place = mask.bit_length() - 1
    one = feature_set.features[place]
    sign = _direction(one)
    labels = [
        (label, kind)
        for path, kind in ((positive, 1), (negative, -1))
        for label in read_labels(path).labels
    ]
    by_document: dict[str, list[tuple[Label, int]]] = {}
    for label, kind in labels:
        by_document.setdefault(label.document, []).append((label, kind))
    values: list[FloatArray] = []
    wanted: list[Wanted] = []
    for take in takes_in(inputs, rate, read or ReadOptions(), frozenset(by_document)):
        wanted.append(_wanted(take, by_document.pop(take.name)))
        known = not untrusted_features(take.motion, feature_set) & mask
        own = feature_values(take.motion, feature_set, take.motion.rate)[:, place]
        values.append(own if known else np.full(len(own), np.nan))
    _check_found(by_document)
    found = learn_thresholds(values, wanted)
    threshold, on, off = (
        float(f"{sign * each:.{DIGITS}g}") for each in (found.threshold, found.on, found.off)
    )
    return replace(found, threshold=threshold, on=on, off=off)


def _direction(feature: Feature) -> float:
    """Return 1 where the feature turns on above its threshold, -1 where below."""
    leaf = common_threshold(feature.condition)
    if leaf is None:
        raise ParameterError(
            f"{feature.id} is made of conditions with different thresholds; "
            "write each as a feature of its own to learn it"
        )
    low, high = open_interval(leaf, leaf.on)
    if np.isfinite(low) and np.isfinite(high):
        raise ParameterError(
            f"{feature.id} is on within a range; only a single threshold can be learned, "
            "or a range that reaches an end of its scale"
        )
    return 1.0 if np.isfinite(low) else -1.0


def _wanted(take: Take, labels: Sequence[tuple[Label, int]]) -> Wanted:
    """Lay labels over the frames of a document."""
    frames, rate = len(take.motion.positions), take.motion.rate
    wanted = np.zeros(frames, dtype=np.int8)
    for label, kind in labels:
        start = round((label.start_time or 0.0) * rate)
        end = frames if label.end_time is None else min(frames, round(label.end_time * rate))
        if start >= end:
            raise FormatError(
                f"{label.where}: {shown(label.document)} lasts {frames / rate:.2f} s, "
                "no frame of it lies in the label"
            )
        if (wanted[start:end] == -kind).any():
            raise FormatError(
                f"{label.where}: says the opposite of another label; "
                "--positive and --negative must not overlap"
            )
        wanted[start:end] = kind
    return wanted


def _check_found(missing: Mapping[str, Sequence[tuple[Label, int]]]) -> None:
    for labels in missing.values():
        label = labels[0][0]
        raise FormatError(
            f"{label.where}: no document '{shown(label.document)}' in what was given; names are "
            "paths below the folder, or those that 'mocapidx info STORE --documents' lists"
        )


def separation_facts(feature_set: FeatureSet, feature: str, found: Separation) -> Record:
    """Lay out learned thresholds as a record.

    Parameters
    ----------
    feature_set : FeatureSet
    feature : str
        Id or name of one of its features.
    found : Separation

    Returns
    -------
    dict
        `on` and `off` as they stand in a feature set: a number, or the range that a feature on
        angles has.
    """
    one = feature_set.features[feature_set.select(feature).bit_length() - 1]
    leaf = common_threshold(one.condition)
    unit = "" if leaf is None else leaf.unit
    return {
        "feature": one.id,
        "name": one.name,
        "on": _as_written(leaf, found.on),
        "off": _as_written(leaf, found.off),
        "unit": unit,
        "threshold": found.threshold,
        "right": round(found.right, 6),
        "positive_on": round(found.positive_on, 6),
        "negative_off": round(found.negative_off, 6),
        "single_right": round(found.single_right, 6),
        "area": round(found.area, 6),
        "changes": found.changes,
        "single_changes": found.single_changes,
    }


def _as_written(leaf: Condition | None, threshold: float) -> object:
    """Return a threshold in the form in which the feature has it."""
    if leaf is None or not isinstance(leaf.on, tuple):
        return threshold
    low, high = leaf.on
    return [low, threshold] if np.isinf(open_interval(leaf, leaf.on)[0]) else [threshold, high]
