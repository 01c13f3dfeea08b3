"""A match web ready to be searched: known to belong to a store, its paths decoded when needed."""

from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from mocapidx.errors import ParameterError, StoreError
from mocapidx.graphs.search_paths import SearchPaths, search_paths
from mocapidx.graphs.web_bytes import decode_paths
from mocapidx.printable import count, shown
from mocapidx.store.read import Snapshot
from mocapidx.store.web import WebFile, document_identity, read_web

__all__ = ["OpenWeb", "open_web"]

KEPT_CELLS: Final = 30_000_000
"""Path cells that stay decoded, some 30 bytes each."""


class OpenWeb:
    """A web that answers what searches ask.

    Parameters
    ----------
    web : WebFile
    where : Path
        Of the file, for messages.
    """

    def __init__(self, web: WebFile, where: Path) -> None:
        self.web, self.where = web, where
        self.numbers = {known.name: number for number, known in enumerate(web.documents)}
        self._parts: dict[int, list[tuple[int, int, int]]] = {}
        self._decoded: OrderedDict[int, SearchPaths] = OrderedDict()
        self._cells = 0
        for row, (first, second, _, size) in enumerate(web.pieces.tolist()):
            if size:
                self._parts.setdefault(first, []).append((row, second, 0))
                self._parts.setdefault(second, []).append((row, first, 1))

    @property
    def rate(self) -> float:
        """Frames a second in which it is searched, in Hz."""
        return self.web.rate / self.web.stride

    def holds(self, document: str) -> bool:
        """Whether a document takes part."""
        return document in self.numbers

    def frames(self, document: str) -> int:
        """Frames of a document at that rate."""
        return -(-self.web.documents[self._number(document)].frames // self.web.stride)

    def pieces(self, document: str) -> Iterator[tuple[str, int, SearchPaths]]:
        """Paths between a document and others, and the place of its frames in the cells."""
        for row, other, role in self._parts.get(self._number(document), ()):
            yield self.web.documents[other].name, role, self._piece(row)

    def _number(self, document: str) -> int:
        if document not in self.numbers:
            raise ParameterError(f"{shown(self.where)}: holds no document '{shown(document)}'")
        return self.numbers[document]

    def _piece(self, row: int) -> SearchPaths:
        """Decode the paths of a grid, or find them among those used last."""
        known = self._decoded.get(row)
        if known is not None:
            self._decoded.move_to_end(row)
            return known
        try:
            known = search_paths(decode_paths(self.web.piece(row)))
            self._check(known, row)
        except StoreError as exc:
            raise StoreError(
                f"{shown(self.where)}: damaged ({exc}); remove it and make it again with "
                "'mocapidx web build'"
            ) from exc
        self._decoded[row] = known
        self._cells += _size(known)
        while self._cells > KEPT_CELLS and len(self._decoded) > 1:
            self._cells -= _size(self._decoded.popitem(last=False)[1])
        return known

    def _check(self, paths: SearchPaths, row: int) -> None:
        documents = [self.web.documents[n] for n in self.web.pieces[row, :2].tolist()]
        lengths = [-(-known.frames // self.web.stride) for known in documents]
        for cells in (paths.paths.cells, paths.paths.inner_cells):
            if len(cells) and (cells.min() < 0 or (cells.max(axis=0) >= lengths).any()):
                raise StoreError("the paths of two documents leave them")


def _size(paths: SearchPaths) -> int:
    return len(paths.paths.cells) + len(paths.paths.inner_cells)


def open_web(path: str | Path, store: Snapshot) -> tuple[OpenWeb, int]:
    """Open a web and make sure that it belongs to a store.

    Parameters
    ----------
    path : str or Path
    store : Snapshot

    Returns
    -------
    web : OpenWeb
    missing : int
        Documents of the store that the web does not hold.

    Raises
    ------
    StoreError
        If it is no web, damaged, or of another store: it holds a document that the store does
        not have, or has changed since.
    """
    path = Path(path)
    web = read_web(path)
    rate = store.manifest.settings.rate
    documents = (entry.document for entry in store.documents())
    identities = {document_identity(one, rate): (one.name, one.frames) for one in documents}
    strangers = [
        known
        for known in web.documents
        if identities.get(known.identity) != (known.name, known.frames)
    ]
    if strangers or web.rate != rate:
        which = ""
        if strangers and len(strangers) < len(web.documents):
            which = f", for one of '{shown(strangers[0].name, 60)}' as it was or elsewhere"
        raise StoreError(
            f"{shown(path)}: a web of another store: {count(len(strangers), 'document')} of "
            f"{len(web.documents)} are not in {shown(store.path)}{which}; build it again"
        )
    return OpenWeb(web, path), len(identities) - len(web.documents)
