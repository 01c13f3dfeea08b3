import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.index.build import FREE_WORD, build_runs, first_positions

documents = st.lists(st.lists(st.integers(0, 15), min_size=1, max_size=12), max_size=5)


@settings(max_examples=100, deadline=None)
@given(documents)
def test_runs_and_free_numbers_tell_the_word_of_every_frame(drawn):
    runs = build_runs([np.array(words, np.uint64) for words in drawn], 0b1010)
    squeezed = [[(w >> 1 & 1) | (w >> 3 & 1) << 1 for w in words] for words in drawn]
    laid_out = [value for words in squeezed for value in [*words, FREE_WORD]]
    ends = np.append(runs.starts[1:], len(laid_out))
    assert np.repeat(runs.words, ends - runs.starts).tolist() == laid_out
    assert (runs.words[1:] != runs.words[:-1]).all()
    assert runs.starts.dtype == runs.words.dtype == np.uint32


def test_documents_are_one_free_position_apart():
    assert first_positions([3, 1, 5]).tolist() == [0, 4, 6]
    assert first_positions([]).tolist() == []


def test_a_sub_index_of_32_features_is_refused():
    with pytest.raises(ParameterError, match="32 features, at most 31"):
        build_runs([np.array([1], np.uint64)], 0xFFFFFFFF)


def test_31_features_leave_room_for_the_free_word():
    runs = build_runs([np.array([0x7FFFFFFF], np.uint64)], 0x7FFFFFFF)
    assert runs.words.tolist() == [0x7FFFFFFF, FREE_WORD]
