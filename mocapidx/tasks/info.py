"""What a store holds, and what is known of one document."""

from importlib.metadata import version
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.features.featureset import PARTS, FeatureSet
from mocapidx.features.gaps import unspecified_within
from mocapidx.kernels.choice import instructions_in_use, kernels_in_use
from mocapidx.printable import meant, shown
from mocapidx.store import schema
from mocapidx.store.aside import lost_sources
from mocapidx.store.manifest import Document, Placed
from mocapidx.store.read import Snapshot, open_store
from mocapidx.tasks.records import Record
from mocapidx.tasks.segment_sources import segment_source, store_feature_set, untrusted_mask
from mocapidx.tasks.stored import REST, source_skeleton
from mocapidx.tasks.unspecified import UNSPECIFIED, unspecified_in
from mocapidx.tasks.where import meeting

__all__ = ["DOCUMENT_COLUMNS", "document_info", "list_documents", "store_info"]

DOCUMENT_COLUMNS: Final = (
    "document",
    "seconds",
    "source_frames",
    "source_rate_hz",
    "joint_map",
)
"""What a table shows of each document."""


def store_info(store: str | Path) -> Record:
    """Count what a store holds.

    Parameters
    ----------
    store : str or Path

    Returns
    -------
    mapping of str to number or str
        Documents, minutes, frames; documents that a repair took out and nobody has indexed again,
        if any; segments, lists and bytes a segment of each sub-index (the
        serialised lists alone); size on disk, feature set and versions; which kernels run, and
        with what instructions.

    Raises
    ------
    StoreError
    """
    with open_store(Path(store)) as snapshot:
        feature_set = store_feature_set(snapshot)
        settings = snapshot.manifest.settings
        documents = snapshot.documents()
        frames = sum(entry.document.frames for entry in documents)
        facts: dict[str, object] = {
            "documents": len(documents),
            "minutes": round(frames / settings.rate / 60, 2),
            "frames": frames,
            "rate_hz": settings.rate,
            "poses": "kept" if settings.poses else "not kept",
            "feature_set": f"{feature_set.name} ({len(feature_set.features)} features)",
            "feature_set_digest": feature_set.digest,
            "segment_files": len(snapshot.files),
            "megabytes": round(sum(f.h5.size + f.idx.size for f in snapshot.files) / 1e6, 2),
        }
        if lost := lost_sources(snapshot.path, [entry.document for entry in documents]):
            facts["lost_in_repairs"] = len(lost)
        for part in PARTS:
            facts |= _part_facts(snapshot, feature_set, part)
        facts |= {
            "store_format": schema.FORMAT_VERSION,
            "commits": snapshot.manifest.generation,
            "mocapidx": version("mocapidx"),
            "kernels": kernels_in_use(),
            "instructions": instructions_in_use(),
        }
    return facts


def _part_facts(snapshot: Snapshot, feature_set: FeatureSet, part: str) -> dict[str, object]:
    segments = size = 0
    words: set[int] = set()
    for file in snapshot.files:
        source = segment_source(snapshot, file, feature_set)
        lists = source.parts[PARTS.index(part)].lists
        segments += int(lists.counts.sum())
        size += lists.size
        words.update(lists.words.tolist())
    return {
        f"{part}_segments": segments,
        f"{part}_lists": len(words),
        f"{part}_bytes_a_segment": round(size / max(segments, 1), 2),
    }


