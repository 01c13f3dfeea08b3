"""What a page shows, as plain data."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mocapidx.model import FloatArray, WordArray

__all__ = [
    "PageContent",
    "PageCurve",
    "PageDocument",
    "PageFeature",
    "PageHit",
    "PagePiece",
    "PageReference",
]


class PageFeature(NamedTuple):
    """A row of the stripes under a figure."""

    id: str
    name: str
    part: str


@dataclass(frozen=True, slots=True, eq=False)
class PagePiece:
    """A stretch of a document whose frames the page holds.

    Parameters
    ----------
    start : int
        Its first frame in the document.
    poses : ndarray of float32, shape (T, 24, 3)
        In metres, Y up; NaN for joints that the skeleton lacks.
    words : ndarray of uint64, shape (T,)
    step : int
        Every so many poses are kept; the page draws what lies between.
    """

    start: int
    poses: NDArray[np.float32]
    words: WordArray
    step: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class PageCurve:
    """The distance function of a class over a document.

    Parameters
    ----------
    label : str
        The class.
    tau : float
        Its threshold.
    costs : ndarray of float32, shape (T,)
        Infinite where no match can end.
    """

    label: str
    tau: float
    costs: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class PageDocument:
    """A document with at least one hit.

    Parameters
    ----------
    name : str
    frames : int
    untrusted : int
        Mask of the features that its skeleton can't tell.
    floor : float
        Height of the ground, in metres.
    size : float
        How large the body is; 1 is a grown person.
    pieces : tuple of PagePiece
        They do not overlap; every hit lies in one of them.
    curves : tuple of PageCurve
    """

    name: str
    frames: int
    untrusted: int
    floor: float
    size: float
    pieces: tuple[PagePiece, ...]
    curves: tuple[PageCurve, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class PageReference:
    """What hits are shown beside: a query, or the best hit of a class.

    Parameters
    ----------
    name : str
        For people.
    hit : int or None
        The hit that it is; None: `piece` has its frames.
    piece : PagePiece or None
    size, floor : float
        As for a document; of a piece.
    """

    name: str
    hit: int | None = None
    piece: PagePiece | None = None
    size: float = 1.0
    floor: float = 0.0


@dataclass(frozen=True, slots=True)
class PageHit:
    """A hit or an annotation.

    Parameters
    ----------
    document : int
        Its number among the documents.
    label : str
        The class.
    cost : float
        Smaller is better.
    start, end : int
        In frames of the document, half open.
    rank : int or None
        From 1; None: an annotation.
    reference : int or None
        Number of the reference that it is shown beside.
    steps : tuple of int
        For each frame the frame of the reference that goes with it; empty: the reference runs
        at its own pace.
    """

    document: int
    label: str
    cost: float
    start: int
    end: int
    rank: int | None = None
    reference: int | None = None
    steps: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class PageContent:
    """All that a page shows.

    Parameters
    ----------
    title : str
    rate : float
        Frames a second, in Hz.
    features : tuple of PageFeature
        Bit 0 of a word first.
    documents : tuple of PageDocument
    hits : tuple of PageHit
        In the order in which they are shown.
    references : tuple of PageReference
    remarks : tuple of str
        What a reader should know, a sentence each.
    """

    title: str
    rate: float
    features: tuple[PageFeature, ...]
    documents: tuple[PageDocument, ...]
    hits: tuple[PageHit, ...]
    references: tuple[PageReference, ...] = ()
    remarks: tuple[str, ...] = ()
