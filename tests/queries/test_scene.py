"""Scenes: the sorted merge finds what trying all combinations finds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.queries import scene as scenes
from mocapidx.queries.adaptive import adaptive_hits
from mocapidx.queries.pattern import UNLIMITED, Pattern, pattern_from_query, pattern_hits
from mocapidx.queries.scene import RELATIONS, Condition, Place, Scene, join_scene, scene_spans
from mocapidx.queries.steps import steps_from_example
from tests import naive_queries as naive
from tests.made_queries import query_of, source_of

MASK = 0b11
words = st.lists(st.integers(0, 15), min_size=1, max_size=30)
documents_of_words = st.lists(words, min_size=1, max_size=3)


def adaptive(block, source):
    return adaptive_hits(block.query, source)


@st.composite
def progressions(draw):
    """Sequences over one or two features, now and then with an open step in the middle."""
    mask = draw(st.sampled_from([1, 2, 4, 8, 3, 12]))
    example = st.lists(st.integers(0, 15), min_size=1, max_size=4)
    blocks = [
        pattern_from_query(steps_from_example(np.array(draw(example), np.uint64), mask)).blocks[0]
        for _ in range(draw(st.sampled_from([1, 1, 2])))
    ]
    gap = (draw(st.integers(0, 2)), draw(st.sampled_from([3, UNLIMITED])))
    return Pattern(tuple(blocks), (gap,) * (len(blocks) - 1))


@st.composite
def conditions(draw, patterns):
    """Conditions that link all progressions, and a few more."""
    count = len(patterns)
    pairs = [(draw(st.integers(0, i - 1)), i) for i in range(1, count)]
    number = st.integers(0, count - 1)
    pairs += draw(st.lists(st.tuples(number, number), max_size=2))
    made = []
    for one, other in pairs:
        if draw(st.booleans()):
            one, other = other, one
        places = [
            Place(p, draw(st.sampled_from([None, *range(len(patterns[p].steps))])))
            for p in (one, other)
        ]
        relation = draw(st.sampled_from(RELATIONS))
        within = draw(st.integers(0, 8)) if relation in ("before", "near") else None
        if relation == "before" and draw(st.booleans()):
            within = None
        made.append(Condition(places[0], relation, places[1], within))
    return tuple(made)


@settings(max_examples=300, deadline=None)
@given(documents_of_words, st.lists(progressions(), min_size=1, max_size=3), st.data())
def test_scenes_are_found_where_trying_all_combinations_finds_them(documents, patterns, data):
    source = source_of(documents, {"low": 0b0011, "high": 0b1100})
    links = data.draw(conditions(patterns))
    scene = Scene(tuple("abc"[: len(patterns)]), tuple(patterns), links)
    tables = [pattern_hits(pattern, source, adaptive) for pattern in patterns]
    lists = []
    for pattern, table in zip(patterns, tables, strict=True):
        stretches = pattern.stretches(table)
        owners = source.document_at(table[:, 0]).tolist()
        lists.append(
            [
                [*((d, *pair) for pair in row), (d, row[0][0], row[-1][1])]
                for d, row in zip(owners, stretches.tolist(), strict=True)
            ]
        )
    plain = []
    for c in links:
        steps = [-1 if place.step is None else place.step for place in (c.one, c.other)]
        ends = (c.one.progression, steps[0], c.relation, c.other.progression, steps[1])
        plain.append((*ends, c.within))
    joined = join_scene(scene, tables, source)
    assert [tuple(row) for row in joined.tolist()] == naive.scene_hits(lists, plain)
    spans = scene_spans(scene, tables, joined)
    assert (spans[:, 0] < spans[:, 1]).all()
    assert (source.document_at(spans[:, 0]) == source.document_at(spans[:, 1])).all()


def simple(relation, within=None):
    patterns = tuple(pattern_from_query(query_of([[(bit, bit)]])) for bit in (1, 2))
    return Scene(("a", "b"), patterns, (Condition(Place(0), relation, Place(1), within),))


def found(scene, words):
    source = source_of([words], {"all": 0b11})
    tables = [pattern_hits(pattern, source, adaptive) for pattern in scene.progressions]
    return scene_spans(scene, tables, join_scene(scene, tables, source)).tolist()


def test_before_means_the_next_one_unless_a_time_is_given():
    words = [1, 0, 2, 0, 2]
    assert found(simple("before"), words) == [[0, 3]]
    assert found(simple("before", 3), words) == [[0, 3], [0, 5]]
    assert found(simple("before", 0), words) == []


def test_one_that_ends_where_the_other_starts_is_before_it_and_does_not_overlap():
    assert found(simple("before", 0), [1, 2]) == [[0, 2]]
    assert found(simple("overlaps"), [1, 2]) == []
    assert found(simple("overlaps"), [1, 3, 2]) == [[0, 3]]


def test_during_is_from_start_to_end_within():
    assert found(simple("during"), [2, 3, 2]) == [[0, 3]]
    assert found(simple("during"), [3, 1]) == []


def test_a_progression_that_nothing_links_and_steps_that_are_not_there_are_refused():
    scene = simple("overlaps")
    with pytest.raises(ParameterError, match="no condition links 'b'"):
        replace(scene, conditions=())
    with pytest.raises(ParameterError, match="'b' has 1 steps, no step 2"):
        replace(scene, conditions=(Condition(Place(0), "overlaps", Place(1, 1)),))


def test_too_many_combinations_are_refused_not_held_in_memory(monkeypatch):
    monkeypatch.setattr(scenes, "MOST_COMBINATIONS", 10)
    with pytest.raises(ParameterError, match="narrow them"):
        found(simple("before", 1000), [1, 0] * 5 + [2, 0] * 5)
