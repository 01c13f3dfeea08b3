"""What one commit adds to a store: documents, their arrays and their index."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.store import schema
from mocapidx.store.manifest import Document, StoreSettings

__all__ = ["Batch", "batch_shapes", "batch_size", "check_batch"]


@dataclass(frozen=True, slots=True)
class Batch:
    """Documents that go into one segment file.

    Parameters
    ----------
    documents : collection of Document
        In the order in which their frames lie.
    arrays : mapping of str to ndarray or iterable of ndarray
        The datasets but for `meta`. An iterable's arrays are written end to end, and nothing
        holds more than one of them; ``runs/...`` must be arrays.
    index : bytes
        The inverted lists, as `mocapidx.index` makes them.
    index_head_size : int
        Bytes at the beginning of `index` that carry no digest of their own.
    """

    documents: Collection[Document]
    arrays: Mapping[str, NDArray[Any] | Iterable[NDArray[Any]]]
    index: bytes
    index_head_size: int


def check_batch(batch: Batch, settings: StoreSettings) -> None:
    """Refuse a batch that has not what a store takes.

    Parameters
    ----------
    batch : Batch
        To be written.
    settings : StoreSettings
        Of the store.

    Raises
    ------
    ParameterError
        If documents, datasets or the head of the index are not as they must be.
    """
    names = [document.name for document in batch.documents]
    if not names or len(set(names)) != len(names):
        raise ParameterError("a batch needs documents of different names")
    expected = {
        entry.path
        for entry in schema.COLUMNS.values()
        if entry is not schema.META and (settings.poses or not entry.optional)
    }
    if set(batch.arrays) != expected:
        raise ParameterError(
            f"a batch has {sorted(batch.arrays)}, this store takes {sorted(expected)}"
        )
    if not 0 < batch.index_head_size <= len(batch.index):
        raise ParameterError("the head of an index must lie in the index")


def batch_shapes(batch: Batch) -> dict[str, tuple[int, ...]]:
    """Give the shape that each dataset of a batch must have.

    Parameters
    ----------
    batch : Batch
        To be written.

    Returns
    -------
    dict of str to tuple of int
        Rows by the frames of its documents, for runs by the arrays themselves.
    """
    frames = sum(document.frames for document in batch.documents)
    shapes = {}
    for path, values in batch.arrays.items():
        rows = len(values) if isinstance(values, np.ndarray) and path[:5] == "runs/" else frames
        shapes[path] = (rows, *schema.column(path).trailing)
    return shapes


def batch_size(batch: Batch) -> int:
    """Count the bytes of a batch.

    Parameters
    ----------
    batch : Batch
        To be written.

    Returns
    -------
    int
        Of its datasets and its index.
    """
    rows = {path: shape[0] for path, shape in batch_shapes(batch).items()}
    return len(batch.index) + sum(
        count * schema.column(path).row_bytes for path, count in rows.items()
    )
