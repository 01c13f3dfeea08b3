"""Stretches of a motion in which some of its features can't be told."""

from typing import TypeAlias

__all__ = ["Unspecified", "unspecified_within"]

Unspecified: TypeAlias = tuple[tuple[int, int, int], ...]
"""Stretches in which some features can't be told: start, end (in frames) and their mask, in the
order of time, none overlapping another."""


def unspecified_within(unspecified: Unspecified, start: int, end: int) -> int:
    """Return the features that can't be told somewhere in a stretch.

    Parameters
    ----------
    unspecified : tuple of (int, int, int)
        Of the whole motion.
    start, end : int
        Half-open, in frames.

    Returns
    -------
    int
        Their mask.
    """
    mask = 0
    for first, last, features in unspecified:
        if first < end and last > start:
            mask |= features
    return mask
