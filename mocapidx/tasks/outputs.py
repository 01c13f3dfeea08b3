"""What a command writes, held against what it reads: neither may take the other's place."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from mocapidx.errors import FormatError, ParameterError
from mocapidx.formats.registry import is_motion_file, sources_of
from mocapidx.printable import shown
from mocapidx.transcripts.kinds import kind_of

__all__ = ["check_output"]

BEGINNING = 1 << 16  # bytes by which an annotation file is known


def check_output(
    name: str, path: Path, inputs: Iterable[tuple[str, str]], others: Iterable[tuple[str, Path]]
) -> None:
    """Refuse an output that is a file which the same command reads, or writes as another output.

    Parameters
    ----------
    name : str
        What the output is called.
    path : Path
        Where it goes; need not exist.
    inputs : iterable of (str, str)
        What each input is called, and its value: a file, a folder, a file with something behind
        it (``FILE@START:END``, ``FILE.py:FUNCTION``), or no file at all.
    others : iterable of (str, Path)
        The other outputs.

    Raises
    ------
    ParameterError
        If they are the same file, under whatever names and through whatever links.
    """
    if os.path.exists(path) and not os.path.isfile(path):
        return  # a folder, where single files are looked at, or a pipe
    for other, place in others:
        if os.path.realpath(place) == os.path.realpath(path):
            raise ParameterError(
                f"{shown(path, None)}: is the file of both {name} and {other}; give two"
            )
    if not os.path.exists(path):
        return
    for other, value in inputs:
        if any(_is_same(path, file) for file in _files_of(value, path)):
            raise ParameterError(
                f"{shown(path, None)}: is a file of {other}, which {name} would take the place "
                "of; give another name"
            )


def _files_of(value: str, path: Path) -> Iterator[Path]:
    """List what may be read where an input has this value."""
    for text in (value, value.rpartition("@")[0], value.rpartition(":")[0]):
        given = Path(text)
        if not text or not os.path.exists(given):
            continue
        if os.path.isdir(given):
            # Motion is no output anywhere; what else is read from folders are annotations.
            if _is_same(path.parent, given) and _is_annotation(path):
                yield path
        elif is_motion_file(given):
            yield from _sources(given)
        else:
            yield given


def _sources(path: Path) -> tuple[Path, ...]:
    try:
        return sources_of(path)
    except FormatError:  # an AMC without its skeleton, which the command tells in full
        return (path,)


def _is_annotation(path: Path) -> bool:
    with path.open("rb") as file:
        return kind_of(file.read(BEGINNING)) is not None


def _is_same(path: Path, other: Path) -> bool:
    try:
        return os.path.samefile(path, other)
    except OSError:
        return False
