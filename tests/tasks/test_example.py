from pathlib import Path

import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError
from mocapidx.store.read import open_store
from mocapidx.tasks.example import Example, find_example, parse_example, part_of
from tests.made_words import make_word_store

RATE = 30.0
BITS = np.zeros((60, 39), np.bool_)


@pytest.mark.parametrize(
    ("text", "start", "end"),
    [
        ("kick.amc", None, None),
        ("kick.amc@:", None, None),
        ("kick.amc@1:", 1.0, None),
        ("kick.amc@:2.5", None, 2.5),
        ("kick.amc@.5:2.", 0.5, 2.0),
    ],
)
def test_a_part_has_a_start_and_an_end_in_seconds(text, start, end):
    assert parse_example(text) == Example(Path("kick.amc"), start, end)


@pytest.mark.parametrize("name", ["ann@home.amc", "ann@home/kick.amc", "@", "kick.amc@b"])
def test_other_names_may_have_the_sign_too(name):
    assert parse_example(name) == Example(Path(name))


@pytest.mark.parametrize(
    "times",
    [
        *("nan:1", "-1:2", "1e3:", "0:inf", ".:1", "1.2.3:4", "1:2:3", "0.5", "1,5:2", "٣:٤"),
        *("9" * 400, ":" + "9" * 400, "9" * 400 + ":"),
    ],
)
def test_times_that_are_none_are_refused_in_one_short_line(times):
    with pytest.raises(ParameterError, match=r"in seconds, such as @1\.5:3, not") as caught:
        parse_example(f"kick.amc@{times}")
    assert len(str(caught.value)) < 150


@pytest.mark.parametrize("times", ["5:2", "1:1", ":0"])
def test_a_part_ends_after_it_starts(times):
    with pytest.raises(ParameterError, match="END must be later than START"):
        parse_example(f"kick.amc@{times}")


def test_a_file_of_the_very_name_comes_first(tmp_path):
    file = tmp_path / "kick@1:2"
    file.touch()
    with open_store(make_word_store(tmp_path / "a.store", {"kick@1:2": BITS, "b": BITS})) as store:
        assert find_example(str(file), store) == (Example(file), None)


def test_a_document_of_the_very_name_comes_before_a_part(tmp_path):
    with open_store(make_word_store(tmp_path / "a.store", {"kick@1:2": BITS, "b": BITS})) as store:
        example, placed = find_example("kick@1:2", store)
        assert example == Example(Path("kick@1:2"))
        assert placed is not None
        assert placed.document.name == "kick@1:2"
        assert find_example("b@1:2", store)[0] == Example(Path("b"), 1.0, 2.0)
        with pytest.raises(FormatError, match=r"^a: no such file, and no document of .*a\.store$"):
            find_example("a@1:2", store)


def test_a_part_is_cut_at_the_nearest_frames():
    assert part_of(Example(Path("a"), 0.51, 0.99), 60, RATE) == (15, 30)
    assert part_of(Example(Path("a"), 1.0, 99.0), 60, RATE) == (30, 60)
    assert part_of(Example(Path("a")), 60, RATE) == (0, 60)


def test_a_part_between_two_frames_is_told_from_one_beyond_the_end():
    with pytest.raises(ParameterError, match=r"no frame lies from 0.501 s to 0.502 s; .*0.0333 s"):
        part_of(Example(Path("a"), 0.501, 0.502), 60, RATE)
    with pytest.raises(ParameterError, match=r"a: lasts 2.00 s, the part starts at 2.00 s"):
        part_of(Example(Path("a"), 2.0), 60, RATE)
