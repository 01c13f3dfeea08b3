import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.formats.numbers import find_tokens, parse_number, parse_numbers


def parsed(words):
    return parse_numbers(*find_tokens(" ".join(words).encode("utf-8", "surrogateescape")))


def bits(number):
    return struct.pack("<d", number)


def plain_float(word):
    if set(word) - set("0123456789+-.eE"):
        return math.nan
    try:
        number = float(word)
    except ValueError:
        return math.nan
    return number if math.isfinite(number) else math.nan


WORDS = [
    "0", "-0", "-0.0", "+1.5", ".5", "5.", "-.5", "12345678.12345678", "99999999.9999999",
    "123456789012345678", "0.1", "0.3", "2.675", "-1.27222e-014", "7.62852e-016", "1e22", "1e23",
    "1E+05", "00000000.10000000", "000000000001.5", "9007199254740993", "1e-300", "4.9e-324",
    "1.7976931348623157e308", "123456.7e-3", "0e0", "-0e5", "1e00000000001", "1e0000000000000001",
]  # fmt: skip
NO_NUMBERS = [
    "nan", "inf", "-inf", "infinity", "1e999", "1_0", "１２", "٣", "0x10", "1e", "e5", "1e+", "-",
    "+", ".", "1.2.3", "1e5.0", "1-2", "--1", "1e5e5", "1,5", "1d5", "NaN", "1e.", "1:", "1/2",
]  # fmt: skip


@pytest.mark.parametrize("word", WORDS)
def test_a_word_becomes_the_float_that_python_makes_of_it(word):
    values, bad = parsed(["1.0", word, "2"])
    assert bits(values[1]) == bits(float(word)) == bits(parse_number(word.encode()))
    assert not len(bad)


@pytest.mark.parametrize("word", NO_NUMBERS)
def test_what_is_no_finite_decimal_number_is_told_apart(word):
    values, bad = parsed(["1.0", word, "2"])
    assert bad.tolist() == [1]
    assert np.isnan(values[1])
    assert math.isnan(parse_number(word.encode()))


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1))
def test_every_float_comes_back_from_its_shortest_text(numbers):
    values, bad = parsed([repr(n) for n in numbers])
    assert [bits(v) for v in values] == [bits(n) for n in numbers]
    assert not len(bad)


@given(st.lists(st.decimals(-1000, 1000, places=6), min_size=1))
def test_fixed_decimals_as_motion_files_have_them_are_exact(numbers):
    values, _ = parsed([str(n) for n in numbers])
    assert [bits(v) for v in values] == [bits(float(n)) for n in numbers]


@given(st.lists(st.text("0123456789.-+eE_nx\u0661:/", min_size=1), min_size=1))
def test_any_words_are_judged_as_one_by_one(words):
    values, bad = parsed(words)
    expected = [plain_float(w) for w in words]
    assert bad.tolist() == [i for i, e in enumerate(expected) if math.isnan(e)]
    good = [i for i, e in enumerate(expected) if not math.isnan(e)]
    assert [bits(values[i]) for i in good] == [bits(expected[i]) for i in good]


def test_words_are_found_between_all_kinds_of_white_space():
    tokens = find_tokens(b"\ta 12\r\n\n b\x00c\v")
    assert [tokens.word(i) for i in range(len(tokens.starts))] == [b"a", b"12", b"b", b"c"]


def test_no_words_are_no_numbers():
    values, bad = parsed([])
    assert len(values) == len(bad) == 0
