"""Find the document that a name from elsewhere means."""

from collections.abc import Iterable
from pathlib import PurePosixPath

from mocapidx.errors import FormatError
from mocapidx.printable import shown
from mocapidx.tasks.safe_names import document_stem

__all__ = ["DocumentNames"]


class DocumentNames:
    """The names of some documents, and what else each may be called.

    Parameters
    ----------
    names : iterable of str
        Of the documents, all different.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._exact = dict.fromkeys(names)
        self._others: dict[str, list[str]] | None = None

    def find(self, given: str, where: str = "") -> str | None:
        """Find the document of a name.

        Parameters
        ----------
        given : str
            A document's name; or that name as CSV and other programs' files hold it, with odd
            characters escaped; or its file name, with or without the suffix; or the name that
            `export` gives to a file about it.
        where : str
            Who says so, for messages.

        Returns
        -------
        str or None
            The document's name, None where there is none.

        Raises
        ------
        FormatError
            If several documents could be meant.
        """
        if given in self._exact:
            return given
        if self._others is None:
            self._others = {}
            for name in self._exact:
                for other in dict.fromkeys(_other_names(name)):
                    self._others.setdefault(other, []).append(name)
        found = self._others.get(given, [])
        if len(found) > 1:
            raise FormatError(
                f"{where}: '{shown(given)}' could be {shown(found[0])} or {shown(found[1])}; "
                "give the whole name"
            )
        return found[0] if found else None


def _other_names(name: str) -> Iterable[str]:
    path = PurePosixPath(name)
    for other in (name, str(path.with_suffix("")) if path.name else name, path.name, path.stem):
        yield from (other, shown(other, None), shown(other))
    yield document_stem(name)
