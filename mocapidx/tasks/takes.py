"""Motions at one rate, out of motion files, folders or a store, one after the other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mocapidx.errors import ParameterError
from mocapidx.model import Motion
from mocapidx.printable import shown
from mocapidx.skeleton.resample import resample_motion
from mocapidx.store.read import open_store
from mocapidx.store.schema import MANIFEST
from mocapidx.tasks.read import ReadOptions, read_take
from mocapidx.tasks.sources import find_sources
from mocapidx.tasks.stored import stored_motion

__all__ = ["Take", "one_take", "takes_in"]

RATE: Final = 30.0


@dataclass(frozen=True, slots=True)
class Take:
    """A document's name and its motion."""

    name: str
    motion: Motion


def takes_in(
    inputs: Sequence[Path],
    rate: float | None,
    read: ReadOptions,
    names: frozenset[str] | None = None,
) -> Iterator[Take]:
    """Read motions, from source files or from the poses of stores.

    Parameters
    ----------
    inputs : sequence of Path
        Motion files, folders and stores.
    rate : float or None
        In Hz; None: 30 for files, and the rate that a store has.
    read : ReadOptions
        How files are understood.
    names : frozenset of str, optional
        Only these documents.

    Yields
    ------
    Take
        Files first, in the order of their names.

    Raises
    ------
    FormatError, ParameterError, StoreError
    """
    stores = [path for path in inputs if (path / MANIFEST).exists()]
    files = [path for path in inputs if path not in stores]
    seen: set[str] = set()
    for source in find_sources(files)[0]:
        if names is None or source.name in names:
            seen.add(source.name)
            motion = read_take(source.path, read).motion
            yield Take(source.name, resample_motion(motion, rate or RATE))
    for path in stores:
        with open_store(path) as store:
            for placed in store.documents():
                name = placed.document.name
                if names is not None and name not in names:
                    continue
                if name in seen:
                    raise ParameterError(
                        f"two of the inputs hold a document '{shown(name)}'; leave one of them out"
                    )
                seen.add(name)
                motion = stored_motion(store, placed)
                yield Take(name, resample_motion(motion, rate or motion.rate))


def one_take(
    path: Path, rate: float | None, read: ReadOptions, document: str | None = None
) -> Take:
    """Read one motion: a motion file, or a document of a store.

    Parameters
    ----------
    path : Path
    rate : float or None
        In Hz; None: 30 for a file, and the rate that a store has.
    read : ReadOptions
        How a file is understood.
    document : str, optional
        Of a store; None: its only one.

    Returns
    -------
    Take

    Raises
    ------
    FormatError, ParameterError, StoreError
    """
    if path.is_dir() and not (path / MANIFEST).exists():
        raise ParameterError(f"{shown(path)}: give a motion file or a store")
    takes = takes_in([path], rate, read, None if document is None else frozenset({document}))
    found = next(takes, None)
    if found is None:
        raise ParameterError(f"{shown(path)}: no document '{shown(document or '')}'")
    if document is None and next(takes, None) is not None:
        raise ParameterError(f"{shown(path)}: holds several documents; choose with --document")
    return found
