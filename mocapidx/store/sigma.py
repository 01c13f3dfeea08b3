"""The spread of features that was measured on a store, kept beside its manifest.

It follows from the documents and can be measured again at any time, so it takes no part in
commits: whoever measures it puts it there, whole, if the folder may be written, and whoever
reads it takes a damaged one for none.
"""

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mocapidx.durable import durable_replace
from mocapidx.errors import MocapidxError, StoreError
from mocapidx.store import schema
from mocapidx.store.files import open_regular, read_exactly, reason
from mocapidx.store.manifest import file_digest

__all__ = ["MeasuredSigma", "drop_sigma", "read_sigma", "save_sigma", "sigma_fault"]

FORMAT: Final = "mocapidx-sigma"
VERSION: Final = 1
LIMIT: Final = 1 << 16  # bytes
GROWTH: Final = 2


@dataclass(frozen=True, slots=True)
class MeasuredSigma:
    """How far people differ in each feature, as measured on a store.

    Parameters
    ----------
    sigma : tuple of float
        One for each feature of the set, in its unit; NaN where nothing was found.
    feature_set_digest : str
        The feature set of the store.
    frames : int
        What the store held when it was measured.
    """

    sigma: tuple[float, ...]
    feature_set_digest: str
    frames: int

    def holds_for(self, feature_set_digest: str, frames: int) -> bool:
        """Tell whether a store has the same features and has neither doubled nor halved since."""
        same = self.feature_set_digest == feature_set_digest
        return same and self.frames < GROWTH * frames and frames < GROWTH * self.frames


def read_sigma(store: Path) -> MeasuredSigma | None:
    """Read what was measured on a store.

    Parameters
    ----------
    store : Path
        Folder of the store.

    Returns
    -------
    MeasuredSigma or None
        None if nothing was, or it is damaged.
    """
    try:
        return _read(store / schema.SIGMA)
    except (FileNotFoundError, StoreError):
        return None


def sigma_fault(store: Path) -> str | None:
    """Say what is wrong with what was measured on a store, if anything is.

    Parameters
    ----------
    store : Path
        Folder of the store.

    Returns
    -------
    str or None
    """
    try:
        _read(store / schema.SIGMA)
    except FileNotFoundError:
        return None
    except StoreError as exc:
        return str(exc)
    return None


def save_sigma(store: Path, measured: MeasuredSigma) -> bool:
    """Keep what was measured on a store, if its folder may be written; takes no lock.

    Parameters
    ----------
    store : Path
        Folder of the store.
    measured : MeasuredSigma

    Returns
    -------
    bool
        Whether it was kept.
    """
    place = store / schema.SIGMA
    if place.is_symlink():  # may lead out of the store
        return False
    body = json.dumps(
        {
            "format": FORMAT,
            "version": VERSION,
            "feature_set": measured.feature_set_digest,
            "frames": measured.frames,
            "sigma": [None if math.isnan(value) else value for value in measured.sigma],
        },
        separators=(",", ":"),
    ).encode("ascii")
    try:
        durable_replace(place, file_digest(body).hexdigest().encode() + b"\n" + body)
    except MocapidxError:
        return False
    return True


def drop_sigma(store: Path) -> None:
    """Remove what was measured on a store; it will be measured again when it is needed."""
    (store / schema.SIGMA).unlink(missing_ok=True)


def _read(place: Path) -> MeasuredSigma:
    try:
        descriptor = open_regular(place)
        try:
            size = os.fstat(descriptor).st_size
            if size > LIMIT:
                raise StoreError(f"{size} bytes, at most {LIMIT} are expected")
            data = read_exactly(descriptor, 0, size)
        finally:
            os.close(descriptor)
    except FileNotFoundError:
        raise
    except (OSError, EOFError) as exc:
        raise StoreError(f"can't be read ({reason(exc)})") from exc
    digest, _, body = data.partition(b"\n")
    if file_digest(body).hexdigest().encode() != digest:
        raise StoreError("it does not match its digest")
    try:
        return _decoded(json.loads(body))
    except (ValueError, RecursionError) as exc:
        raise StoreError("it is not what a mocapidx of this version writes") from exc


def _decoded(tree: Any) -> MeasuredSigma:
    if type(tree) is not dict or (tree.get("format"), tree.get("version")) != (FORMAT, VERSION):
        raise ValueError
    digest, frames, values = tree.get("feature_set"), tree.get("frames"), tree.get("sigma")
    if type(digest) is not str or type(frames) is not int or type(values) is not list:
        raise ValueError
    sigma = tuple(math.nan if value is None else value for value in values)
    if frames < 1 or any(type(value) is not float for value in sigma):
        raise ValueError
    if any(not math.isnan(value) and not 0 <= value < math.inf for value in sigma):
        raise ValueError
    return MeasuredSigma(sigma, digest, frames)
