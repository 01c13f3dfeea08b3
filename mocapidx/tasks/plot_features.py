"""Draw feature matrices with their segments, and the sizes of a store's inverted lists."""

from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.durable import durable_replace
from mocapidx.errors import ParameterError
from mocapidx.features.extract import extract_features, untrusted_features
from mocapidx.features.featureset import PARTS
from mocapidx.features.words import pack_words, unpack_words
from mocapidx.model import WordArray
from mocapidx.printable import meant, shown
from mocapidx.reports.lists import list_sizes_picture
from mocapidx.reports.segments import feature_matrix_picture
from mocapidx.reports.style import picture_format
from mocapidx.store.read import open_store
from mocapidx.store.schema import MANIFEST
from mocapidx.tasks.features import named_set
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.segment_sources import segment_source, store_feature_set, untrusted_mask
from mocapidx.tasks.store_words import document_words
from mocapidx.tasks.takes import one_take

__all__ = ["draw_feature_matrix", "draw_list_sizes"]

MOST_FRAMES: Final = 20_000  # more can't be told apart in a picture


def draw_feature_matrix(
    motion: Path,
    picture: Path,
    *,
    document: str | None = None,
    start: float | None = None,
    end: float | None = None,
    feature_set: str | Path = "f39",
    rate: float | None = None,
    read: ReadOptions | None = None,
) -> None:
    """Draw all features of a motion over time, and its segments in each sub-index.

    Parameters
    ----------
    motion : Path
        A motion file or a store.
    picture : Path
        A .png or .svg file.
    document : str, optional
        Of the store; None: its only one.
    start, end : float, optional
        The stretch to draw, in seconds.
    feature_set : str or Path
        Of a file's features; a store has its own.
    rate : float, optional
        Of a file's features, in Hz; by default 30.
    read : ReadOptions, optional
        How a motion file is understood.

    Raises
    ------
    FormatError, ParameterError, StoreError, WriteError
    """
    suffix = picture_format(picture)
    if (motion / MANIFEST).exists():
        name, words, untrusted, rate = _stored(motion, document)
        features = named_set(motion)
    else:
        features = named_set(feature_set)
        take = one_take(motion, rate, read or ReadOptions())
        name, rate = take.name, take.motion.rate
        words = pack_words(extract_features(take.motion, features, rate))
        untrusted = untrusted_features(take.motion, features)
    first = round((start or 0.0) * rate)
    last = len(words) if end is None else min(len(words), round(end * rate))
    if first >= last:
        raise ParameterError(
            f"{shown(name)} lasts {len(words) / rate:.2f} s; nothing of it lies between --start "
            "and --end"
        )
    if last - first > MOST_FRAMES:
        raise ParameterError(
            f"{shown(name)}: {(last - first) / rate:.0f} s are too much for one picture, at most "
            f"{MOST_FRAMES / rate:.0f} s; choose with --start and --end"
        )
    count = len(features.features)
    data = feature_matrix_picture(
        unpack_words(words[first:last], count),
        [f"{feature.id} {feature.name}" for feature in features.features],
        [feature.part for feature in features.features],
        rate,
        title=name,
        start=first / rate,
        untrusted=[bool(untrusted >> i & 1) for i in range(count)],
        suffix=suffix,
    )
    durable_replace(picture, data)


def _stored(path: Path, name: str | None) -> tuple[str, WordArray, int, float]:
    with open_store(path) as store:
        known = {each.document.name: each for each in store.documents()}
        found = [each for each in known.values() if name in (None, each.document.name)]
        if not found:
            near = meant(name or "", known)
            raise ParameterError(f"{shown(path)}: no document '{shown(name or '')}'{near}")
        if len(found) > 1:
            raise ParameterError(f"{shown(path)}: holds several documents; choose with --document")
        document = found[0].document
        rate = store.manifest.settings.rate
        return document.name, document_words(store, found)[0], untrusted_mask(document), rate


def draw_list_sizes(store: Path, picture: Path) -> None:
    """Draw how long the inverted lists of a store are.

    Parameters
    ----------
    store : Path
    picture : Path
        A .png or .svg file.

    Raises
    ------
    ParameterError, StoreError, WriteError
    """
    suffix = picture_format(picture)
    sizes: dict[str, dict[int, int]] = {part: {} for part in PARTS}
    with open_store(store) as snapshot:
        features = store_feature_set(snapshot)
        for file in snapshot.files:
            source = segment_source(snapshot, file, features)
            for part, own in zip(PARTS, source.parts, strict=True):
                counts = zip(own.lists.words.tolist(), own.lists.counts.tolist(), strict=True)
                for word, count in counts:
                    sizes[part][word] = sizes[part].get(word, 0) + count
    arrays = {part: np.array(list(own.values()), np.int64) for part, own in sizes.items()}
    data = list_sizes_picture(arrays, title=f"inverted lists of {shown(store)}", suffix=suffix)
    durable_replace(picture, data)
