import pytest

from mocapidx.printable import count, meant, shown


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("walk 01.bvh", "walk 01.bvh"),
        ("Müller 歩く", "Müller 歩く"),
        ("\x1b[2J\x07", "\\x1b[2J\\x07"),
        ("a\nb\tc\rd\0", "a\\nb\\tc\\rd\\x00"),
        ("\x9b31m", "\\x9b31m"),
        ("\u202eabc\u2066", "\\u202eabc\\u2066"),
        ("\u200b\u2028\U000e0001", "\\u200b\\u2028\\U000e0001"),
        ("f\udcfcr", "f\\xfcr"),
        ("\ud800", "\\ud800"),
        ("\xa0", "\\xa0"),
    ],
)
def test_nothing_unprintable_is_left(text, expected):
    assert shown(text) == expected
    assert shown(text).isprintable()


def test_long_names_lose_their_middle():
    short = shown("a" * 50 + "b" * 50, longest=21)
    assert short == "a" * 9 + "..." + "b" * 9
    assert shown("a" * 500, longest=None) == "a" * 500


def test_one_is_not_several():
    assert [count(number, "file") for number in (0, 1, 2)] == ["0 files", "1 file", "2 files"]
    assert count(2, "class", "classes") == "2 classes"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("squad", "squat"),
        ("SQUAT", "squat"),
        ("takes/walk/a.amc", "walk/a.amc"),
        ("a.amc", "walk/a.amc"),
        ("wakl/b.amc", "walk/b.amc"),
    ],
)
def test_a_name_that_may_be_meant_is_told(name, expected):
    known = ["kick", "squat", "walk/a.amc", "walk/b.amc", "walk/long/a.amc.bvh"]
    assert meant(name, known) == f"; is '{expected}' meant?"


@pytest.mark.parametrize("name", ["", "x", "dance"])
def test_nothing_is_guessed_where_no_name_is_near(name):
    assert meant(name, ["kick", "squat", "walk/x.amc"]) == ""


def test_what_may_be_meant_is_shown_safely():
    assert meant("kick", ["kick\x1b[2J"]) == r"; is 'kick\x1b[2J' meant?"


def test_names_too_many_to_compare_are_not_compared():
    assert meant("squad", ["squat", *map(str, range(100_000))]) == ""
