"""Another frame rate: positions at other times."""

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import FloatArray, IndexArray, Motion

__all__ = ["kept_frames", "resample_motion", "resampled_frames"]


def resampled_frames(frames: int, source_rate: float, rate: float) -> int:
    """Return how many frames a motion has at another rate.

    Parameters
    ----------
    frames : int
        At `source_rate`, at least 1.
    source_rate, rate : float
        In Hz.

    Returns
    -------
    int
        The number of times ``i / rate`` that are not after the last frame.
    """
    return int(np.floor((frames - 1) * rate / source_rate + 1e-9)) + 1


def kept_frames(frames: int, source_rate: float, rate: float) -> IndexArray | None:
    """Return which frames a motion keeps at another rate, unchanged.

    Parameters
    ----------
    frames : int
        At `source_rate`, at least 1.
    source_rate, rate : float
        In Hz.

    Returns
    -------
    ndarray of int64, or None
        The frames at the times ``i / rate``; None if any of these lies between two frames.
    """
    if rate > source_rate:  # which may be very many
        return None
    before, part = _times(frames, source_rate, rate)
    return None if part.any() else before


def _times(frames: int, source_rate: float, rate: float) -> tuple[IndexArray, FloatArray]:
    """Return the times ``i / rate`` as the frame before and the part of a frame after it."""
    times = np.arange(resampled_frames(frames, source_rate, rate)) * (source_rate / rate)
    before = np.minimum(np.floor(times + 1e-9).astype(np.int64), frames - 1)
    part = times - before
    part[np.abs(part) < 1e-9] = 0.0
    return before, part


def resample_motion(motion: Motion, rate: float) -> Motion:
    """Take a motion's positions at the times ``i / rate`` by linear interpolation.

    Parameters
    ----------
    motion : Motion
        At any rate, at least one frame.
    rate : float
        Frames a second wanted, in Hz.

    Returns
    -------
    Motion
        From frame 0 on. Where `rate` divides the source rate these are source frames, unchanged.

    Raises
    ------
    ParameterError
        If `rate` is not a positive number or the motion has no frames.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise ParameterError(f"rate must be a positive number of Hz, got {rate}")
    if not len(motion.positions):
        raise ParameterError("the motion has no frames")
    if rate == motion.rate:
        return motion
    before, part = _times(len(motion.positions), motion.rate, rate)
    positions = motion.positions[before]
    between = np.flatnonzero(part > 0)
    if len(between):
        after = np.minimum(before[between] + 1, len(motion.positions) - 1)
        step = motion.positions[after] - positions[between]
        positions[between] += part[between, None, None] * step
    return Motion(motion.joints, positions, rate, motion.rest, motion.made)
