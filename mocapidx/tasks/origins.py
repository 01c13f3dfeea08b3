"""Where the documents of records come from: motion files, by way of a store or below a folder."""

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Final, get_args

from mocapidx.errors import FormatError, ParameterError
from mocapidx.formats.registry import is_motion_file, sources_of
from mocapidx.printable import shown
from mocapidx.skeleton.kinematics import RootPositions
from mocapidx.skeleton.rotations import Up
from mocapidx.store.manifest import Document
from mocapidx.store.read import open_store
from mocapidx.tasks.document_names import DocumentNames
from mocapidx.tasks.prepare import source_digest
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.stored import source_skeleton

__all__ = ["Origin", "find_origins"]

LARGEST_UNIT: Final = 1e6  # metres
LONGEST_PATH: Final = 500
"""Characters of a path that a store tells; more than any honest one."""


@dataclass(frozen=True, slots=True)
class Origin:
    """The motion file of a document, and how it is read.

    Parameters
    ----------
    document : str
        Its name.
    path : Path
        The motion file.
    options : ReadOptions
        Where a store knows the document, just as it was read for the store.
    """

    document: str
    path: Path
    options: ReadOptions


def find_origins(
    names: Iterable[str],
    stores: Sequence[Path] = (),
    roots: Sequence[Path] = (),
    options: ReadOptions | None = None,
) -> dict[str, Origin | FormatError]:
    """Find the motion files of documents.

    Parameters
    ----------
    names : iterable of str
        As records have them.
    stores : sequence of Path
        Stores that may know them.
    roots : sequence of Path
        Folders that they may lie below; these come before where a store saw them. Without
        stores and folders: the current one.
    options : ReadOptions, optional
        What the user says about files; comes before what a store knows.

    Returns
    -------
    dict of str to Origin or FormatError
        For each name its file, or what is wrong: it is not there, has changed since it was
        indexed, or the name leads out of the folders.

    Raises
    ------
    StoreError
        If a store can't be read.
    ParameterError
        If several stores hold a document of one name.
    """
    options = options or ReadOptions()
    known = _known_documents(stores)
    table = DocumentNames(known)
    if not stores and not roots:
        roots = (Path(),)
    origins: dict[str, Origin | FormatError] = {}
    for name in dict.fromkeys(names):
        try:
            found = table.find(name, "the records")
            if found is not None:
                origins[name] = _of_store(known[found], roots, options)
            else:
                origins[name] = _below(name, roots, bool(stores), options)
        except FormatError as exc:
            origins[name] = exc
    return origins


def _known_documents(stores: Sequence[Path]) -> Mapping[str, Document]:
    known: dict[str, Document] = {}
    with ExitStack() as stack:
        for path in stores:
            for placed in stack.enter_context(open_store(path)).documents():
                document = placed.document
                if known.setdefault(document.name, document) is not document:
                    raise ParameterError(
                        f"two stores hold a document '{shown(document.name)}'; give the one that "
                        "the records were made from"
                    )
    return known


def _of_store(document: Document, roots: Sequence[Path], options: ReadOptions) -> Origin:
    moved = [root / document.name for root in roots if _is_below(document.name)]
    path = next((path for path in moved if os.path.isfile(path)), document.source)
    if not os.path.isfile(path):
        raise FormatError(
            f"{shown(document.name)}: its file {shown(path, LONGEST_PATH)} is not there; "
            "name the folder that it lies below with --root"
        )
    origin = Origin(document.name, path, _as_indexed(document, options))
    if source_digest(sources_of(path, origin.options.skeleton)) != document.digest:
        raise FormatError(
            f"{shown(path, LONGEST_PATH)}: has changed since it was indexed; index it again and "
            "repeat the search"
        )
    return origin


def _as_indexed(document: Document, options: ReadOptions) -> ReadOptions:
    """Say outright what was found out when the document was indexed."""
    rig = document.rig
    skeleton, known = options.skeleton, source_skeleton(document)
    if skeleton is None and known is not None and os.path.isfile(known[0]):
        skeleton = Path(known[0])
    said: dict[str, object] = {"skeleton": skeleton}
    if options.source_rate is None:
        said["source_rate"] = document.source_rate
    unit = rig.get("unit")
    if options.unit is None and isinstance(unit, float | int) and 0 < unit < LARGEST_UNIT:
        said["unit"] = float(unit)
    if options.up is None and rig.get("up") in get_args(Up):
        said["up"] = rig["up"]
    if options.root_positions is None and rig.get("root_positions") in get_args(RootPositions):
        said["root_positions"] = rig["root_positions"]
    if options.keep_first_frame is None and "first_frame" in rig:
        said["keep_first_frame"] = rig["first_frame"] == "motion"
    return replace(options, **said)  # type: ignore[arg-type]


def _below(name: str, roots: Sequence[Path], asked: bool, options: ReadOptions) -> Origin:
    """Find a document below a folder; a name that leads out of it is nothing to follow."""
    if not _is_below(name):
        raise FormatError(f"'{shown(name)}' is not the name of a document below a folder")
    path = next((root / name for root in roots if os.path.isfile(root / name)), None)
    if path is None:
        places = "the store" if asked else "the current folder"
        if roots and roots != (Path(),):
            places = f"{shown(roots[0], None)}" if not asked else f"the store or {shown(roots[0])}"
        raise FormatError(
            f"no document '{shown(name)}' in {places}; name its store with --store, or the "
            "folder that it lies below with --root"
        )
    if not is_motion_file(path):
        raise FormatError(f"{shown(path, LONGEST_PATH)}: not a kind of motion file that is read")
    return Origin(name, path, options)


def _is_below(name: str) -> bool:
    path = PurePosixPath(name)
    return bool(name) and "\0" not in name and not path.is_absolute() and ".." not in path.parts
