"""Hits as people see them: frames at the store's rate, seconds, frames of the source."""

from typing import Final

from mocapidx.errors import StoreError
from mocapidx.model import Hit
from mocapidx.printable import shown
from mocapidx.store.manifest import Document

__all__ = ["SOURCE_START", "make_hit"]

SOURCE_START: Final = "source_start"
"""Key of a document's rig: the source frame that is frame 0, where a first pose was dropped."""


def make_hit(document: Document, start: int, end: int, rate: float, cost: float, label: str) -> Hit:
    """Describe a stretch of a document in frames, seconds and frames of its source.

    Parameters
    ----------
    document : Document
    start, end : int
        At the store's rate, from 0, end exclusive.
    rate : float
        The store's, in Hz.
    cost : float
    label : str

    Returns
    -------
    Hit
        Source frames by time: those from the time of the first frame up to that of the end.
    """
    ratio = document.source_rate / rate
    first = document.rig.get(SOURCE_START, 0)
    if type(first) is not int or not 0 <= first <= document.source_frames:
        raise StoreError(f"{shown(document.name)}: its first frame is none; index it again")
    return Hit(
        document=document.name,
        start_frame=start,
        end_frame=end,
        start_time=start / rate,
        end_time=end / rate,
        source_start_frame=min(first + round(start * ratio), document.source_frames - 1),
        source_end_frame=min(first + max(round(end * ratio), 1), document.source_frames),
        cost=cost,
        label=label,
    )
