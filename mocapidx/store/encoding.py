"""A manifest as bytes: one line with the digest of the rest, then JSON.

Documents are written by column, which is smaller than one object for each and lets whole
columns be checked at once. Whatever the bytes hold, decoding ends in a manifest whose parts
agree with each other or in a StoreError.
"""

import gc
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

from mocapidx.errors import StoreError
from mocapidx.store import schema
from mocapidx.store.json_text import from_json, is_mostly_brackets, to_json, with_lists
from mocapidx.store.manifest import (
    Dataset,
    Document,
    FileRecord,
    Manifest,
    Rig,
    SegmentFile,
    StoreSettings,
    block_count,
    file_digest,
)

__all__ = ["decode_manifest", "encode_manifest", "meta_json"]

DIGEST: Final = re.compile(r"[0-9a-f]{64}", re.ASCII)
HEX: Final = re.compile(r"[0-9a-f]*", re.ASCII)
BIGGEST: Final = 2**63 - 1
POSITIONS: Final = 2**32 - 1
SLOWEST, FASTEST = 1e-3, 1e4  # Hz
COLUMN_TYPES: Final[dict[str, frozenset[type]]] = {
    "name": frozenset({str}),
    "root": frozenset({int}),
    "path": frozenset({str, type(None)}),
    "digest": frozenset({str}),
    "size": frozenset({int}),
    "mtime_ns": frozenset({int}),
    "frames": frozenset({int}),
    "source_frames": frozenset({int}),
    "source_rate": frozenset({float}),
    "rig": frozenset({int}),
    "live": frozenset({bool}),
    "facts": frozenset({dict}),
}


class Wrong(Exception):
    """What is wrong with a manifest; becomes a StoreError that names the file."""


def encode_manifest(manifest: Manifest) -> bytes:
    """Write a manifest as bytes; equal manifests give equal bytes.

    Parameters
    ----------
    manifest : Manifest
        What to write.

    Returns
    -------
    bytes
        Two lines: the digest in hexadecimal, then JSON in ASCII.

    Raises
    ------
    StoreError
        If it would be larger than a reader takes.
    """
    shared = _Shared()
    files = [to_json(_file_json(file, shared)) for file in manifest.files]
    facts = {
        **_settings_json(manifest.settings),
        "generation": manifest.generation,
        "next": manifest.next_number,
        "roots": list(shared.roots),
    }
    body = with_lists(to_json(facts), rigs=shared.rigs, files=files)
    if len(body) > schema.MANIFEST_LIMIT - 65:
        raise StoreError(
            f"a manifest of {len(body)} bytes is over the limit of {schema.MANIFEST_LIMIT}; "
            "split the archive over several stores"
        )
    if is_mostly_brackets(body):
        raise StoreError(
            "names of documents or gaps of their points have more brackets than a reader takes; "
            "rename some, fill gaps, or split the archive over several stores"
        )
    return file_digest(body).hexdigest().encode() + b"\n" + body


def meta_json(documents: Iterable[Document], settings: StoreSettings) -> bytes:
    """Say in a segment file itself what it holds, for a day without the manifest.

    Parameters
    ----------
    documents : iterable of Document
        In the order in which their frames lie; all count as live.
    settings : StoreSettings
        Of the store.

    Returns
    -------
    bytes
        JSON in ASCII.
    """
    shared = _Shared()
    columns = _documents_json(documents, shared)
    del columns["live"]
    facts = to_json({**_settings_json(settings), "roots": list(shared.roots)})
    return with_lists(facts, rigs=shared.rigs)[:-1] + b',"documents":' + to_json(columns) + b"}"


def decode_manifest(data: bytes, path: Path) -> Manifest:
    """Read a manifest from bytes that nobody has checked yet.

    Parameters
    ----------
    data : bytes
        At most `schema.MANIFEST_LIMIT`.
    path : Path
        Where they come from, for messages.

    Returns
    -------
    Manifest
        Its parts agree: names are unique, offsets lie within files, rows match frames.

    Raises
    ------
    StoreError
        If the digest is wrong, the format is of another version or anything does not fit.
    """
    digest, _, body = data.partition(b"\n")
    try:
        if digest != file_digest(body).hexdigest().encode():
            raise Wrong("its digest does not match")
        with _no_garbage():
            return _manifest(from_json(body), path)
    except (Wrong, ValueError, RecursionError) as exc:
        what = exc if isinstance(exc, Wrong) else "it is not JSON as mocapidx writes it"
        raise StoreError(
            f"{path}: damaged ({what}); move the store away and index the sources again"
        ) from exc


