"""NumPy's files read safely: no pickles, and no more memory than the file's own size allows."""

import io
import math
import sys
import warnings
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import FormatError
from mocapidx.formats.text import Limits, place, read_binary
from mocapidx.model import FloatArray
from mocapidx.printable import shown

__all__ = ["array_names", "as_numbers", "as_texts", "read_array", "read_arrays"]

LARGEST_RATIO: Final = 20  # of what comes out to the size of the file; motion packs to a half
ALWAYS_ALLOWED: Final = 16 << 20  # bytes that may come out of any file
MOST_MEMBERS: Final = 1000
LONGEST_HEADER: Final = 10_000  # bytes; what numpy itself takes without questions
Array = NDArray[Any]


def read_arrays(path: Path, limits: Limits, wanted: Collection[str]) -> dict[str, Array]:
    """Read some arrays of an npz file.

    Parameters
    ----------
    path : Path
        The file.
    limits : Limits
        What is refused as too large.
    wanted : collection of str
        Names of arrays; others are left alone.

    Returns
    -------
    dict of str to ndarray
        Those that are there.

    Raises
    ------
    FormatError
        If the file is no npz file, is damaged, holds objects, or would take far more memory
        than disk.
    """
    where = place(path)
    data = read_binary(path, limits)
    with _opened(where, data) as archive:
        infos = [info for info in archive.infolist() if _name_of(info) in wanted]
        names = [_name_of(info) for info in infos]
        for name in names:
            if names.count(name) > 1:
                raise FormatError(f"{where}: holds '{shown(name)}' twice; is it damaged?")
        _check_size(where, len(data), sum(info.file_size for info in infos))
        arrays = {
            name: _array(f"{where}: '{shown(name)}'", _member(where, archive, info))
            for name, info in zip(names, infos, strict=True)
        }
    _check_size(where, len(data), sum(map(_worked_size, arrays.values())))
    return arrays


def read_array(path: Path, limits: Limits) -> Array:
    """Read an npy file.

    Parameters
    ----------
    path : Path
        The file.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    ndarray

    Raises
    ------
    FormatError
        If the file is no npy file, is cut off or holds objects.
    """
    return _array(place(path), read_binary(path, limits))


def array_names(path: Path) -> tuple[str, ...]:
    """Return the names of the arrays in an npz file; none where it is none.

    Parameters
    ----------
    path : Path

    Returns
    -------
    tuple of str
    """
    try:
        with zipfile.ZipFile(path) as archive:
            return tuple(_name_of(info) for info in archive.infolist()[:MOST_MEMBERS])
    except Exception:  # whatever a file that is no archive leads to
        return ()


def as_numbers(value: Array, where: str, shape: tuple[int | None, ...]) -> FloatArray:
    """Check that an array holds numbers and has a shape.

    Parameters
    ----------
    value : ndarray
    where : str
        File and name of the array, for messages.
    shape : tuple of int or None
        What is expected; None is any number.

    Returns
    -------
    ndarray of float64

    Raises
    ------
    FormatError
    """
    fits = len(value.shape) == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, value.shape, strict=True)
    )
    if not fits or value.dtype.kind not in "fiu":
        expected = ", ".join("any" if n is None else str(n) for n in shape)
        raise FormatError(
            f"{where}: is {value.dtype} of shape {value.shape}, expected numbers of shape "
            f"({expected})"
        )
    with np.errstate(all="ignore"):
        return value.astype(np.float64)


def as_texts(value: Array, where: str) -> tuple[str, ...]:
    """Check that an array holds names.

    Parameters
    ----------
    value : ndarray
    where : str
        File and name of the array, for messages.

    Returns
    -------
    tuple of str

    Raises
    ------
    FormatError
    """
    if value.ndim != 1 or value.dtype.kind not in "US":
        raise FormatError(f"{where}: is {value.dtype} of shape {value.shape}, expected names")
    names = value.tolist()
    return tuple(n.decode("utf-8", "surrogateescape") if isinstance(n, bytes) else n for n in names)


def _check_size(where: str, size: int, becomes: int) -> None:
    if becomes > max(ALWAYS_ALLOWED, LARGEST_RATIO * size):
        raise FormatError(
            f"{where}: {size:,} bytes would become {becomes:,}; no motion is packed so tightly"
        )


def _worked_size(array: Array) -> int:
    """Bytes of an array when it is worked with: of each number, or of each name as an object."""
    return array.size * (64 + array.itemsize if array.dtype.kind in "US" else 8)


def _opened(where: str, data: bytes) -> zipfile.ZipFile:
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except Exception as exc:  # BadZipFile, and whatever else odd bytes lead to
        raise FormatError(f"{where}: not an npz file: {shown(exc, 100)}") from exc
    if len(archive.infolist()) > MOST_MEMBERS:
        raise FormatError(f"{where}: holds more than {MOST_MEMBERS} arrays; not a motion file")
    return archive


def _name_of(info: zipfile.ZipInfo) -> str:
    return info.filename.removesuffix(".npy")


def _member(where: str, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    name = shown(_name_of(info))
    try:
        with archive.open(info) as member:
            data = member.read(info.file_size + 1)
    except Exception as exc:  # zipfile, zlib, lzma: each has its own
        raise FormatError(f"{where}: '{name}' can't be unpacked: {shown(exc, 100)}") from exc
    if len(data) != info.file_size:
        raise FormatError(f"{where}: '{name}' is not as long as it says; is it damaged?")
    return data


def _array(where: str, data: bytes) -> Array:
    stream = io.BytesIO(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            version = np.lib.format.read_magic(stream)
            read = {
                (1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0,
            }[version]
            shape, fortran, kind = read(stream, max_header_size=LONGEST_HEADER)
    except Exception as exc:  # ValueError, KeyError, SyntaxError, TokenError, RecursionError, ...
        raise FormatError(f"{where}: not an array that numpy wrote") from exc
    if kind.hasobject or kind.kind not in "fiuUS":
        raise FormatError(f"{where}: holds {shown(kind, 40)}, expected numbers or names")
    count = math.prod(shape)
    if any(n < 0 for n in shape) or count * kind.itemsize > len(data) - stream.tell():
        raise FormatError(
            f"{where}: says shape {shown(shape, 60)}, has {len(data) - stream.tell()} bytes; "
            "is it cut off?"
        )
    if not kind.itemsize:
        return np.zeros(0, kind)
    flat = np.frombuffer(data, dtype=kind, count=count, offset=stream.tell())
    if kind.kind == "U" and (flat.view(f"{kind.byteorder}u4") > sys.maxunicode).any():
        raise FormatError(f"{where}: holds names of what is no character; is it damaged?")
    return flat.reshape(shape, order="F" if fortran else "C")
