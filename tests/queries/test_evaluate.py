"""Documents that can't be trusted in some features, and documents that don't count."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.queries.evaluate import DocumentGroup, evaluate
from mocapidx.queries.source import source_from_words
from mocapidx.queries.steps import FuzzyQuery, FuzzySet, steps_from_example
from tests import naive_queries as naive

MASKS = {"upper": 0b0011, "lower": 0b1100}
EVERY = 0b1111


def index(documents):
    return source_from_words([np.array(words, np.uint64) for words in documents], MASKS)


def hits_of(answers):
    found = [
        (d, *bounds)
        for answer in answers
        for d, bounds in zip(answer.documents.tolist(), answer.bounds.tolist(), strict=True)
    ]
    return sorted(found)


words_of_one = st.lists(st.integers(0, 15), min_size=1, max_size=20)
documents = st.lists(
    st.tuples(words_of_one, st.sampled_from([0, 1, 5, 15])), min_size=1, max_size=5
)


@settings(max_examples=150, deadline=None)
@given(documents, st.lists(st.integers(0, 15), min_size=1, max_size=4), st.integers(1, 15))
def test_untrusted_features_are_left_open_in_their_documents(drawn, example, mask):
    stored = [[word & ~untrusted for word in words] for words, untrusted in drawn]
    groups = [
        DocumentGroup(untrusted, np.array([d for d, (_, u) in enumerate(drawn) if u == untrusted]))
        for untrusted in sorted({untrusted for _, untrusted in drawn})
    ]
    query = steps_from_example(np.array(example, np.uint64), mask)
    expected = []
    for d, (words, untrusted) in enumerate(drawn):
        trusted = mask & ~untrusted
        if trusted:
            values = [word for word, _, _ in naive.segments(example, trusted)]
            found = naive.exact_hits(values, trusted, [words])
            expected += [(d, *bounds) for _, *bounds in found]
    for mode in ("exact", "adaptive"):
        assert hits_of(evaluate(query, mode, index(stored), groups)) == expected


def test_steps_that_a_group_cannot_tell_apart_are_joined_with_their_lengths():
    query = steps_from_example(np.array([1, 3, 3, 2], np.uint64), 0b11)
    groups = [DocumentGroup(0b10, np.array([0])), DocumentGroup(0, np.array([1]))]
    unsure, sure = evaluate(query, "adaptive", index([[1, 1, 0], [1, 3, 2]]), groups)
    assert unsure.pattern.lengths.tolist() == [3, 1]
    assert unsure.bounds.tolist() == [[0, 2, 3]]
    assert sure.pattern.lengths.tolist() == [1, 2, 1]
    assert sure.bounds.tolist() == [[0, 1, 2, 3]]


@pytest.mark.parametrize("mode", ["exact", "fuzzy", "adaptive"])
def test_a_group_without_any_selected_feature_has_no_hits_and_says_so(mode):
    query = steps_from_example(np.array([1], np.uint64), 0b11)
    groups = [DocumentGroup(0b111, np.array([0])), DocumentGroup(0, np.array([1]))]
    unsure, sure = evaluate(query, mode, index([[8, 8], [1]]), groups)
    assert unsure.pattern is None
    assert len(unsure.documents) == len(unsure.bounds) == 0
    assert sure.documents.tolist() == [1]


@pytest.mark.parametrize("mode", ["exact", "fuzzy", "adaptive"])
def test_documents_outside_of_all_groups_do_not_count(mode):
    query = steps_from_example(np.array([1], np.uint64), 0b11)
    source = index([[1], [1, 1], [1]])
    (answer,) = evaluate(query, mode, source, [DocumentGroup(0, np.array([1]))])
    assert (answer.documents.tolist(), answer.bounds.tolist()) == ([1], [[0, 2]])


@pytest.mark.parametrize("mode", ["exact", "fuzzy", "adaptive"])
def test_a_file_without_documents_has_no_hits(mode):
    query = steps_from_example(np.array([1, 2], np.uint64), 0b11)
    (answer,) = evaluate(query, mode, index([]), [DocumentGroup(0, np.zeros(0, np.int64))])
    assert answer.bounds.shape == (0, 3)


def test_unknown_modes_and_queries_that_demand_nothing_are_refused():
    query = steps_from_example(np.array([1], np.uint64), 1)
    with pytest.raises(ParameterError, match="exact, fuzzy, adaptive, mismatch"):
        evaluate(query, "guess", index([[1]]), [])
    everything = FuzzyQuery((FuzzySet(((0, 0),)),), np.array([1]))
    with pytest.raises(ParameterError, match="no feature is selected"):
        evaluate(everything, "adaptive", index([[1]]), [])


def test_steps_need_frames_features_and_consistent_cubes():
    with pytest.raises(ParameterError, match="no feature"):
        steps_from_example(np.array([1], np.uint64), 0)
    with pytest.raises(ParameterError, match="no frames"):
        steps_from_example(np.zeros(0, np.uint64), 1)
    with pytest.raises(ParameterError, match="outside of mask"):
        FuzzySet(((1, 2),))
    with pytest.raises(ParameterError, match="without cubes"):
        FuzzySet(())
    with pytest.raises(ParameterError, match="lengths"):
        FuzzyQuery((FuzzySet(((1, 1),)),), np.array([1, 2]))
