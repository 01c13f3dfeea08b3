"""Damaged segment files that left a store, and what they held.

All of it is there before the commit that drops them, so that wherever a repair is ended, it can
still be told what has to be indexed again.
"""

import contextlib
import json
import os
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

from mocapidx.durable import make_folder, replace_file, sync_folder
from mocapidx.errors import StoreError
from mocapidx.store import schema
from mocapidx.store.files import open_regular, read_exactly
from mocapidx.store.json_text import from_json
from mocapidx.store.link import NO_LINKS
from mocapidx.store.manifest import Document, SegmentFile
from mocapidx.store.read import read_manifest

__all__ = ["lost_sources", "put_aside"]


@contextlib.contextmanager
def put_aside(store: Path, files: Collection[SegmentFile]) -> Iterator[list[Path]]:
    """Keep damaged files under other names while a commit drops them, and list their documents.

    Parameters
    ----------
    store : Path
        Folder of the store.
    files : collection of SegmentFile
        Which.

    Yields
    ------
    list of Path
        What the files are called, once they are dropped; no command touches them again.

    Raises
    ------
    OSError
        If there is no room for it.
    """
    folder = store / schema.SEGMENTS
    kept = {name: folder / f"damaged-{name}" for file in files for name in file.names}
    made: list[Path] = []
    aside: list[Path] = []
    make_folder(folder)  # it may be what was lost
    try:
        for file in files:
            made.append(folder / f"damaged-{file.number:06d}.jsonl")
            if made[-1].is_symlink():  # by somebody else, and it would be followed
                made[-1].unlink()
            replace_file(made[-1], (_line(each) for each in file.documents if each.live))
        for name, place in kept.items():
            with contextlib.suppress(FileNotFoundError):
                _link(folder / name, place)
                made.append(place)
        sync_folder(folder)
        yield aside
    except BaseException:
        # A stop can come just after the commit, and then all this is what is left of the files.
        with contextlib.suppress(OSError, StoreError):
            if {file.number for file in files} & {f.number for f in read_manifest(store).files}:
                for place in made:
                    place.unlink(missing_ok=True)
        raise
    for name, place in kept.items():
        with contextlib.suppress(OSError):
            os.rename(folder / name, place)
            # Where both are names of one file that does nothing.
            (folder / name).unlink(missing_ok=True)
        if place.exists():
            aside.append(place)


def lost_sources(
    store: Path, documents: Iterable[Document], dropped: Iterable[Document] = ()
) -> tuple[Path, ...]:
    """Name the motion files whose documents were lost with damaged files, and are not there again.

    Parameters
    ----------
    store : Path
        Folder of the store.
    documents : iterable of Document
        That are in the store.
    dropped : iterable of Document
        That were lost just now, whatever became of their list.

    Returns
    -------
    tuple of Path
        In order; of lists that can't be read nothing.
    """
    present = {text for each in documents for text in (each.name, str(each.source))}
    lost = {str(each.source) for each in dropped if not present & {each.name, str(each.source)}}
    for place in (store / schema.SEGMENTS).glob("damaged-*.jsonl"):
        with contextlib.suppress(OSError, EOFError, ValueError, TypeError, RecursionError):
            for name, source in map(from_json, _read(place).splitlines()):
                os.fsencode(source)  # else it is the name of no file
                if not present & {name, source}:
                    lost.add(source)
    return tuple(map(Path, sorted(lost)))


def _line(document: Document) -> bytes:
    return json.dumps([document.name, str(document.source)]).encode("ascii") + b"\n"


def _link(source: Path, target: Path) -> None:
    """Give a file a second name, unless it has it or the file system knows no second names."""
    with contextlib.suppress(FileNotFoundError):
        if not os.path.samefile(source, target):
            target.unlink()
    try:
        os.link(source, target, follow_symlinks=False)
    except FileExistsError:
        pass
    except OSError as exc:
        if exc.errno not in NO_LINKS:
            raise


def _read(place: Path) -> bytes:
    descriptor = open_regular(place)
    try:
        return read_exactly(descriptor, 0, min(os.fstat(descriptor).st_size, schema.MANIFEST_LIMIT))
    finally:
        os.close(descriptor)
