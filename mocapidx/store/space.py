"""Space files: registered examples of a motion and samples of their blends, as a sealed file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from mocapidx.store.sealed import SealedKind, read_sealed, write_sealed

__all__ = ["SPACE", "read_space", "write_space"]

SPACE: Final = SealedKind(
    format="mocapidx-space",
    version=1,
    magic=b"mocapidx-sp-seal",
    called="space file",
    content="arrays of examples",
    made_with="mocapidx blend fit",
    groups={
        "turns": ("<f4", 3),
        "places": ("<f8", 2),
        "curves": ("<f8", 2),
        "samples": ("<f8", 2),
        "offsets": ("<f8", 2),
    },
)


def write_space(
    path: Path, meta: Mapping[str, Any], arrays: Mapping[str, Sequence[NDArray[Any]]]
) -> None:
    """Write a space file; it is whole and on disk afterwards, or as it was before.

    Parameters
    ----------
    path : Path
    meta : mapping
        A JSON object that says what the arrays are.
    arrays : mapping of str to sequence of ndarray
        By the groups of `SPACE`.

    Raises
    ------
    ParameterError
        If it is larger than a reader takes.
    WriteError
        If the file could not be written.
    """
    write_sealed(path, SPACE, meta, arrays)


def read_space(path: Path) -> tuple[dict[str, Any], dict[str, list[NDArray[Any]]]]:
    """Read a space file, every byte checked before it is used.

    Parameters
    ----------
    path : Path

    Returns
    -------
    meta : dict
        The JSON object; nothing in it is checked.
    arrays : dict of str to list of ndarray
        By group; read-only, values may be anything.

    Raises
    ------
    StoreError
        If there is no such file, or it is damaged, of another format or of a newer version.
    """
    return read_sealed(path, SPACE)
