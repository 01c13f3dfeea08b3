"""Sealed files: arrays and what is said of them, in one HDF5 file with a sealed end.

Behind the HDF5 image, where HDF5 itself does not look, stand a table of the datasets, a digest
of all before it and a magic number. Our reader starts there: it checks the digest first, takes
the datasets straight from their places, and never lets HDF5 see a byte. The layout is::

    HDF5 image | table (JSON) | size of the table, 8 bytes | BLAKE2b, 32 bytes | magic, 16 bytes

The image holds ``meta`` (bytes of a JSON object) and numbered arrays in groups, as in
``matrices/0000``, ``matrices/0001``, ... Each kind of file has its own groups.
"""

import io
import json
import os
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.durable import durable_replace
from mocapidx.errors import ParameterError, StoreError
from mocapidx.printable import shown
from mocapidx.store.files import open_regular, read_exactly, reason
from mocapidx.store.json_text import from_json
from mocapidx.store.manifest import file_digest

__all__ = ["SEAL", "SealedKind", "read_sealed", "write_sealed"]

SIZE_LIMIT: Final = 256 << 20  # bytes
MOST_DATASETS: Final = 10_000
LARGEST_TABLE: Final = 160 * (MOST_DATASETS + 1)
"""Bytes; a dataset takes fewer than 100 to list."""

SEAL: Final = struct.Struct("<Q32s16s")
HDF5_MAGIC: Final = b"\x89HDF\r\n\x1a\n"
TEXT: Final = "|u1"


@dataclass(frozen=True, slots=True)
class SealedKind:
    """A kind of sealed file.

    Parameters
    ----------
    format : str
        Its name in the table.
    version : int
        The version that is written, and the newest that is read.
    magic : bytes
        The last 16 bytes of every file.
    called : str
        What messages call it.
    content : str
        What messages call its arrays.
    made_with : str
        The command that makes it.
    groups : mapping of str to (str, int)
        Type and number of axes of the arrays in each group.
    most_bytes : int, optional
        Of a file that is read; half of it in arrays that are written. Default `SIZE_LIMIT`.
    """

    format: str
    version: int
    magic: bytes
    called: str
    content: str
    made_with: str
    groups: Mapping[str, tuple[str, int]]
    most_bytes: int | None = None

    @property
    def limit(self) -> int:
        """Bytes of a file that is read."""
        return self.most_bytes or SIZE_LIMIT


class Wrong(Exception):
    """What is wrong with a file; becomes a StoreError that names it."""


def write_sealed(
    path: Path,
    kind: SealedKind,
    meta: Mapping[str, Any],
    arrays: Mapping[str, Sequence[NDArray[Any]]],
) -> None:
    """Write a sealed file; it is whole and on disk afterwards, or as it was before.

    Parameters
    ----------
    path : Path
    kind : SealedKind
    meta : mapping
        A JSON object that says what the arrays are.
    arrays : mapping of str to sequence of ndarray
        By group; none empty.

    Raises
    ------
    ParameterError
        If there are too many arrays, or all is larger than a reader takes.
    WriteError
        If the file could not be written.
    """
    text = json.dumps(meta, separators=(",", ":"), allow_nan=False).encode("ascii")
    datasets: dict[str, NDArray[Any]] = {"meta": np.frombuffer(text, dtype=TEXT)}
    for group, members in arrays.items():
        for number, member in enumerate(members):
            data = np.ascontiguousarray(member, dtype=kind.groups[group][0])
            datasets[f"{group}/{number:04d}"] = data
    total = sum(data.nbytes for data in datasets.values())
    if len(datasets) - 1 > MOST_DATASETS or total > kind.limit // 2:
        raise ParameterError(
            f"{shown(path)}: {len(datasets) - 1} {kind.content} of {total} bytes are too many for "
            f"one file, at most {MOST_DATASETS} and {kind.limit // 2} bytes; use several files"
        )
    image, places = _image(datasets, list(kind.groups))
    table = {
        "format": kind.format,
        "version": kind.version,
        "datasets": {
            name: {"dtype": data.dtype.str, "shape": list(data.shape), "offset": places[name]}
            for name, data in datasets.items()
        },
    }
    body = image + json.dumps(table, separators=(",", ":")).encode("ascii")
    size = struct.pack("<Q", len(body) - len(image))
    digest = file_digest(body + size).digest()
    durable_replace(path, body + size + digest + kind.magic)


def _image(
    datasets: Mapping[str, NDArray[Any]], groups: Sequence[str]
) -> tuple[bytes, dict[str, int]]:
    """Build the HDF5 file in memory: contiguous datasets, no attributes, no times."""
    # Reading needs no HDF5, and a command that only reads should not wait for it.
    from mocapidx.store.hdf5 import h5d, h5f, h5fd, h5g, h5p, h5s, h5t

    sheet = io.BytesIO()
    creation = h5p.create(h5p.FILE_CREATE)
    creation.set_obj_track_times(False)
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_libver_bounds(h5f.LIBVER_V18, h5f.LIBVER_V18)
    access.set_fclose_degree(h5f.CLOSE_STRONG)  # closing writes all, whatever is still open
    access.set_fileobj_driver(h5fd.fileobj_driver, sheet)
    file = h5f.create(b"image", h5f.ACC_TRUNC, creation, access)
    plain_group = h5p.create(h5p.GROUP_CREATE)
    plain_group.set_obj_track_times(False)
    for group in groups:
        h5g.create(file, group.encode(), gcpl=plain_group)
    plain = h5p.create(h5p.DATASET_CREATE)
    plain.set_layout(h5d.CONTIGUOUS)
    plain.set_obj_track_times(False)
    plain.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    places = {}
    for name, data in datasets.items():
        space = h5s.create_simple(data.shape)
        dataset = h5d.create(file, name.encode(), h5t.py_create(data.dtype), space, dcpl=plain)
        dataset.write(h5s.ALL, h5s.ALL, data)
        places[name] = dataset.get_offset()
    file.close()
    return sheet.getvalue(), places


