"""File names made from names that anybody may have chosen, and writing below one folder only."""

import hashlib
import os
import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import Final

from mocapidx.errors import ParameterError
from mocapidx.printable import shown

__all__ = ["check_targets", "document_stem", "make_folder", "slug"]

UNFIT: Final = re.compile(r"[^A-Za-z0-9]+")
LONGEST: Final = 40  # characters of a name that a file name keeps
DIGEST: Final = 4  # bytes


def slug(text: str) -> str:
    """Keep of a name what every file system takes.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        At most 40 ASCII letters, digits and single underscores; perhaps none.

    Examples
    --------
    >>> slug("../../etc/Früh stück"), slug("<script>")
    ('etc_Fruh_stuck', 'script')
    """
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode("ascii")
    # accents are gone by now, so what is left out here separates words
    return UNFIT.sub("_", plain).strip("_")[:LONGEST].strip("_")


def document_stem(document: str) -> str:
    """Name a file after a document: recognisable, and different for different documents.

    Parameters
    ----------
    document : str
        Its name, which may hold anything.

    Returns
    -------
    str
        What `slug` keeps of its last part without the suffix, ``-``, and eight digits of a
        digest of the whole name; names that differ in case only differ there.
    """
    digest = hashlib.blake2b(document.encode("utf-8", "surrogatepass"), digest_size=DIGEST)
    return f"{slug(PurePosixPath(document).stem) or 'document'}-{digest.hexdigest()}"


def make_folder(folder: Path) -> None:
    """Make the folder that results go to, if there is none; the one above must be there.

    Raises
    ------
    ParameterError
        If it can't be made, or is something else.
    """
    try:
        folder.mkdir(exist_ok=True)
    except OSError as exc:
        if isinstance(exc, FileExistsError):
            raise ParameterError(f"{shown(folder, None)}: is a file, expected a folder") from exc
        if isinstance(exc, FileNotFoundError):
            above = shown(folder.parent, None)
            raise ParameterError(
                f"{shown(folder, None)}: there is no folder {above}; make it first"
            ) from exc
        reason = (exc.strerror or "").lower()
        raise ParameterError(f"{shown(folder, None)}: can't be made: {reason}") from exc


def check_targets(paths: Iterable[Path], force: bool) -> None:
    """See to it that nothing is written over, nor through a link to somewhere else.

    Parameters
    ----------
    paths : iterable of Path
        What is to be written.
    force : bool
        Whether files that are there may be replaced; links and folders never are.

    Raises
    ------
    ParameterError
        If one of them is in the way.
    """
    for path in paths:
        where = shown(path, None)
        if path.is_symlink():
            raise ParameterError(f"{where}: is a symbolic link; remove it or choose another folder")
        if os.path.lexists(path):
            if not path.is_file():
                raise ParameterError(f"{where}: is in the way and no regular file")
            if not force:
                raise ParameterError(f"{where}: is there already; --force replaces it")
