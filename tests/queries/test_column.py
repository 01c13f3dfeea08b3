import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.queries import column
from mocapidx.queries.column import Column, column_of

SMALL_BLOCK = 8


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(column, "BLOCK", SMALL_BLOCK)


def watched(values):
    """Give a column, and the list of the ranges that it reads."""
    asked = []

    def read(start, stop):
        asked.append((start, stop))
        return values[start:stop].copy()

    return Column(len(values), read), asked


@settings(deadline=None)
@given(st.lists(st.lists(st.integers(-100, 99), max_size=8), max_size=5))
def test_rows_are_those_of_the_array_and_no_block_is_read_twice(turns):
    values = np.arange(1000, 1100, dtype=np.uint32)
    rows, asked = watched(values)
    for places in turns:
        wanted = np.array(places, np.int64)
        assert (rows.take(wanted) == values.take(wanted)).all()
    blocks = [n for start, stop in asked for n in range(start // 8, -(-stop // 8))]
    assert len(blocks) == len(set(blocks))
    touched = {place % 100 // 8 for places in turns for place in places}
    assert touched == set(blocks)
    assert (rows.whole() == values).all()


@settings(deadline=None)
@given(
    st.lists(st.integers(0, 50), max_size=120),
    st.lists(st.lists(st.integers(0, 60), max_size=20), max_size=4),
    st.booleans(),
)
def test_numbers_are_found_as_in_the_whole_array(values, turns, before):
    ascending = np.sort(np.array(values, np.uint32))
    rows, _ = watched(ascending)
    for wanted in turns:
        found = rows.search(np.array(wanted, np.int64), before)
        expected = np.searchsorted(ascending, wanted, "left" if before else "right")
        assert found.tolist() == expected.tolist()


def test_finding_one_number_reads_few_blocks():
    rows, asked = watched(np.arange(1024 * SMALL_BLOCK, dtype=np.uint32))
    assert rows.search(np.array([5000])).tolist() == [5000]
    assert len(asked) <= 11


def test_an_array_in_memory_is_never_copied():
    values = np.arange(100, dtype=np.uint32)
    assert np.shares_memory(column_of(values).whole(), values)
    assert column_of(values).unread(100) == 0
