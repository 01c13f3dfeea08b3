"""Every name in a store: files, datasets, format version and limits."""

import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.errors import StoreError

__all__ = [
    "BLOCK",
    "COLUMNS",
    "FORMAT",
    "FORMAT_VERSION",
    "FRAME_WORDS",
    "JOINT_COUNT",
    "LOCK",
    "MANIFEST",
    "MANIFEST_LIMIT",
    "META",
    "PARTS",
    "POSES",
    "READABLE_VERSIONS",
    "RUN_STARTS",
    "RUN_WORDS",
    "SEGMENTS",
    "SEGMENT_NAME",
    "SIGMA",
    "TEMPORARY_NAME",
    "Column",
    "column",
]

FORMAT: Final = "mocapidx-store"
FORMAT_VERSION: Final = 1
READABLE_VERSIONS: Final = frozenset({1})

MANIFEST: Final = "MANIFEST"
LOCK: Final = "LOCK"
SIGMA: Final = "SIGMA"
SEGMENTS: Final = "segments"
SEGMENT_NAME: Final = re.compile(r"([0-9]{6,12})\.(h5|idx)", re.ASCII)
TEMPORARY_NAME: Final = re.compile(
    r"(MANIFEST|SIGMA|[0-9]{6,12}\.(h5|idx)|damaged-[0-9]{6,12}\.jsonl)\.(mocapidx[23]?|[0-9]+)\.tmp",
    re.ASCII,
)

MANIFEST_LIMIT: Final = 64 << 20
BLOCK: Final = 1 << 20
JOINT_COUNT: Final = 24
PARTS: Final = ("upper", "lower", "mix")


@dataclass(frozen=True, slots=True)
class Column:
    """One dataset of a segment file.

    Parameters
    ----------
    path : str
        Its name in the HDF5 file.
    dtype : numpy.dtype
        Little endian.
    axes : tuple of str
        What each axis counts; only the first varies in length.
    trailing : tuple of int
        Length of the axes after the first.
    unit : str
        Unit of the values.
    doc : str
        What the values say.
    optional : bool
        Whether a store may go without it.
    """

    path: str
    dtype: np.dtype[np.generic]
    axes: tuple[str, ...]
    trailing: tuple[int, ...]
    unit: str
    doc: str
    optional: bool = False

    @property
    def row_bytes(self) -> int:
        """Bytes of one step along the first axis."""
        return self.dtype.itemsize * int(np.prod(self.trailing, dtype=np.int64))


META: Final = Column(
    path="meta",
    dtype=np.dtype("u1"),
    axes=("byte",),
    trailing=(),
    unit="UTF-8",
    doc="JSON: format, version, rate, feature set and documents of this file when written.",
)
FRAME_WORDS: Final = Column(
    path="frames/words",
    dtype=np.dtype("<u8"),
    axes=("frame",),
    trailing=(),
    unit="bits",
    doc="Feature word of each frame, documents end to end; bit i is feature i of the set.",
)
POSES: Final = Column(
    path="frames/poses",
    dtype=np.dtype("<f4"),
    axes=("frame", "joint", "xyz"),
    trailing=(JOINT_COUNT, 3),
    unit="m",
    doc="Positions of the 24 canonical joints, Y up; NaN where a rig lacks the joint.",
    optional=True,
)
RUN_STARTS: Final = {
    part: Column(
        path=f"runs/{part}/starts",
        dtype=np.dtype("<u4"),
        axes=("run + 1 a document",),
        trailing=(),
        unit="position",
        doc=f"First position of each run of equal {part} words; after each document its end.",
    )
    for part in PARTS
}
RUN_WORDS: Final = {
    part: Column(
        path=f"runs/{part}/words",
        dtype=np.dtype("<u4"),
        axes=("run + 1 a document",),
        trailing=(),
        unit="bits",
        doc=f"The {part} bits of each run's words, lowest first; all ones after each document.",
    )
    for part in PARTS
}
COLUMNS: Final = {
    entry.path: entry
    for entry in (META, FRAME_WORDS, POSES, *RUN_STARTS.values(), *RUN_WORDS.values())
}


def column(path: str) -> Column:
    """Look a dataset up by its name.

    Parameters
    ----------
    path : str
        Name in the HDF5 file.

    Returns
    -------
    Column
        What the format says of it.

    Raises
    ------
    StoreError
        If the format has no such dataset.
    """
    try:
        return COLUMNS[path]
    except KeyError:
        raise StoreError(f"{path!r} is no dataset of a mocapidx store") from None
