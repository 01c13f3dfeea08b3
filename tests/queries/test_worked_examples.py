"""The ten segments of a walk, as the papers go through them; the papers count from 1."""

import numpy as np
import pytest

from mocapidx.queries.adaptive import adaptive_hits
from mocapidx.queries.exact import exact_hits
from mocapidx.queries.fuzzy import fuzzy_hits
from mocapidx.queries.source import source_from_words
from mocapidx.queries.steps import FuzzyQuery, FuzzySet, steps_from_example

pytestmark = pytest.mark.usefixtures("way")

WALK = [0b11, 0b01, 0b11, 0b10, 0b11, 0b01, 0b11, 0b10, 0b11, 0b01]
FRAMES = [3, 1, 2, 4, 1, 1, 5, 2, 2, 3]
BOUNDS = np.concatenate(([0], np.cumsum(FRAMES)))


@pytest.fixture(params=[{"both": 0b11}, {"left": 0b01, "right": 0b10}], ids=["one", "two"])
def walk(request):
    return source_from_words([np.repeat(np.array(WALK, np.uint64), FRAMES)], request.param)


def query_of(*sets):
    steps = tuple(FuzzySet(tuple((0b11, word) for word in words)) for words in sets)
    return FuzzyQuery(steps, np.ones(len(steps), np.int64))


def segments_of(hits):
    """Segment numbers, from 1, that the steps of each hit start with, and where it ends."""
    return (np.searchsorted(BOUNDS, hits) + 1).tolist()


def test_inverted_lists_of_the_walk():
    source = source_from_words([np.array(WALK, np.uint64)], {"both": 0b11})
    lists = source.parts[0].lists
    found = dict(zip(lists.words.tolist(), lists.lists(range(3)), strict=True))
    numbers = {word: [run + 1 for run in runs] for word, runs in found.items()}
    assert numbers == {0b11: [1, 3, 5, 7, 9], 0b01: [2, 6, 10], 0b10: [4, 8]}


def test_exact_hits_start_at_the_fourth_and_eighth_segment(walk):
    example = np.array([0b10, 0b10, 0b11, 0b01], np.uint64)
    hits = exact_hits(steps_from_example(example, 0b11), walk)
    assert segments_of(hits) == [[4, 5, 6, 7], [8, 9, 10, 11]]


def test_fuzzy_sets_ignore_time_so_there_is_no_fuzzy_hit(walk):
    assert not len(fuzzy_hits(query_of((0b00, 0b01), (0b10, 0b11), (0b00, 0b01)), walk))


def test_adaptive_hits_start_at_the_second_and_sixth_segment(walk):
    hits = adaptive_hits(query_of((0b00, 0b01), (0b10, 0b11), (0b00, 0b01)), walk)
    assert segments_of(hits) == [[2, 3, 6, 7], [6, 7, 10, 11]]


def test_these_adaptive_hits_are_the_exact_hits_on_the_first_component(walk):
    example = np.array([0b00, 0b10, 0b00], np.uint64)
    hits = exact_hits(steps_from_example(example, 0b10), walk)
    assert segments_of(hits) == [[2, 3, 6, 7], [6, 7, 10, 11]]


def test_fuzzy_hits_are_one_segment_a_step(walk):
    hits = fuzzy_hits(query_of((0b10, 0b01), (0b11,), (0b10, 0b01)), walk)
    assert segments_of(hits) == [[2, 3, 4, 5], [4, 5, 6, 7], [6, 7, 8, 9], [8, 9, 10, 11]]
