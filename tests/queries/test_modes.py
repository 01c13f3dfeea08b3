"""One protocol for all modes: each equals its definition, and they agree where they should."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.queries.adaptive import adaptive_hits
from mocapidx.queries.evaluate import DocumentGroup, evaluate
from mocapidx.queries.exact import exact_hits
from mocapidx.queries.fuzzy import fuzzy_hits
from mocapidx.queries.mismatch import mismatch_hits
from mocapidx.queries.steps import join_intersecting, steps_from_example
from tests import naive_queries as naive
from tests.made_queries import (
    ALL,
    ALL_WORDS,
    BITS,
    MASKS,
    documents_and_examples,
    documents_of_few_words,
    fuzzy_sets,
    query_of,
    rows,
    selections,
    source_of,
)

pytestmark = pytest.mark.usefixtures("way")


def touched(mask):
    return sum(part for part in MASKS.values() if part & mask)


@settings(max_examples=60, deadline=None)
@given(documents_and_examples(), selections)
def test_exact_hits_are_those_of_the_definition(case, mask):
    documents, example = case
    source = source_of(documents)
    query = steps_from_example(np.array(example, np.uint64), mask)
    values = [word for word, _, _ in naive.segments(example, mask)]
    expected = naive.exact_hits(values, mask, documents)
    assert rows(exact_hits(query, source), source) == expected
    assert rows(adaptive_hits(query, source), source) == expected


@settings(max_examples=60, deadline=None)
@given(documents_and_examples(), selections, st.data())
def test_mismatch_hits_are_those_of_the_definition(case, mask, data):
    documents, example = case
    source = source_of(documents)
    query = steps_from_example(np.array(example, np.uint64), mask)
    count = len(query.steps)
    mismatches = data.draw(st.integers(0, count - 1))
    may_fail = data.draw(st.lists(st.booleans(), min_size=count, max_size=count))
    steps = [step.cubes for step in query.steps]
    expected = naive.mismatch_hits(steps, mask, documents, mismatches, may_fail)
    found = mismatch_hits(query, source, mismatches, np.array(may_fail))
    assert rows(found, source) == expected


@settings(max_examples=40, deadline=None)
@given(documents_of_few_words, st.lists(fuzzy_sets, min_size=2, max_size=4), st.data())
def test_mismatch_hits_of_alternatives_are_those_of_the_definition(documents, sets, data):
    query = join_intersecting(query_of(sets))
    mismatches = data.draw(st.integers(0, len(query.steps) - 1))
    steps = [step.cubes for step in query.steps]
    expected = naive.mismatch_hits(steps, query.mask, documents, mismatches, [True] * len(steps))
    source = source_of(documents)
    assert rows(mismatch_hits(query, source, mismatches), source) == expected


@settings(max_examples=50, deadline=None)
@given(documents_and_examples(), selections)
def test_a_query_without_mismatches_is_exact(case, mask):
    documents, example = case
    source = source_of(documents)
    query = steps_from_example(np.array(example, np.uint64), mask)
    assert mismatch_hits(query, source, 0).tolist() == exact_hits(query, source).tolist()


def test_at_least_one_step_must_agree():
    query = steps_from_example(np.array([1, 2], np.uint64), 0b111)
    with pytest.raises(ParameterError, match="2 mismatches of 2 steps"):
        mismatch_hits(query, source_of([[1, 2]]), 2)


@settings(max_examples=50, deadline=None)
@given(documents_and_examples(), st.sets(st.sampled_from(sorted(MASKS)), min_size=1))
def test_exact_equals_fuzzy_with_singletons_on_whole_sub_indexes(case, parts):
    documents, example = case
    source = source_of(documents)
    mask = sum(MASKS[part] for part in parts)
    query = steps_from_example(np.array(example, np.uint64), mask)
    assert exact_hits(query, source).tolist() == fuzzy_hits(query, source).tolist()


@settings(max_examples=50, deadline=None)
@given(documents_and_examples(), selections)
def test_an_adaptive_selection_equals_an_exact_query_on_an_index_of_these_features(case, mask):
    documents, example = case
    query = steps_from_example(np.array(example, np.uint64), mask)
    restricted = source_of(documents, {"only": mask})
    expected = exact_hits(query, restricted).tolist()
    assert adaptive_hits(query, source_of(documents)).tolist() == expected


@settings(max_examples=100, deadline=None)
@given(documents_of_few_words, st.lists(fuzzy_sets, min_size=1, max_size=4))
def test_hits_of_any_fuzzy_sets_are_those_of_the_definitions(documents, sets):
    source = source_of(documents)
    steps, _ = naive.joined(sets, [1] * len(sets), ALL_WORDS)
    mask = sum(1 << bit for bit in BITS if any(m >> bit & 1 for step in steps for m, _ in step))
    query = query_of(sets)
    expected = naive.fuzzy_hits(steps, touched(mask), documents)
    assert rows(fuzzy_hits(query, source), source) == expected
    assert rows(adaptive_hits(query, source), source) == naive.adaptive_hits(steps, documents)


@settings(max_examples=60, deadline=None)
@given(documents_of_few_words, st.data())
def test_hits_of_alternatives_that_occur_are_those_of_the_definitions(documents, data):
    words = sorted({word for document in documents for word in document})
    part = data.draw(st.sampled_from([*MASKS.values(), ALL]))
    drawn = st.lists(st.sampled_from(words), min_size=1, max_size=3)
    sets = [[(part, word & part) for word in data.draw(drawn)] for _ in range(3)]
    source = source_of(documents)
    steps, _ = naive.joined(sets, [1] * len(sets), ALL_WORDS)
    expected = naive.fuzzy_hits(steps, part, documents)
    assert rows(fuzzy_hits(query_of(sets), source), source) == expected
    expected = naive.adaptive_hits(steps, documents)
    assert rows(adaptive_hits(query_of(sets), source), source) == expected


@settings(max_examples=100, deadline=None)
@given(st.lists(fuzzy_sets, min_size=1, max_size=6))
def test_joining_leaves_disjoint_neighbours_and_the_same_frames(sets):
    query = query_of(sets)
    steps, lengths = naive.joined(sets, [1] * len(sets), ALL_WORDS)
    got = join_intersecting(query)
    assert [step.cubes for step in got.steps] == [tuple(sorted(set(step))) for step in steps]
    assert got.lengths.tolist() == lengths


@pytest.mark.parametrize("mode", ["exact", "fuzzy", "adaptive", "mismatch"])
def test_no_hit_crosses_documents(mode):
    halves = [[1, 1, 2], [4, 4, 1, 2]]
    query = steps_from_example(np.array([1, 2, 4], np.uint64), 0b111)
    for part in ({"all": 0b111}, {"low": 0b11, "high": 0b100}):
        source = source_of(halves, part)
        groups = [DocumentGroup(0, np.arange(2))]
        assert not len(evaluate(query, mode, source, groups)[0].bounds)
        whole = source_of([halves[0] + halves[1]], part)
        found = evaluate(query, mode, whole, [DocumentGroup(0, np.arange(1))])[0]
        assert found.bounds.tolist() == [[0, 2, 3, 5]]


@pytest.mark.parametrize("mode", ["fuzzy", "adaptive"])
def test_equal_words_on_both_sides_of_a_border_are_two_stretches(mode):
    source = source_of([[1, 1], [1, 1, 1]], {"all": 0b111})
    query = steps_from_example(np.array([1], np.uint64), 0b111)
    found = evaluate(query, mode, source, [DocumentGroup(0, np.arange(2))])[0]
    assert (found.documents.tolist(), found.bounds.tolist()) == ([0, 1], [[0, 2], [0, 3]])


def test_exact_refuses_alternatives():
    query = query_of([[(3, 1), (3, 2)], [(3, 0)]])
    with pytest.raises(ParameterError, match="one feature vector a step"):
        exact_hits(query, source_of([[1, 2]]))


def untouchable():
    raise AssertionError("read a sub-index that the query does not look at")


@pytest.mark.parametrize("mode", ["exact", "fuzzy", "adaptive", "mismatch"])
@pytest.mark.parametrize("mask", [0b111, 0b1])
def test_sub_indexes_that_are_not_selected_stay_closed(mode, mask):
    source = source_of([[1, 2, 64, 1]])
    closed = [
        replace(part, starts=untouchable, words=untouchable, open_lists=untouchable)
        for part in source.parts[1:]
    ]
    source = replace(source, parts=(source.parts[0], *closed))
    query = steps_from_example(np.array([1], np.uint64), mask)
    assert len(evaluate(query, mode, source, [DocumentGroup(0, np.arange(1))])[0].bounds) == 2


@pytest.mark.parametrize("mode", ["exact", "fuzzy", "adaptive", "mismatch"])
@pytest.mark.parametrize("masks", [{"all": 0b111}, {"low": 0b11, "high": 0b100}])
def test_the_free_place_between_documents_is_no_frame_with_all_features(mode, masks):
    documents = [[7], [7, 7], [7], [0, 2], [7, 0, 2]]
    query = steps_from_example(np.array([7, 0, 2], np.uint64), 0b111)
    answer = evaluate(query, mode, source_of(documents, masks), [DocumentGroup(0, np.arange(5))])
    assert answer[0].documents.tolist() == [4]
    assert answer[0].bounds.tolist() == [[0, 1, 2, 3]]
