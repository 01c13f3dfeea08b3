"""File names made from names that anybody may have chosen, and writing below one folder only."""

import hashlib
import os
import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import Final

from mocapidx.durable import make_folder
from mocapidx.errors import ParameterError, WriteError
from mocapidx.printable import shown

__all__ = ["check_place", "check_targets", "document_stem", "make_folders", "slug"]

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


def check_place(path: Path) -> None:
    """Refuse a file or a folder that may not be written, before any work is done for it.

    Parameters
    ----------
    path : Path
        There or yet to be made.

    Raises
    ------
    ParameterError
        If there is no folder to make it in.
    WriteError
        If nothing may be made or changed where it is.
    """
    place = Path(os.path.realpath(path))
    folder = place if place.is_dir() else place.parent
    if not folder.is_dir():
        above = shown(folder if path.is_symlink() else path.parent, None)
        raise ParameterError(f"{shown(path, None)}: there is no folder {above}; make it first")
    is_stream = place.exists() and not place.is_dir() and not place.is_file()
    if not is_stream and not os.access(folder, os.W_OK | os.X_OK):
        raise WriteError(
            f"{shown(path, None)}: may not be written; see to its permissions or its file system"
        )


def make_folders(folder: Path) -> None:
    """Make a folder and those above it, as far as they are not there; all are then on disk.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    WriteError
        If one of them can't be made.
    ParameterError
        If a file has the name of one.
    """
    for place in (*reversed(folder.parents), folder):
        make_folder(place)


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
