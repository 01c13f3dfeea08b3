"""Decimal numbers out of text, many at once: every value as Python's `float` would give it.

Numbers of up to eight digits on either side of the point, fifteen in all, are converted eight
digits at a time by integer arithmetic on machine words. The mantissa stays below 2**53 and the
power of ten is one that a double holds exactly, so one correctly rounded division gives the
correctly rounded value [1]_. Whatever is longer goes through `float` itself.

References
----------
.. [1] W. D. Clinger, How to Read Floating Point Numbers Accurately, PLDI 1990, section 5.
"""

import math
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mocapidx.model import BoolArray, FloatArray, IndexArray, WordArray

__all__ = ["Tokens", "find_tokens", "parse_number", "parse_numbers", "words_of"]

ByteArray: TypeAlias = NDArray[np.uint8]

BLANKS: Final = b" " * 8  # eight bytes up to the first digit must not begin before the text
ALLOWED: Final = b"0123456789+-.eE"
EXACT_POWER: Final = 22  # 10**22 is the largest power of ten that a double holds exactly
FLOAT_POWERS: Final = np.array([float(10**n) for n in range(EXACT_POWER + 1)])
WORD_POWERS: Final = np.array([10**n for n in range(9)], dtype=np.uint64)
KEPT_BYTES: Final = np.array(
    [((1 << 8 * n) - 1) << 8 * (8 - n) for n in range(9)], dtype=np.uint64
)  # the last n bytes of eight in reading order are the highest of a little-endian word


class Tokens(NamedTuple):
    """Where the words of a text stand.

    Parameters
    ----------
    text : ndarray of uint8, shape (N,)
        The text, with a few blanks before and after.
    starts, ends : ndarray of int64, shape (M,)
        Word ``i`` is ``text[starts[i]:ends[i]]``.
    """

    text: ByteArray
    starts: IndexArray
    ends: IndexArray

    def word(self, i: int) -> bytes:
        """Return word `i`."""
        return self.text[self.starts[i] : self.ends[i]].tobytes()


def find_tokens(text: bytes) -> Tokens:
    """Find the words of `text`: whatever stands between white space and control characters.

    Parameters
    ----------
    text : bytes
        Any text.

    Returns
    -------
    Tokens
        The words in their order; offsets count from eight blanks before the text.
    """
    padded = np.frombuffer(BLANKS + text + BLANKS, dtype=np.uint8)
    blank = padded <= 32
    edges = np.flatnonzero(blank[1:] != blank[:-1]) + 1
    return Tokens(padded, edges[::2], edges[1::2])


def parse_numbers(
    text: ByteArray, starts: IndexArray, ends: IndexArray
) -> tuple[FloatArray, IndexArray]:
    """Convert words to numbers, correctly rounded.

    Parameters
    ----------
    text : ndarray of uint8, shape (N,)
        As `find_tokens` returns it.
    starts, ends : ndarray of int64, shape (M,)
        Word ``i`` is ``text[starts[i]:ends[i]]``, not empty, in ascending order.

    Returns
    -------
    values : ndarray of float64, shape (M,)
        The numbers; NaN for words that are none.
    bad : ndarray of int64, shape (B,)
        Indices of the words that are no finite decimal numbers.
    """
    if not len(starts):
        return np.empty(0), np.empty(0, dtype=np.int64)
    points = np.flatnonzero(text == ord("."))
    mantissas, decimals, signs, good = _decimals(text, points, starts, ends)
    values = mantissas.view(np.int64) / FLOAT_POWERS[decimals]
    values *= signs
    if good.all():
        return values, np.empty(0, dtype=np.int64)
    odd = np.flatnonzero(~good)
    values[odd], good = _scaled(text, points, starts[odd], ends[odd])
    odd = odd[~good]
    for i in odd:
        values[i] = parse_number(text[starts[i] : ends[i]].tobytes())
    return values, odd[np.isnan(values[odd])]


def words_of(text: ByteArray) -> WordArray:
    """Return the eight bytes from every place of a text on as one little-endian word.

    Parameters
    ----------
    text : ndarray of uint8, shape (N,)
        As `find_tokens` returns it.

    Returns
    -------
    ndarray of uint64, shape (N - 7,)
        A view of the text.
    """
    return np.ndarray((len(text) - 7,), dtype="<u8", buffer=text, strides=(1,))


