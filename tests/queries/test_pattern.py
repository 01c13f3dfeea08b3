"""Patterns of several blocks with bounds on durations: each equals its definition."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.queries.adaptive import adaptive_hits
from mocapidx.queries.evaluate import DocumentGroup, evaluate
from mocapidx.queries.pattern import (
    UNLIMITED,
    Block,
    Pattern,
    mirror_pattern,
    pattern_from_query,
    pattern_hits,
    restrict_pattern,
)
from mocapidx.queries.steps import FuzzyQuery, FuzzySet, steps_from_example
from tests import naive_queries as naive
from tests.made_queries import (
    documents_of_few_words,
    fuzzy_sets,
    query_of,
    rows,
    selections,
    source_of,
)


def block_of(query, bounds=None):
    bounds = bounds or [(0, UNLIMITED)] * len(query.steps)
    low, high = np.array(bounds, np.int64).T
    return Block(query, low, high, np.ones(len(bounds), np.bool_))


def adaptive(block, source):
    return adaptive_hits(block.query, source)


durations = st.tuples(st.integers(0, 3), st.integers(1, 6)).map(lambda pair: (pair[0], sum(pair)))
gaps = st.tuples(st.integers(0, 3), st.sampled_from([0, 2, 5, UNLIMITED]))


@st.composite
def documents_and_blocks(draw):
    """Documents, and blocks that are cut from them, so that there are hits."""
    documents = draw(documents_of_few_words)
    blocks = []
    for _ in range(draw(st.integers(1, 3))):
        words = draw(st.sampled_from(documents))
        start = draw(st.integers(0, len(words) - 1))
        part = np.array(words[start : start + draw(st.integers(1, 5))], np.uint64)
        blocks.append(steps_from_example(part, draw(selections)))
    return documents, blocks


@settings(max_examples=150, deadline=None)
@given(documents_and_blocks(), st.data())
def test_patterns_are_found_where_their_definition_says(case, data):
    documents, queries = case
    source = source_of(documents)
    bounds = [
        data.draw(st.lists(durations, min_size=len(query.steps), max_size=len(query.steps)))
        if data.draw(st.booleans())
        else [(0, UNLIMITED)] * len(query.steps)
        for query in queries
    ]
    between = data.draw(st.lists(gaps, min_size=len(queries) - 1, max_size=len(queries) - 1))
    between = [(low, max(low, high)) for low, high in between]
    pattern = Pattern(tuple(map(block_of, queries, bounds)), tuple(between))
    single = [
        naive.lasting(naive.adaptive_hits([s.cubes for s in query.steps], documents), bound)
        for query, bound in zip(queries, bounds, strict=True)
    ]
    expected = naive.pattern_hits(single, between)
    assert rows(pattern_hits(pattern, source, adaptive), source) == expected


@settings(max_examples=60, deadline=None)
@given(documents_of_few_words, st.lists(fuzzy_sets, min_size=1, max_size=4))
def test_a_pattern_of_one_block_is_a_query(documents, sets):
    source, query = source_of(documents), query_of(sets)
    group = [DocumentGroup(0, np.arange(len(documents)))]
    (plain,) = evaluate(query, "adaptive", source, group)
    (wrapped,) = evaluate(pattern_from_query(query), "adaptive", source, group)
    assert plain.bounds.tolist() == wrapped.bounds.tolist()


def test_a_block_that_can_not_be_completed_by_the_next_one_waits_for_a_later_one():
    # 1 ends at 1; 2 stands at 2 and at 5; 4 comes 1 frame after the second one only.
    source = source_of([[1, 0, 2, 0, 0, 2, 0, 4]])
    blocks = [block_of(query_of([[(7, value)]])) for value in (1, 2, 4)]
    pattern = Pattern(tuple(blocks), ((0, UNLIMITED), (0, 1)))
    found = rows(pattern_hits(pattern, source, adaptive), source)
    assert found == [(0, 0, 1, 5, 6, 7, 8)]
    stretches = pattern.stretches(pattern_hits(pattern, source, adaptive))
    assert stretches.tolist() == [[[0, 1], [5, 6], [7, 8]]]


def test_blocks_of_two_documents_never_meet():
    source = source_of([[1, 0], [2]])
    blocks = [block_of(query_of([[(7, value)]])) for value in (1, 2)]
    assert not len(pattern_hits(Pattern(tuple(blocks), ((0, UNLIMITED),)), source, adaptive))


def test_bounds_of_joined_steps_are_added_up_and_all_of_them_must_be_free_to_fail():
    query = FuzzyQuery(
        (FuzzySet(((3, 1),)), FuzzySet(((3, 3),)), FuzzySet(((3, 0),))), np.array([4, 5, 6])
    )
    block = Block(query, np.array([1, 2, 3]), np.array([5, 6, 7]), np.array([True, False, True]))
    joined = restrict_pattern(Pattern((block,)), 1).blocks[0]
    assert joined.query.lengths.tolist() == [9, 6]
    assert joined.shortest.tolist() == [3, 3]
    assert joined.longest.tolist() == [11, 7]
    assert joined.may_fail.tolist() == [False, True]


def test_a_block_of_which_nothing_is_left_can_not_be_asked():
    blocks = (block_of(query_of([[(1, 1)]])), block_of(query_of([[(2, 2)]])))
    pattern = Pattern(blocks, ((0, 5),))
    assert restrict_pattern(pattern, 1) is None
    group = [DocumentGroup(2, np.array([0]))]
    (answer,) = evaluate(pattern, "adaptive", source_of([[1, 0, 0]]), group)
    assert answer.pattern is None
    assert not len(answer.documents)


@settings(max_examples=50, deadline=None)
@given(st.lists(fuzzy_sets, min_size=1, max_size=3), st.permutations(range(64)))
def test_mirroring_twice_changes_nothing(sets, order):
    permutation = np.arange(64)
    for one, other in zip(order[::2], order[1::2], strict=True):
        permutation[[one, other]] = other, one
    pattern = pattern_from_query(query_of(sets))
    twice = mirror_pattern(mirror_pattern(pattern, permutation), permutation)
    assert [step.cubes for step in twice.steps] == [step.cubes for step in pattern.steps]


def test_patterns_need_blocks_and_mismatches_need_patterns_of_one():
    block = block_of(query_of([[(1, 1)]]))
    with pytest.raises(ParameterError, match="needs a block"):
        Pattern((), ())
    with pytest.raises(ParameterError, match="no open steps"):
        evaluate(Pattern((block, block), ((0, 1),)), "mismatch", source_of([[1]]), [])
