"""The folder of a store: whether one may be there, clearing it of debris."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from mocapidx.durable import remove_abandoned, sync_folder
from mocapidx.errors import ParameterError, WriteError
from mocapidx.store import schema
from mocapidx.store.manifest import Manifest

__all__ = ["check_writable", "gone_if_empty", "sweep", "unmake_folder"]


def check_writable(path: Path) -> None:
    """Refuse a place where no store can be written, before any work is done for it.

    Parameters
    ----------
    path : Path
        Folder of a store, there or yet to be made.

    Raises
    ------
    ParameterError
        If it is no folder, its parent does not exist, or it holds other things than a store.
    WriteError
        If it may not be written.
    """
    if not os.path.lexists(path):
        folder = path.parent
        if not folder.is_dir():
            raise ParameterError(f"{path}: there is no folder {folder}; make it first")
    elif not path.is_dir():
        raise ParameterError(f"{path}: is a file, a store is a folder; give another place")
    else:
        folder = path
        if not os.path.lexists(path / schema.MANIFEST) and _strangers(path):
            raise ParameterError(
                f"{path}: is a folder with other things in it, not a store; give another place"
            )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise WriteError(f"{path}: may not be written; see to its permissions or its file system")


@contextlib.contextmanager
def gone_if_empty(path: Path) -> Iterator[None]:
    """Take a folder away after an error if nothing is in it, not even a LOCK.

    Parameters
    ----------
    path : Path
        A folder that was made just now.

    Yields
    ------
    None
    """
    try:
        yield
    except BaseException:
        with contextlib.suppress(OSError):
            path.rmdir()
        raise


def unmake_folder(path: Path) -> None:
    """Take away a folder that was made for a store which never came to be.

    Parameters
    ----------
    path : Path
        The folder; stays where anything else is in it.
    """
    with contextlib.suppress(OSError):
        if (path / schema.SEGMENTS).is_dir():
            (path / schema.SEGMENTS).rmdir()
        (path / schema.LOCK).unlink(missing_ok=True)
        path.rmdir()


def sweep(path: Path, manifest: Manifest) -> None:
    """Remove what a commit that was cut short left behind, and files that were replaced.

    Parameters
    ----------
    path : Path
        Folder of the store.
    manifest : Manifest
        Of the last commit.

    Raises
    ------
    OSError
        If a file can't be removed.
    """
    named = {name for file in manifest.files for name in file.names}
    folder = path / schema.SEGMENTS
    debris = [place for place in path.iterdir() if schema.TEMPORARY_NAME.fullmatch(place.name)]
    replaced: list[Path] = []
    for place in folder.iterdir() if folder.is_dir() else ():
        match = schema.SEGMENT_NAME.fullmatch(place.name)
        if schema.TEMPORARY_NAME.fullmatch(place.name):
            debris.append(place)
        elif match and place.name not in named:
            (debris if int(match[1]) >= manifest.next_number else replaced).append(place)
    for place in debris:
        if place.name.startswith(schema.SIGMA):  # written by readers, which take no lock
            remove_abandoned(place)
        else:
            place.unlink(missing_ok=True)
    if replaced:
        # The manifest that drops them may have been renamed in but not synced.
        sync_folder(path)
    for place in replaced:
        place.unlink(missing_ok=True)


def _strangers(path: Path) -> bool:
    ours = {schema.LOCK, schema.SEGMENTS, schema.SIGMA}
    return any(
        name not in ours and not schema.TEMPORARY_NAME.fullmatch(name) for name in os.listdir(path)
    )
