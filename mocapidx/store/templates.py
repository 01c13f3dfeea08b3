"""Template files: matrices and what is said of them, as a sealed file.

It holds ``meta`` (bytes of a JSON object) and ``matrices/0000``, ``matrices/0001``, ...
(float64). What the object says of them is `mocapidx.templates.file`'s.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.model import FloatArray
from mocapidx.store.sealed import SealedKind, read_sealed, write_sealed

__all__ = ["TEMPLATES", "read_templates", "write_templates"]

TEMPLATES: Final = SealedKind(
    format="mocapidx-templates",
    version=1,
    magic=b"mocapidx-mt-seal",
    called="template file",
    content="templates",
    made_with="mocapidx learn-mt",
    groups={"matrices": ("<f8", 2)},
)


def write_templates(path: Path, meta: Mapping[str, Any], matrices: Sequence[FloatArray]) -> None:
    """Write a template file; it is whole and on disk afterwards, or as it was before.

    Parameters
    ----------
    path : Path
    meta : mapping
        A JSON object that says what the matrices are.
    matrices : sequence of ndarray of float64, shape (K, F)
        At most 10,000, none empty.

    Raises
    ------
    ParameterError
        If there are too many matrices, or all is larger than a reader takes.
    WriteError
        If the file could not be written.
    """
    write_sealed(path, TEMPLATES, meta, {"matrices": matrices})


def read_templates(path: Path) -> tuple[dict[str, Any], list[NDArray[np.float64]]]:
    """Read a template file, every byte checked before it is used.

    Parameters
    ----------
    path : Path

    Returns
    -------
    meta : dict
        The JSON object; nothing in it is checked.
    matrices : list of ndarray of float64, shape (K, F)
        Read-only; values may be anything.

    Raises
    ------
    StoreError
        If there is no such file, or it is damaged, of another format or of a newer version.
    """
    meta, arrays = read_sealed(path, TEMPLATES)
    return meta, arrays["matrices"]