@contextmanager
def _no_garbage() -> Iterator[None]:
    """Keep the search for cycles off, which takes a third of the time and would find none."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _settings_json(settings: StoreSettings) -> dict[str, Any]:
    return {
        "format": schema.FORMAT,
        "version": schema.FORMAT_VERSION,
        "rate": settings.rate,
        "poses": settings.poses,
        "feature_set": {
            "name": settings.feature_set_name,
            "digest": settings.feature_set_digest,
            "text": settings.feature_set_text,
        },
    }


@dataclass
class _Shared:
    """What many documents have in common, and its number: roots, and rigs as JSON."""

    roots: dict[str, int] = field(default_factory=dict)
    rigs: dict[bytes, int] = field(default_factory=dict)
    numbers: dict[int, int] = field(default_factory=dict)  # of rigs, by the object

    def rig(self, rig: Rig) -> int:
        number = self.numbers.get(id(rig))
        if number is None:
            text = to_json(dict(rig), sort_keys=True)
            number = self.numbers[id(rig)] = self.rigs.setdefault(text, len(self.rigs))
        return number


def _documents_json(documents: Iterable[Document], shared: _Shared) -> dict[str, list[Any]]:
    """Lay documents out by column; roots and rigs become numbers."""
    documents = tuple(documents)
    columns: dict[str, list[Any]] = {
        entry.name: list(map(attrgetter(entry.name), documents)) for entry in fields(Document)
    }
    roots = shared.roots
    columns["root"] = [roots.setdefault(root, len(roots)) for root in columns["root"]]
    columns["rig"] = [shared.rig(rig) for rig in columns["rig"]]
    if any(columns["facts"]):
        columns["facts"] = [dict(sorted(facts.items())) for facts in columns["facts"]]
    else:  # so stores from before there were facts keep their bytes
        del columns["facts"]
    return columns


def _file_json(file: SegmentFile, shared: _Shared) -> dict[str, Any]:
    return {
        "number": file.number,
        **{
            name: {"size": record.size, "digest": record.digest}
            for name, record in (("h5", file.h5), ("idx", file.idx), ("head", file.head))
        },
        "datasets": {
            path: {
                "dtype": schema.column(path).dtype.str,
                "shape": list(dataset.shape),
                "offset": dataset.offset,
                "blocks": dataset.blocks,
            }
            for path, dataset in sorted(file.datasets.items())
        },
        "documents": _documents_json(file.documents, shared),
    }


def _manifest(tree: Any, path: Path) -> Manifest:
    if type(tree) is not dict or tree.get("format") != schema.FORMAT:
        raise Wrong("it is no mocapidx manifest")
    version = _whole(tree, "version", low=1)
    if version not in schema.READABLE_VERSIONS:
        raise StoreError(
            f"{path}: written by a newer mocapidx (store format {version}, this one reads "
            f"{max(schema.READABLE_VERSIONS)}); upgrade"
        )
    feature_set = _get(tree, "feature_set", dict)
    settings = StoreSettings(
        rate=_rate(_get(tree, "rate", float)),
        feature_set_name=_get(feature_set, "name", str),
        feature_set_digest=_digest(feature_set),
        feature_set_text=_get(feature_set, "text", str),
        poses=_get(tree, "poses", bool),
    )
    roots = [_path(root) for root in _all(_get(tree, "roots", list), str)]
    rigs = _all(_get(tree, "rigs", list), dict)
    files = tuple(
        _file(entry, settings, roots, rigs) for entry in _all(_get(tree, "files", list), dict)
    )
    manifest = Manifest(
        settings, files, _whole(tree, "generation"), _whole(tree, "next", low=1, high=10**12)
    )
    numbers = [file.number for file in files]
    if numbers != sorted(set(numbers)) or (numbers and numbers[-1] >= manifest.next_number):
        raise Wrong("its segment files are not in order")
    names = [entry.name for file in files for entry in file.documents if entry.live]
    if len(set(names)) != len(names):
        raise Wrong("a document name stands twice")
    return manifest


def _file(
    tree: dict[str, Any], settings: StoreSettings, roots: list[str], rigs: list[Rig]
) -> SegmentFile:
    h5, idx, head = (_record(_get(tree, name, dict)) for name in ("h5", "idx", "head"))
    if head.size > idx.size:
        raise Wrong("the head of an index is larger than the index")
    trees = _get(tree, "datasets", dict)
    expected = {
        entry.path for entry in schema.COLUMNS.values() if settings.poses or not entry.optional
    }
    if set(trees) != expected:
        raise Wrong("a segment file has not the datasets of the format")
    datasets = {
        path: _dataset(_get(trees, path, dict), schema.COLUMNS[path], h5.size) for path in trees
    }
    number = _whole(tree, "number", low=1, high=10**12 - 1)
    columns = _get(tree, "documents", dict)
    # Before a document is made: there may be as many as a manifest has room for.
    _check_rows(datasets, _all(_get(columns, "frames", list), int))
    return SegmentFile(number, h5, idx, head, datasets, _documents(columns, roots, rigs))


def _check_rows(datasets: Mapping[str, Dataset], lengths: Sequence[int]) -> None:
    frames, documents = sum(lengths), len(lengths)
    if frames + documents > POSITIONS:
        raise Wrong("a segment file has more positions than 32 bits count")
    for path, dataset in datasets.items():
        rows = dataset.shape[0]
        if path.startswith("frames/") and rows != frames:
            raise Wrong(f"{path} has {rows} rows for {frames} frames")
        if path.startswith("runs/") and not 2 * documents <= rows <= frames + documents:
            raise Wrong(f"{path} has {rows} rows for {frames} frames of {documents} documents")
    for part in schema.PARTS:
        starts, words = schema.RUN_STARTS[part].path, schema.RUN_WORDS[part].path
        if datasets[starts].shape != datasets[words].shape:
            raise Wrong(f"{starts} and {words} differ in length")


def _dataset(tree: dict[str, Any], column: schema.Column, file_size: int) -> Dataset:
    shape = tuple(_all(_get(tree, "shape", list), int))
    offset, blocks = _whole(tree, "offset"), _get(tree, "blocks", str)
    if _get(tree, "dtype", str) != column.dtype.str:
        raise Wrong(f"{column.path} has another dtype than the format says")
    if len(shape) != len(column.axes) or shape[1:] != column.trailing:
        raise Wrong(f"{column.path} has another shape than the format says")
    size = shape[0] * column.row_bytes
    if shape[0] < 0 or offset + size > file_size:
        raise Wrong(f"{column.path} does not lie within its file")
    if len(blocks) != 32 * block_count(size) or not HEX.fullmatch(blocks):
        raise Wrong(f"{column.path} has not one digest a block")
    return Dataset(shape, offset, blocks)


def _documents(tree: dict[str, Any], roots: list[str], rigs: list[Rig]) -> tuple[Document, ...]:
    if "facts" not in tree:  # as in the first stores
        tree = {**tree, "facts": [{}] * len(_get(tree, "name", list))}
    columns = {name: _all(_get(tree, name, list), *types) for name, types in COLUMN_TYPES.items()}
    for facts in filter(None, columns["facts"]):
        _all((*facts, *facts.values()), str)
    count = len(columns["name"])
    if not count or any(len(values) != count for values in columns.values()):
        raise Wrong("the columns of its documents differ in length or are empty")
    _within(columns["root"], 0, len(roots) - 1)
    _within(columns["rig"], 0, len(rigs) - 1)
    for name in ("frames", "source_frames"):
        _within(columns[name], 1, BIGGEST)
    _within(columns["size"], 0, BIGGEST)
    _within(columns["mtime_ns"], -BIGGEST, BIGGEST)
    for rate in set(columns["source_rate"]):
        _rate(rate)
    texts = [*columns["name"], *(path for path in columns["path"] if path is not None)]
    _path("".join(texts) if all(texts) else "")
    if not HEX.fullmatch("".join(columns["digest"])):
        raise Wrong("the digest of a document is not hexadecimal")
    columns["root"] = [roots[number] for number in columns["root"]]
    columns["rig"] = [rigs[number] for number in columns["rig"]]
    return tuple(map(Document, *(columns[entry.name] for entry in fields(Document))))


def _get(tree: Mapping[str, Any], key: str, kind: type) -> Any:
    value = tree.get(key)
    if type(value) is not kind:
        raise Wrong(f"{key!r} is missing or no {kind.__name__}")
    return value


def _all(values: Sequence[Any], *kinds: type) -> list[Any]:
    if not set(map(type, values)) <= set(kinds):
        raise Wrong("a list holds values of a wrong type")
    return list(values)


def _whole(tree: Mapping[str, Any], key: str, low: int = 0, high: int = BIGGEST) -> int:
    value: int = _get(tree, key, int)
    if not low <= value <= high:
        raise Wrong(f"{key!r} is out of range")
    return value


def _within(values: list[int], low: int, high: int) -> None:
    if not low <= min(values) <= max(values) <= high:
        raise Wrong("a number of a document is out of range")


def _rate(value: float) -> float:
    if not SLOWEST <= value <= FASTEST:
        raise Wrong(f"a rate is not between {SLOWEST:g} and {FASTEST:g} Hz")
    return value


def _path(text: str) -> str:
    # No system has a file of such a name, so it was never indexed.
    if not text or "\0" in text:
        raise Wrong("a name is empty or holds a NUL")
    return text


def _record(tree: dict[str, Any]) -> FileRecord:
    return FileRecord(_whole(tree, "size"), _digest(tree))


def _digest(tree: dict[str, Any]) -> str:
    digest: str = _get(tree, "digest", str)
    if not DIGEST.fullmatch(digest):
        raise Wrong("a digest is not 64 hexadecimal digits")
    return digest
