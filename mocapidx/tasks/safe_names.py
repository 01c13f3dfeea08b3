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
from mocapidx.formats.registry import holds_motion
from mocapidx.printable import shown
from mocapidx.store.schema import MANIFEST, SEGMENTS

__all__ = [
    "check_outside_stores",
    "check_place",
    "check_targets",
    "document_stem",
    "has_content",
    "make_folders",
    "slug",
    "those_there",
]

UNFIT: Final = re.compile(r"[^A-Za-z0-9]+")
LONGEST: Final = 40  # characters of a name that a file name keeps
DIGEST: Final = 4  # bytes
PIECE: Final = 1 << 20  # bytes
FIRST_LINE: Final = re.compile(rb"[0-9a-f]{64}\n")  # of a manifest: the digest of the rest


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


def check_place(path: Path, *, is_motion: bool = False) -> None:
    """Refuse a file or a folder that may not be written, before any work is done for it.

    Parameters
    ----------
    path : Path
        There or yet to be made.
    is_motion : bool
        Whether motion will be written there, which may take the place of other motion.

    Raises
    ------
    ParameterError
        If there is no folder to make it in, it lies in a store, or it is a motion file or a
        skeleton that something else would take the place of.
    WriteError
        If nothing may be made or changed where it is.
    """
    place = Path(os.path.realpath(path))
    folder = place if place.is_dir() else place.parent
    if not folder.is_dir():
        above = shown(folder if path.is_symlink() else path.parent, None)
        raise ParameterError(f"{shown(path, None)}: there is no folder {above}; make it first")
    if place.exists() and not place.is_dir() and not place.is_file():
        return  # a pipe or a device, which nothing is made beside
    if not os.access(folder, os.W_OK | os.X_OK):
        raise WriteError(
            f"{shown(path, None)}: may not be written; see to its permissions or its file system"
        )
    check_outside_stores(path)
    if not is_motion and place.is_file() and any(map(_is_motion, (Path(path), place))):
        raise ParameterError(
            f"{shown(path, None)}: is there already and holds motion, which would be lost; give "
            "another name"
        )


def _is_motion(path: Path) -> bool:
    return path.suffix.lower() == ".asf" or holds_motion(path)


def check_outside_stores(path: Path) -> None:
    """Refuse a file or a folder in a store, or the store itself: only stores may be written there.

    Parameters
    ----------
    path : Path
        There or yet to be made. Where links lead somewhere else, neither place may lie in one.

    Raises
    ------
    ParameterError
        If it does.
    """
    for place in (Path(os.path.abspath(path)), Path(os.path.realpath(path))):
        for folder in (place, *place.parents):
            if _is_store(folder):
                raise ParameterError(
                    f"{shown(path, None)}: lies in the store {shown(folder, None)}, which it "
                    "would damage; give another place"
                )


def _is_store(folder: Path) -> bool:
    """Tell a store, a damaged one too, from a folder where another program has a MANIFEST."""
    manifest = folder / MANIFEST
    if not os.path.lexists(manifest):
        return False
    if (folder / SEGMENTS).is_dir():
        return True
    try:
        if not manifest.is_file():
            return False
        with manifest.open("rb") as file:
            return FIRST_LINE.match(file.read(65)) is not None
    except OSError:
        return False


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
    for path in those_there(paths):
        if not force:
            raise ParameterError(f"{shown(path, None)}: is there already; --force replaces it")


def those_there(paths: Iterable[Path]) -> list[Path]:
    """Find the files that are there already among those to be written.

    Parameters
    ----------
    paths : iterable of Path

    Returns
    -------
    list of Path
        All regular files.

    Raises
    ------
    ParameterError
        If one of them is a link, a folder or anything else that no file may take the place of.
    """
    found = []
    for path in paths:
        where = shown(path, None)
        if path.is_symlink():
            raise ParameterError(f"{where}: is a symbolic link; remove it or choose another folder")
        if os.path.lexists(path):
            if not path.is_file():
                raise ParameterError(f"{where}: is in the way and no regular file")
            found.append(path)
    return found


def has_content(path: Path, data: bytes) -> bool:
    """Tell whether a regular file is there and holds these very bytes.

    Parameters
    ----------
    path : Path
    data : bytes

    Returns
    -------
    bool
        False also where the file can't be read.
    """
    try:
        if not path.is_file() or path.stat().st_size != len(data):
            return False
        with path.open("rb") as file:
            # Piece by piece: of the file no more is held than that.
            return all(
                file.read(PIECE) == data[start : start + PIECE]
                for start in range(0, len(data), PIECE)
            )
    except OSError:
        return False