def read_sealed(path: Path, kind: SealedKind) -> tuple[dict[str, Any], dict[str, list[Any]]]:
    """Read a sealed file, every byte checked before it is used.

    Parameters
    ----------
    path : Path
    kind : SealedKind

    Returns
    -------
    meta : dict
        The JSON object; nothing in it is checked.
    arrays : dict of str to list of ndarray
        By group, each of the group's type and number of axes; read-only, values may be
        anything.

    Raises
    ------
    StoreError
        If there is no such file, or it is damaged, of another format or of a newer version.
    """
    data = _read_file(path, kind)
    try:
        return _contents(data, kind)
    except (Wrong, ValueError, RecursionError) as exc:
        what = exc if isinstance(exc, Wrong) else "it holds what is not JSON of mocapidx"
        raise StoreError(
            f"{shown(path)}: damaged ({what}); restore it, or make it again with '{kind.made_with}'"
        ) from exc


def _read_file(path: Path, kind: SealedKind) -> bytes:
    try:
        descriptor = open_regular(Path(os.path.realpath(path)))
        try:
            size = os.fstat(descriptor).st_size
            if size > kind.limit:
                raise StoreError(
                    f"{shown(path)}: has {size} bytes, a {kind.called} at most {kind.limit}"
                )
            start = max(size - SEAL.size, 0)
            is_sealed = read_exactly(descriptor, start, size - start).endswith(kind.magic)
            data = read_exactly(descriptor, 0, size if is_sealed else min(size, len(HDF5_MAGIC)))
        finally:
            os.close(descriptor)
    except FileNotFoundError as exc:
        raise StoreError(
            f"{shown(path)}: no {kind.called} here; make one with '{kind.made_with}'"
        ) from exc
    except (OSError, EOFError) as exc:
        if os.path.isdir(path):
            raise StoreError(f"{shown(path)}: is a folder, expected a {kind.called}") from exc
        raise StoreError(f"{shown(path)}: can't be read ({reason(exc)})") from exc
    if len(data) < SEAL.size or not is_sealed:
        what = "it is cut off or not closed by its seal" if data.startswith(HDF5_MAGIC) else ""
        raise StoreError(
            f"{shown(path)}: not a {kind.called} of mocapidx"
            + (f" ({what})" if what else "")
            + f"; make one with '{kind.made_with}'"
        )
    return data


def _contents(data: bytes, kind: SealedKind) -> tuple[dict[str, Any], dict[str, list[Any]]]:
    table_size, digest, _ = SEAL.unpack_from(data, len(data) - SEAL.size)
    if file_digest(memoryview(data)[: -SEAL.size + 8]).digest() != digest:
        raise Wrong("its digest does not match")
    image_size = len(data) - SEAL.size - table_size
    if image_size < 0:
        raise Wrong("its table does not lie within it")
    if table_size > LARGEST_TABLE:
        raise Wrong("its table lists too many datasets")
    table = from_json(data[image_size : image_size + table_size])
    if type(table) is not dict or table.get("format") != kind.format:
        raise Wrong(f"its table is none of a {kind.called}")
    version = table.get("version")
    if type(version) is not int or not 1 <= version <= kind.version:
        raise Wrong(
            f"its format version is {shown(version)}, this mocapidx reads {kind.version}; "
            "upgrade if it is newer"
        )
    datasets = table.get("datasets")
    if type(datasets) is not dict or not 1 <= len(datasets) <= MOST_DATASETS + 1:
        raise Wrong("its table lists no datasets, or too many")
    image = data[:image_size]
    text = _dataset(image, datasets, "meta", TEXT, 1).tobytes()
    meta = from_json(text)
    if type(meta) is not dict:
        raise Wrong("its meta is no JSON object")
    arrays = {}
    for group, (dtype, axes) in kind.groups.items():
        count = sum(name.startswith(f"{group}/") for name in datasets)
        arrays[group] = [
            _dataset(image, datasets, f"{group}/{number:04d}", dtype, axes)
            for number in range(count)
        ]
    if sum(map(len, arrays.values())) != len(datasets) - 1:
        raise Wrong(f"it holds what no {kind.called} does")
    return meta, arrays


def _dataset(
    image: bytes, datasets: dict[str, Any], name: str, dtype: str, axes: int
) -> NDArray[Any]:
    """Take a dataset from its place, after checking that it lies within the image."""
    entry = datasets.get(name)
    if type(entry) is not dict or entry.get("dtype") != dtype:
        raise Wrong(f"dataset {name} is missing or of a wrong type")
    shape, offset = entry.get("shape"), entry.get("offset")
    if type(shape) is not list or len(shape) != axes or type(offset) is not int:
        raise Wrong(f"dataset {name} has a wrong shape")
    if any(type(length) is not int or not 1 <= length <= SIZE_LIMIT for length in shape):
        raise Wrong(f"dataset {name} has a wrong shape")
    count = int(np.prod(shape, dtype=object))
    if not 0 <= offset <= len(image) - count * np.dtype(dtype).itemsize:
        raise Wrong(f"dataset {name} does not lie within the file")
    return np.frombuffer(image, np.dtype(dtype), count, offset).reshape(shape)
