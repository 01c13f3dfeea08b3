"""Find the motion files below folders and name the documents that they become."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mocapidx.errors import FormatError, ParameterError
from mocapidx.formats.registry import SUFFIXES, holds_motion, is_motion_file
from mocapidx.printable import shown

__all__ = ["Source", "find_sources"]


@dataclass(frozen=True, slots=True)
class Source:
    """A motion file and the document that it becomes.

    Parameters
    ----------
    name : str
        The document's name: the path below its root, with ``/``.
    root : str
        Absolute path of the folder that the name is relative to.
    """

    name: str
    root: str

    @property
    def path(self) -> Path:
        """Where the file is."""
        return Path(self.root, self.name)

    @property
    def weight(self) -> int:
        """Bytes of the file; 0 if it is gone."""
        try:
            return os.stat(self.path).st_size
        except OSError:
            return 0


def find_sources(
    inputs: Sequence[Path], root: Path | None = None, closed: list[str] | None = None
) -> tuple[tuple[Source, ...], int]:
    """List the motion files among files and folders, folders searched all the way down.

    Symbolic links to files are read as the file they point to; links to folders are passed
    over, so that no loop can arise. What is hidden in a folder, by a name that begins with a
    dot, is left alone and not counted: the ``._walk.bvh`` of other systems is no motion.

    Parameters
    ----------
    inputs : sequence of Path
    root : Path, optional
        Names are relative to this folder instead of the input that a file was found in.
    closed : list of str, optional
        Gets a message for each folder that can't be listed, which is then passed over.

    Returns
    -------
    sources : tuple of Source
        Sorted by name.
    passed_over : int
        Files of unknown kinds in the folders.

    Raises
    ------
    ParameterError
        If an input does not exist or lies outside `root`, or two files have one name.
    FormatError
        If an input that is a file is of an unknown kind, or a folder can't be listed and `closed`
        isn't given.
    """
    found: dict[str, Source] = {}
    passed_over = 0
    for given in inputs:
        for path in _files(given, closed):
            if not (is_motion_file(path) if path == given else holds_motion(path)):
                if path == given:
                    raise FormatError(
                        f"{shown(str(path))}: no motion file by its name; mocapidx reads "
                        f"{', '.join(sorted(SUFFIXES))}"
                    )
                passed_over += path.suffix.lower() != ".asf"  # skeletons belong to AMC files
                continue
            source = _source(path, given, root)
            other = found.setdefault(source.name, source)
            if other.path != source.path:
                raise ParameterError(
                    f"{shown(str(source.path))} and {shown(str(other.path))} would both be "
                    f"the document '{shown(source.name)}'; give the folder above them or --root"
                )
    return tuple(sorted(found.values(), key=lambda source: source.name)), passed_over


def _source(path: Path, given: Path, root: Path | None) -> Source:
    base = root if root is not None else (given if given != path else given.parent)
    absolute = os.path.abspath(base)
    name = os.path.relpath(os.path.abspath(path), absolute)
    if name.split(os.sep)[0] == os.pardir:
        raise ParameterError(f"{shown(str(path))} does not lie below --root {shown(str(root))}")
    return Source(name.replace(os.sep, "/"), absolute)


def _files(given: Path, closed: list[str] | None) -> Iterator[Path]:
    """List the file itself, or all files below a folder, in a fixed order."""
    if not os.path.lexists(given):
        raise ParameterError(f"{shown(str(given))}: no such file or folder")
    if not given.is_dir():
        yield given
        return
    folders = [given]
    while folders:
        folder = folders.pop()
        try:
            with os.scandir(folder) as entries:
                below = sorted(entries, key=lambda entry: entry.name)
        except OSError as exc:
            reason = (exc.strerror or type(exc).__name__).lower()
            fault = f"{shown(str(folder))}: can't be listed ({reason})"
            if closed is None:
                raise FormatError(f"{fault}; see to its permissions or its disk") from exc
            closed.append(fault)
            continue
        for entry in below:
            if entry.name.startswith("."):
                continue
            if entry.is_dir(follow_symlinks=False):
                folders.append(Path(entry.path))
            elif not (entry.is_symlink() and os.path.isdir(entry.path)):
                yield Path(entry.path)
