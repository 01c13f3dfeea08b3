"""Look at feature sets, try them on motion, draw features and learn thresholds."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.durable import durable_replace
from mocapidx.errors import ParameterError
from mocapidx.features.describe import formula_text, threshold_text
from mocapidx.features.extract import condition_values, extract_features, untrusted_features
from mocapidx.features.featureset import PARTS, FeatureSet, load_feature_set, shipped_sets
from mocapidx.features.relations import COMBINATIONS, Feature, leaves, open_interval
from mocapidx.model import BoolArray, FloatArray
from mocapidx.printable import shown
from mocapidx.reports.features import FeaturePanel, LeafCurve, feature_picture
from mocapidx.reports.style import picture_format
from mocapidx.segments.runs import find_runs
from mocapidx.store.read import open_store
from mocapidx.store.schema import MANIFEST
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.records import Record
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.tasks.takes import one_take, takes_in

__all__ = [
    "CHECK_COLUMNS",
    "FEATURE_COLUMNS",
    "SET_COLUMNS",
    "check_features",
    "draw_features",
    "feature_records",
    "named_set",
    "set_facts",
    "set_records",
]

SET_COLUMNS: Final = ("name", "features", *PARTS, "digest", "source")
FEATURE_COLUMNS: Final = ("id", "part", "name", "value", "on", "off", "unit", "mirror")
CHECK_COLUMNS: Final = (
    "id", "name", "on", "changes_per_minute", "lowest", "highest", "untrusted_in", "remark"
)  # fmt: skip

SHORT: Final = 0.1
"""A stretch shorter than this, in seconds, is more likely a trembling value than an event."""
MOST_PANELS: Final = 24


def named_set(name: str | Path) -> FeatureSet:
    """Give a feature set by its name, by its file, or by a store that was made with it.

    Parameters
    ----------
    name : str or Path

    Returns
    -------
    FeatureSet

    Raises
    ------
    FeatureSetError, StoreError
    """
    if str(name) not in shipped_sets() and (Path(name) / MANIFEST).exists():
        with open_store(Path(name)) as store:
            return store_feature_set(store)
    return load_feature_set(name)


def set_facts(feature_set: FeatureSet) -> Record:
    """Lay out what a feature set is as a record."""
    return {
        "name": feature_set.name,
        "features": len(feature_set.features),
        **{part: feature_set.part_mask(part).bit_count() for part in PARTS},
        "digest": feature_set.digest[:12],
        "source": feature_set.source,
    }


def set_records(names: Sequence[str | Path] = ()) -> Iterator[Record]:
    """Lay out feature sets, a record each.

    Parameters
    ----------
    names : sequence of str or Path
        As for `named_set`; none: the shipped ones.

    Yields
    ------
    dict
        Stores can be searched together if their sets have one digest.
    """
    for name in names or shipped_sets():
        yield set_facts(named_set(name))


def feature_records(feature_set: FeatureSet, select: str = "all") -> Iterator[Record]:
    """Lay out the features of a set, a record each.

    Parameters
    ----------
    feature_set : FeatureSet
    select : str
        As in `FeatureSet.select`.

    Yields
    ------
    dict
        The value as a formula; the thresholds that turn the feature on and off.
    """
    for feature in _selected(feature_set, select):
        yield {
            "id": feature.id,
            "part": feature.part,
            "name": feature.name,
            "value": formula_text(feature.condition),
            "on": threshold_text(feature.condition, strong=True),
            "off": threshold_text(feature.condition, strong=False),
            "unit": ", ".join(dict.fromkeys(leaf.unit for leaf in leaves(feature.condition))),
            "mirror": feature.mirror,
        }


def _selected(feature_set: FeatureSet, select: str) -> list[Feature]:
    mask = feature_set.select(select)
    return [feature for i, feature in enumerate(feature_set.features) if mask >> i & 1]


class _Tally:
    """What features do over all motion so far; each array has the shape (F,)."""

    def __init__(self, count: int) -> None:
        self.frames, self.on, self.changes, self.short, self.untrusted = np.zeros(
            (5, count), dtype=np.int64
        )
        self.lowest, self.highest = np.full((2, count), np.nan)
        self.minutes = np.zeros(count)
        self.documents = 0

    def add(self, bits: BoolArray, values: FloatArray, trusted: BoolArray, rate: float) -> None:
        self.documents += 1
        self.frames += len(bits) * trusted
        self.minutes += len(bits) / rate / 60 * trusted
        self.on += bits.sum(axis=0) * trusted
        self.untrusted += ~trusted
        for i in np.flatnonzero(trusted).tolist():
            lengths = np.diff(find_runs(bits[:, i].view(np.uint8))[1])
            self.changes[i] += len(lengths) - 1
            self.short[i] += int((lengths[1:-1] < SHORT * rate).sum())
        values = np.where(trusted, values, np.nan)
        self.lowest = np.fmin(self.lowest, np.fmin.reduce(values, axis=0))
        self.highest = np.fmax(self.highest, np.fmax.reduce(values, axis=0))


def check_features(
    feature_set: FeatureSet,
    inputs: Sequence[Path],
    *,
    rate: float | None = None,
    read: ReadOptions | None = None,
) -> Iterator[Record]:
    """Try a feature set on motion: which features say something, and which tremble.

    Parameters
    ----------
    feature_set : FeatureSet
    inputs : sequence of Path
        Motion files, folders and stores.
    rate : float, optional
        In Hz; by default 30 for files, and the rate that a store has.
    read : ReadOptions, optional
        How files are understood.

    Yields
    ------
    dict
        A record a feature: the share of frames in which it is on, changes a minute, the range
        of its value (none for a combination, which has several), in how many documents it is
        not to be trusted, and what looks odd.

    Raises
    ------
    FormatError, ParameterError, StoreError
    """
    count = len(feature_set.features)
    tally = _Tally(count)
    plain = [i for i, f in enumerate(feature_set.features) if f.condition.kind not in COMBINATIONS]
    conditions = [feature_set.features[i].condition for i in plain]
    for take in takes_in(inputs, rate, read or ReadOptions()):
        untrusted = untrusted_features(take.motion, feature_set)
        trusted = np.array([not untrusted >> i & 1 for i in range(count)])
        bits = extract_features(take.motion, feature_set, take.motion.rate)
        values = np.full(bits.shape, np.nan)
        values[:, plain] = condition_values(take.motion, conditions, take.motion.rate)
        tally.add(bits, values, trusted, take.motion.rate)
    if not tally.documents:
        places = ", ".join(shown(each) for each in inputs)
        raise ParameterError(f"no motion in {places} to try the features on")
    for i, feature in enumerate(feature_set.features):
        frames, minutes = max(int(tally.frames[i]), 1), float(tally.minutes[i]) or 1.0
        known = bool(np.isfinite(tally.lowest[i]))
        yield {
            "id": feature.id,
            "name": feature.name,
            "on": round(int(tally.on[i]) / frames, 6),
            "changes_per_minute": round(int(tally.changes[i]) / minutes, 3),
            "lowest": round(float(tally.lowest[i]), 6) if known else None,
            "highest": round(float(tally.highest[i]), 6) if known else None,
            "untrusted_in": int(tally.untrusted[i]),
            "remark": _remark(tally, i),
        }


def _remark(tally: _Tally, i: int) -> str:
    if tally.untrusted[i] == tally.documents:
        return "never to be trusted"
    if tally.on[i] == 0:
        return "never on"
    if tally.on[i] == tally.frames[i]:
        return "always on"
    if 2 * tally.short[i] > tally.changes[i] > 0:
        return "trembles: thresholds farther apart?"
    return ""


def draw_features(
    feature_set: FeatureSet,
    select: str,
    motion: Path,
    picture: Path,
    *,
    document: str | None = None,
    start: float | None = None,
    end: float | None = None,
    rate: float | None = None,
    read: ReadOptions | None = None,
) -> None:
    """Draw the values beneath features over a clip, with both thresholds.

    Parameters
    ----------
    feature_set : FeatureSet
    select : str
        As in `FeatureSet.select`; a panel for each feature, in the order of the set.
    motion : Path
        A motion file or a store.
    picture : Path
        A .png or .svg file.
    document : str, optional
        Of the store.
    start, end : float, optional
        The stretch to draw, in seconds.
    rate : float, optional
        In Hz; by default 30 for files, and the rate that a store has.
    read : ReadOptions, optional
        How a motion file is understood.

    Raises
    ------
    FormatError, ParameterError, StoreError, WriteError
    """
    suffix = picture_format(picture)
    chosen = _selected(feature_set, select)
    if len(chosen) > MOST_PANELS:
        raise ParameterError(
            f"{len(chosen)} features are too many for one picture, at most {MOST_PANELS}; "
            "choose with --feature"
        )
    take = one_take(motion, rate, read or ReadOptions(), document)
    frames, rate = len(take.motion.positions), take.motion.rate
    first = round((start or 0.0) * rate)
    last = frames if end is None else min(frames, round(end * rate))
    if first >= last:
        raise ParameterError(f"{take.name} lasts {frames / rate:.2f} s, nothing lies there")
    bits = extract_features(take.motion, feature_set, rate)[first:last]
    untrusted = untrusted_features(take.motion, feature_set)
    panels = []
    for feature in chosen:
        place = feature_set.ids.index(feature.id)
        parts = list(dict.fromkeys(leaves(feature.condition)))
        values = condition_values(take.motion, parts, rate)[first:last]
        curves = tuple(
            LeafCurve(
                formula_text(part),
                values[:, i],
                part.unit,
                _lines(open_interval(part, part.on)),
                _lines(open_interval(part, part.off)),
            )
            for i, part in enumerate(parts)
        )
        title = f"{feature.id} {feature.name}"
        if untrusted >> place & 1:
            title += " (the skeleton can't tell)"
        panels.append(FeaturePanel(title, curves, bits[:, place]))
    data = feature_picture(panels, rate, start=first / rate, title=take.name, suffix=suffix)
    durable_replace(picture, data)


def _lines(interval: tuple[float, float]) -> tuple[float, ...]:
    """Return the ends of an open interval that can be drawn."""
    return tuple(round(end, 9) for end in interval if np.isfinite(end))
