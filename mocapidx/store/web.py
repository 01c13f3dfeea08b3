"""Match web files: which documents they compare, and the paths between each two of them.

A sealed file (`mocapidx.store.sealed`): what it says of itself, ``pieces/0000`` (a row for each
grid: numbers of the two documents, place and size of its paths) and ``paths/0000``, the bytes
themselves; both are missing where there is nothing. A document goes by a digest of its name and
of what its poses follow from, so that a web is known to belong to a store; documents and pieces
are ordered by it, and equal documents give equal bytes, whichever came first.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import StoreError
from mocapidx.model import IndexArray
from mocapidx.printable import shown
from mocapidx.store.manifest import Document
from mocapidx.store.sealed import SealedKind, read_sealed, write_sealed

__all__ = ["WebDocument", "WebFile", "document_identity", "read_web", "write_web"]

KIND: Final = SealedKind(
    format="mocapidx-web",
    version=1,
    magic=b"mocapidx-webseal",
    called="match web",
    content="parts",
    made_with="mocapidx web build",
    groups={"pieces": ("<i8", 2), "paths": ("|u1", 1)},
    most_bytes=16 << 30,
)
PIECE_COLUMNS: Final = 4
FASTEST: Final = 1e6  # Hz
REMOVE: Final = "(remove it first, or give another --output)"
"""What to do before: a build goes on from the web that is there, and replaces no damaged one."""


@dataclass(frozen=True, slots=True)
class WebDocument:
    """A document of a web.

    Parameters
    ----------
    identity : str
        Digest in hexadecimal; equal for documents of equal name and equal poses.
    name : str
    frames : int
        At the rate of the store.
    """

    identity: str
    name: str
    frames: int


@dataclass(frozen=True, slots=True, eq=False)
class WebFile:
    """What a web file holds.

    Parameters
    ----------
    rate : float
        Of the store and of the frames in paths, in Hz.
    stride : int
        Frames of the store for one frame of the grids in which the paths were found.
    rules : mapping of str to number or bool
        How they were found.
    documents : tuple of WebDocument
        Ordered by identity.
    pieces : ndarray of int64, shape (G, 4)
        For each grid the numbers of its two documents, the first not the larger one, and place
        and size of its paths in `paths`; 0 bytes where there is none. Ordered by documents.
    paths : memoryview
    """

    rate: float
    stride: int
    rules: Mapping[str, Any]
    documents: tuple[WebDocument, ...]
    pieces: IndexArray
    paths: memoryview = field(repr=False)

    def piece(self, number: int) -> memoryview:
        """Give the bytes of a grid's paths."""
        place, size = self.pieces[number, 2:].tolist()
        return self.paths[place : place + size]


def document_identity(document: Document, rate: float) -> str:
    """Give a digest of a document's name and of all that its poses follow from.

    Parameters
    ----------
    document : Document
    rate : float
        Of the store, in Hz.

    Returns
    -------
    str
        32 hexadecimal digits.
    """
    rig = {key: value for key, value in document.rig.items() if key != "skeleton"}
    known = [document.name, document.digest, document.frames, rate, rig]
    text = json.dumps(known, sort_keys=True, ensure_ascii=True)
    return hashlib.blake2b(text.encode("ascii"), digest_size=16).hexdigest()


def write_web(path: Path, web: WebFile) -> None:
    """Write a web file; it is whole and on disk afterwards, or as it was before.

    Parameters
    ----------
    path : Path
    web : WebFile

    Raises
    ------
    WriteError
        If the file could not be written.
    """
    meta = {
        "rate": web.rate,
        "stride": web.stride,
        "rules": dict(web.rules),
        "documents": [[known.identity, known.name, known.frames] for known in web.documents],
    }
    arrays: dict[str, list[NDArray[Any]]] = {
        "pieces": [web.pieces] if len(web.pieces) else [],
        "paths": [np.frombuffer(web.paths, np.uint8)] if len(web.paths) else [],
    }
    write_sealed(path, KIND, meta, arrays)


def read_web(path: Path) -> WebFile:
    """Read a web file, every byte checked before it is used.

    Parameters
    ----------
    path : Path

    Returns
    -------
    WebFile
        The paths themselves are checked when they are decoded.

    Raises
    ------
    StoreError
        If there is no such file, or it is damaged, of another kind or of a newer version.
    """
    try:
        meta, arrays = read_sealed(path, KIND)
    except StoreError as exc:
        if str(exc).endswith(f"'{KIND.made_with}'") and os.path.lexists(path):
            raise StoreError(f"{exc} {REMOVE}") from exc
        raise
    try:
        documents = tuple(_document(entry) for entry in meta["documents"])
        pieces = (arrays["pieces"] or [np.empty((0, PIECE_COLUMNS), np.int64)])[0]
        paths = (arrays["paths"] or [np.empty(0, np.uint8)])[0]
        _check_pieces(pieces, len(documents), len(paths))
        rate, stride, rules = meta["rate"], meta["stride"], meta["rules"]
        if type(rate) not in (int, float) or not 0 < rate <= FASTEST:
            raise ValueError("its rate is none")
        if type(stride) is not int or not 1 <= stride <= rate or type(rules) is not dict:
            raise ValueError("its rules are none")
        if any(a.identity >= b.identity for a, b in pairwise(documents)):
            raise ValueError("its documents are out of order")
    except (ValueError, TypeError, KeyError, RecursionError) as exc:
        raise StoreError(
            f"{shown(path)}: damaged ({shown(exc)}); make it again with '{KIND.made_with}' {REMOVE}"
        ) from exc
    view = np.ascontiguousarray(paths).data.cast("B")
    return WebFile(float(rate), stride, rules, documents, pieces.astype(np.int64), view)


def _document(entry: Any) -> WebDocument:
    identity, name, frames = entry
    if type(identity) is not str or type(name) is not str or type(frames) is not int:
        raise ValueError("a document of it is none")
    if not 1 <= frames < 1 << 32:
        raise ValueError(f"a document of it has {'no' if frames < 1 else 'too many'} frames")
    return WebDocument(identity, name, frames)


def _check_pieces(pieces: IndexArray, documents: int, size: int) -> None:
    if pieces.shape[1] != PIECE_COLUMNS:
        raise ValueError("its table of pieces has other columns")
    if not len(pieces):
        return
    first, second, place, length = pieces.T
    numbers = (first >= 0).all() and (first <= second).all() and (second < documents).all()
    places = (place >= 0).all() and (length >= 0).all()
    if not numbers or not places or not ((place <= size) & (length <= size - place)).all():
        raise ValueError("its table of pieces points outside it")
