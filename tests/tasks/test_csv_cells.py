"""No name is a formula in a spreadsheet, and each is read back as it was."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.tasks.csv_cells import quoted, unquoted


@given(st.text(st.sampled_from("'=+-@ax"), max_size=5) | st.text())
def test_what_was_quoted_is_read_back(text):
    assert unquoted(quoted(text)) == text
    assert quoted(text)[:1] not in {"=", "+", "-", "@"}


@pytest.mark.parametrize("text", ["", "walk", "it's", "'quoted'", "a=b", "''"])
def test_other_texts_stay(text):
    assert quoted(text) == unquoted(text) == text
