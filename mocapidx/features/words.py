"""Feature words: the boolean features of a frame as the bits of one integer."""

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.model import BoolArray, WordArray

__all__ = ["pack_words", "part_words", "squeeze_mask", "unpack_words"]

MAX_BITS = 64


def pack_words(features: BoolArray) -> WordArray:
    """Pack each row of features into one word; bit i is feature i.

    Parameters
    ----------
    features : ndarray of bool, shape (T, F)
        At most 64 features.

    Returns
    -------
    ndarray of uint64, shape (T,)

    Raises
    ------
    ParameterError
        If `features` is not a boolean matrix, or has more than 64 columns.
    """
    if features.ndim != 2 or features.dtype != np.bool_ or features.shape[1] > MAX_BITS:
        got = f"{features.dtype} {features.shape}"
        raise ParameterError(f"features must be bool of shape (T, F), F at most 64, got {got}")
    octets = np.zeros((len(features), 8), dtype=np.uint8)
    octets[:, : (features.shape[1] + 7) // 8] = np.packbits(features, axis=1, bitorder="little")
    return octets.view("<u8")[:, 0].astype(np.uint64)


def unpack_words(words: WordArray, count: int) -> BoolArray:
    """Unpack words into rows of features: the inverse of `pack_words`.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        One word a frame.
    count : int
        Number of features, 0 to 64.

    Returns
    -------
    ndarray of bool, shape (T, count)

    Raises
    ------
    ParameterError
        If `words` is not a uint64 vector or `count` is out of range.
    """
    if words.ndim != 1 or words.dtype != np.uint64:
        raise ParameterError(f"words must be uint64 of shape (T,), got {words.dtype} {words.shape}")
    if not 0 <= count <= MAX_BITS:
        raise ParameterError(f"count must be from 0 to {MAX_BITS}, got {count}")
    octets = words.astype("<u8").view(np.uint8).reshape(-1, 8)
    return np.unpackbits(octets, axis=1, bitorder="little")[:, :count].view(np.bool_)


def part_words(words: WordArray, part_mask: int) -> NDArray[np.uint32]:
    """Squeeze the bits of one sub-index together, lowest first.

    Parameters
    ----------
    words : ndarray of uint64, shape (T,)
        Feature words.
    part_mask : int
        The bits to keep, at most 32 of them.

    Returns
    -------
    ndarray of uint32, shape (T,)

    Raises
    ------
    ParameterError
        If `part_mask` is negative or has more than 32 bits or a bit beyond 63.
    """
    squeezed = np.zeros(words.shape, dtype=np.uint64)
    for start, length, target in _bit_runs(part_mask):
        bits = (words >> np.uint64(start)) & np.uint64((1 << length) - 1)
        squeezed |= bits << np.uint64(target)
    return squeezed.astype(np.uint32)


def squeeze_mask(value: int, part_mask: int) -> int:
    """Squeeze the bits of one word or mask together: `part_words` for a Python integer.

    Parameters
    ----------
    value : int
        A feature word, or a mask of features.
    part_mask : int
        The bits to keep, at most 32 of them.

    Returns
    -------
    int

    Raises
    ------
    ParameterError
        If `part_mask` is negative or has more than 32 bits or a bit beyond 63.

    Examples
    --------
    >>> squeeze_mask(0b101100, 0b111000)
    5
    """
    squeezed = 0
    for start, length, target in _bit_runs(part_mask):
        squeezed |= (value >> start & (1 << length) - 1) << target
    return squeezed


def _bit_runs(mask: int) -> list[tuple[int, int, int]]:
    """Return the runs of ones in a mask: first bit, length, and first bit once squeezed."""
    if not 0 <= mask < 1 << MAX_BITS or mask.bit_count() > 32:
        raise ParameterError(f"a part has at most 32 of {MAX_BITS} bits, got the mask {mask:#x}")
    runs, start, target = [], 0, 0
    while mask >> start:
        rest = mask >> start
        start += (rest & -rest).bit_length() - 1
        ones = mask >> start
        length = (ones ^ ones + 1).bit_length() - 1
        runs.append((start, length, target))
        start, target = start + length, target + length
    return runs