def parse_number(word: bytes) -> float:
    """Convert one word; NaN where it is no finite decimal number.

    Parameters
    ----------
    word : bytes
        One word, without white space.

    Returns
    -------
    float
        The number.
    """
    if word.translate(None, ALLOWED):
        return math.nan  # `float` would take 1_0, digits of other scripts and infinity
    try:
        number = float(word)
    except ValueError:
        return math.nan
    return number if math.isfinite(number) else math.nan


def _decimals(
    text: ByteArray, points: IndexArray, starts: IndexArray, ends: IndexArray
) -> tuple[WordArray, IndexArray, IndexArray, BoolArray]:
    """Split words into mantissa, number of decimals and sign; False where that is too long."""
    first = text[starts]
    negative = first == ord("-")
    begins = starts + (negative | (first == ord("+")))
    points = _first_of(points, starts, ends)
    whole = points - begins
    decimals = np.maximum(ends - points - 1, 0)
    count = whole + decimals
    good = (whole <= 8) & (decimals <= 8) & (count <= 15) & (count > 0)
    decimals = np.minimum(decimals, 8)
    words = words_of(text)
    mantissas, wrong = _digits(words, points, np.clip(whole, 0, 8))
    fractions, wrong_too = _digits(words, ends, decimals)
    mantissas *= WORD_POWERS[decimals]
    mantissas += fractions
    good &= (wrong | wrong_too) == 0
    return mantissas, decimals, 1 - 2 * negative.astype(np.int64), good


def _first_of(places: IndexArray, starts: IndexArray, ends: IndexArray) -> IndexArray:
    """Return the first of `places` in each word, or else the word's end; all ascend."""
    if len(places) == len(starts) and ((places >= starts) & (places < ends)).all():
        return places
    following = np.searchsorted(places, starts)
    first: IndexArray = np.minimum(np.append(places, ends[-1])[following], ends)
    return first


def _digits(words: WordArray, ends: IndexArray, counts: IndexArray) -> tuple[WordArray, WordArray]:
    """Read the `counts` (0 to 8) digits before each end; not 0 in the second where one is none."""
    word = words[ends - 8]
    word ^= np.uint64(0x3030303030303030)
    word &= KEPT_BYTES[counts]
    wrong = (word + np.uint64(0x7676767676767676)) | word
    wrong &= np.uint64(0x8080808080808080)
    # neighbours are joined: eight digits to four pairs, then pairs to fours, fours to eight
    word = word * np.uint64(10) + (word >> np.uint64(8))
    pairs = np.uint64(0x000000FF000000FF)
    high = (word & pairs) * np.uint64(100 + (1000000 << 32))
    word >>= np.uint64(16)
    word &= pairs
    word *= np.uint64(1 + (10000 << 32))
    word += high
    word >>= np.uint64(32)
    return word, wrong


def _scaled(
    text: ByteArray, points: IndexArray, starts: IndexArray, ends: IndexArray
) -> tuple[FloatArray, BoolArray]:
    """Read words with an exponent; False where there is none or the value would not be exact."""
    marks = _first_of(np.flatnonzero((text | 32) == ord("e")), starts, ends)
    good = (marks > starts) & (marks < ends - 1)
    marks = np.where(good, marks, starts + 1)
    mantissas, decimals, signs, readable = _decimals(text, points, starts, marks)
    after = np.where(good, marks + 1, starts)
    none = np.empty(0, dtype=np.int64)  # a point in an exponent is no digit
    exponents, _, exponent_signs, whole = _decimals(text, none, after, ends)
    good &= readable & whole
    powers = np.where(good, exponents.view(np.int64) * exponent_signs - decimals, 0)
    good &= np.abs(powers) <= EXACT_POWER
    powers[~good] = 0
    values: FloatArray = mantissas.view(np.int64) * FLOAT_POWERS[np.maximum(powers, 0)]
    values /= FLOAT_POWERS[np.maximum(-powers, 0)]
    values *= signs
    return values, good