def document_info(store: str | Path, name: str) -> Record:
    """Tell what is known of one document.

    Parameters
    ----------
    store : str or Path
    name : str
        The document's name.

    Returns
    -------
    mapping of str to number or str
        Length, source, segments of each sub-index, how its skeleton was understood, and the
        features that can't be trusted in it.

    Raises
    ------
    ParameterError
        If there is no such document.
    StoreError
    """
    with open_store(Path(store)) as snapshot:
        entry = _find(snapshot, name)
        document = entry.document
        feature_set = store_feature_set(snapshot)
        facts: dict[str, object] = {
            "document": document.name,
            "source": str(document.source),
            "seconds": round(document.frames / snapshot.manifest.settings.rate, 3),
            "frames": document.frames,
            "source_frames": document.source_frames,
            "source_rate_hz": document.source_rate,
            "segment_file": entry.file.names[0],
        }
        source = segment_source(snapshot, entry.file, feature_set)
        for name, part in zip(PARTS, source.parts, strict=True):
            ends = (entry.first, entry.first + document.frames)
            low, high = part.starts.search(np.array(ends))
            facts[f"{name}_segments"] = int(high - low)
        facts["untrusted_features"] = _untrusted(document, feature_set)
        if UNSPECIFIED in document.rig:
            rate = snapshot.manifest.settings.rate
            facts["open_in_gaps"] = _open_in_gaps(document, feature_set, rate)
        facts |= {**_rig_facts(document), **document.facts}
    return facts


def list_documents(store: str | Path, where: str | None = None) -> list[Record]:
    """List the documents of a store.

    Parameters
    ----------
    store : str or Path
    where : str, optional
        A condition that they meet, as in `mocapidx.tasks.where`.

    Returns
    -------
    list of mapping
        Name, length in seconds, frames and rate of the source, the joint map, the source, and
        what the names tell (None where a name doesn't), in the order of the names.

    Raises
    ------
    StoreError
    ParameterError
        If the condition can't be understood.
    """
    with open_store(Path(store)) as snapshot:
        rate = snapshot.manifest.settings.rate
        documents = [entry.document for entry in snapshot.documents()]
    told = sorted({key for document in documents for key in document.facts})
    if where is not None:
        met = meeting(documents, where, rate)
        documents = [document for document, holds in zip(documents, met, strict=True) if holds]
    return [
        {
            "document": document.name,
            "seconds": round(document.frames / rate, 3),
            "source_frames": document.source_frames,
            "source_rate_hz": _whole(document.source_rate),
            "joint_map": document.rig.get("joint_map"),
            "source": str(document.source),
            **{key: document.facts.get(key) for key in told},
        }
        for document in sorted(documents, key=lambda one: one.name)
    ]


def _whole(rate: float) -> int | float:
    return int(rate) if rate.is_integer() else rate


def _rig_facts(document: Document) -> Record:
    """Say how a skeleton was understood; what only `index` needs to know is left out."""
    skeleton = source_skeleton(document)
    facts: dict[str, object] = {} if skeleton is None else {"skeleton": skeleton[0]}
    for key, value in document.rig.items():
        if key == "coincident" and isinstance(value, list):
            pairs = (joints if isinstance(joints, list) else [joints] for joints in value)
            facts[key] = ", ".join(" = ".join(map(str, pair)) for pair in pairs) or "none"
        elif isinstance(value, (list, tuple)) and key not in ("skeleton", REST, UNSPECIFIED):
            facts[key] = ", ".join(map(str, value)) or "none"
        elif isinstance(value, (int, float, str)) and key not in ("options", "untrusted"):
            facts[key] = value
    return facts


def _find(snapshot: Snapshot, name: str) -> Placed:
    for entry in snapshot.documents():
        if entry.document.name == name:
            return entry
    known = [entry.document.name for entry in snapshot.documents()]
    raise ParameterError(
        f"{snapshot.path}: has no document '{shown(name)}' "
        f"('mocapidx info {snapshot.path} --documents' lists all){meant(name, known)}"
    )


def _open_in_gaps(document: Document, feature_set: FeatureSet, rate: float) -> str:
    """Say which features can't be told for a while, and for how long."""
    stretches = unspecified_in(document)
    mask = unspecified_within(stretches, 0, document.frames)
    seconds = sum(end - start for start, end, _ in stretches) / rate
    return f"{_named(mask, feature_set)}, for {seconds:.2f} s"


def _untrusted(document: Document, feature_set: FeatureSet) -> str:
    return _named(untrusted_mask(document), feature_set)


def _named(mask: int, feature_set: FeatureSet) -> str:
    return ", ".join(id for bit, id in enumerate(feature_set.ids) if mask >> bit & 1) or "none"
