import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.alignment.subsequence import subsequence_costs
from mocapidx.errors import ParameterError
from mocapidx.features.words import pack_words
from mocapidx.templates import match
from mocapidx.templates.match import (
    distance_function,
    find_hits,
    local_minima,
    lowest_costs,
    match_documents,
    merge_hits,
)
from mocapidx.templates.quantise import quantise
from mocapidx.templates.template import MotionTemplate

PATTERN = np.eye(8, dtype=bool)


def performed(rng, frames=0):
    """The pattern at a random speed, after some frames of nothing."""
    motion = np.repeat(PATTERN, rng.integers(1, 3, 8), axis=0)
    return np.vstack((np.zeros((frames, 8), dtype=bool), motion))


def template(matrix=PATTERN):
    return MotionTemplate("turn", matrix.astype(np.float64), "d", 30.0)


def matched(documents, matrix=PATTERN, **options):
    bounds = np.cumsum([0, *map(len, documents)])
    words = pack_words(np.vstack(documents))
    return match_documents(quantise(matrix.astype(float), 0.1), words, bounds, **options)


def naive_minima(costs):
    """Frames that begin a stretch of equal values with higher ones, or nothing, on both sides."""
    found = []
    for first, value in enumerate(costs):
        after = first
        while after < len(costs) and costs[after] == value:
            after += 1
        falls = first == 0 or costs[first - 1] > value
        if falls and (after == len(costs) or costs[after] > value) and value != np.inf:
            found.append(first)
    return found


values = st.lists(st.sampled_from([0.0, 0.25, 0.5, np.inf]), min_size=1, max_size=12)


@given(st.lists(values, min_size=1, max_size=4))
def test_minima_match_the_plain_version_in_every_document(documents):
    bounds = np.cumsum([0, *map(len, documents)])
    costs = np.array([cost for costs in documents for cost in costs], dtype=np.float32)
    expected = [
        bounds[d] + frame
        for d, document in enumerate(documents)
        for frame in naive_minima(document)
    ]
    assert local_minima(costs, bounds).tolist() == expected


def test_every_performance_is_found_where_it_is():
    rng = np.random.default_rng(1)
    takes = [np.vstack((performed(rng, 20), performed(rng, 30))), performed(rng, 25)]
    hits = find_hits(matched(takes), 0.06)
    assert sorted(hits.documents.tolist()) == [0, 0, 1]
    for document, start, end in zip(hits.documents, hits.starts, hits.ends, strict=True):
        assert takes[document][start].argmax() == 0
        assert takes[document][end - 1].argmax() == 7
        assert 8 <= end - start <= 16
    assert (hits.costs < 0.06).all()


@given(st.integers(0, 2**32), st.sampled_from(["weighted", "printed"]), st.booleans())
def test_many_documents_cost_what_each_alone_costs(seed, steps, padded):
    rng = np.random.default_rng(seed)
    documents = [rng.random((n, 8)) < 0.3 for n in rng.integers(1, 30, 5)]
    together = matched(documents, steps=steps, padded=padded)
    alone = [
        distance_function(template(), pack_words(document), steps, padded) for document in documents
    ]
    np.testing.assert_array_equal(together.costs, np.concatenate(alone))
    np.testing.assert_array_equal(lowest_costs(together), [costs.min() for costs in alone])


@given(st.integers(0, 2**32))
def test_hits_are_best_first_and_leave_room_for_one_another(seed):
    rng = np.random.default_rng(seed)
    documents = [rng.random((n, 8)) < 0.2 for n in rng.integers(5, 60, 4)]
    hits = find_hits(matched(documents), 2.0)
    order = list(zip(hits.costs, hits.documents, hits.starts, strict=True))
    assert order == sorted(order)
    rows = list(zip(hits.documents, hits.starts, hits.ends, strict=True))
    for n, (document, start, end) in enumerate(rows):
        assert 0 <= start < end <= len(documents[document])
        for other, other_start, other_end in rows[:n]:
            if other == document:
                common = min(end, other_end) - max(start, other_start)
                assert common <= 0.5 * min(end - start, other_end - other_start)


@given(st.integers(0, 2**32), st.integers(1, 6))
def test_the_best_few_are_the_first_of_all(seed, top):
    rng = np.random.default_rng(seed)
    matching = matched([rng.random((n, 8)) < 0.2 for n in rng.integers(5, 60, 4)])
    everything, few = find_hits(matching, 2.0), find_hits(matching, 2.0, top=top)
    assert len(few.costs) >= min(top, len(everything.costs))
    np.testing.assert_array_equal(few.starts, everything.starts[: len(few.starts)])
    assert (few.costs <= everything.costs[min(top, len(everything.costs)) - 1]).all()


def test_padding_finds_a_document_cut_short_and_keeps_its_frames():
    middle = PATTERN[3:5]  # two frames, the template needs five
    assert np.isinf(matched([middle], padded=False).costs).all()
    padded = matched([middle])
    assert np.isfinite(padded.costs[-1])
    hits = find_hits(padded, 1.0)
    assert (hits.starts.tolist(), hits.ends.tolist()) == ([0], [2])


def test_padding_spares_a_performance_that_is_cut_at_its_ends():
    long = np.repeat(PATTERN, 5, axis=0)
    cut = long[4:-4]
    with_padding = matched([cut], matrix=long)
    without = matched([cut], matrix=long, padded=False)
    assert lowest_costs(with_padding)[0] < lowest_costs(without)[0]
    hits = find_hits(with_padding, 0.06)
    assert (hits.starts.tolist(), hits.ends.tolist()) == ([0], [len(cut)])


def test_without_padding_the_costs_are_those_of_the_kernel():
    words = pack_words(np.random.default_rng(3).random((50, 8)) < 0.3)
    quantised = quantise(PATTERN.astype(float), 0.1)
    np.testing.assert_array_equal(
        distance_function(template(), words, padded=False),
        subsequence_costs(quantised.ones, quantised.care, words),
    )


def test_untrusted_features_count_as_undecided():
    words = pack_words(np.delete(PATTERN, 4, axis=0))
    masked = PATTERN.astype(float)
    masked[:, 2] = 0.5
    np.testing.assert_array_equal(
        distance_function(template(), words, untrusted=0b100),
        distance_function(template(masked), words),
    )


@pytest.mark.parametrize("bounds", [[0, 3], [0, 2, 2, 4], [1, 4]])
def test_bounds_that_do_not_fit_are_refused(bounds):
    quantised = quantise(PATTERN.astype(float), 0.1)
    with pytest.raises(ParameterError, match="bounds"):
        match_documents(quantised, np.zeros(4, dtype=np.uint64), np.array(bounds))


def test_hits_of_two_templates_leave_room_for_one_another():
    rng = np.random.default_rng(2)
    takes = [np.vstack((performed(rng, 20), performed(rng, 30)))]
    one, other = (
        find_hits(matched(takes, matrix=PATTERN[rows]), 0.3) for rows in (range(8), range(1, 8))
    )
    both = merge_hits([one, other])
    assert both.costs.tolist() == sorted(both.costs.tolist())
    assert len(both.costs) >= max(len(one.costs), len(other.costs))
    np.testing.assert_array_equal(merge_hits([one, one]).starts, one.starts)
    assert len(merge_hits([find_hits(matched(takes), 1e-9)]).costs) in (0, 1, 2)


@given(
    costs=st.lists(st.sampled_from([0.1, 0.2, 0.3, 0.4, math.inf]), min_size=1, max_size=30),
    cuts=st.sets(st.integers(1, 29), max_size=4),
    tau=st.sampled_from([0.05, 0.15, 0.25, 0.5, 9.0]),
)
def test_only_minima_below_the_threshold_are_looked_for(costs, cuts, tau):
    costs = np.array(costs, dtype=np.float32)
    bounds = np.array([0, *sorted(cut for cut in cuts if cut < len(costs)), len(costs)])
    minima = match.local_minima(costs, bounds)
    expected = minima[costs[minima] < tau]
    np.testing.assert_array_equal(match._minima_below(costs, bounds, tau), expected)


@given(
    seed=st.integers(0, 2**32),
    rows=st.lists(st.integers(1, 90), min_size=1, max_size=4),
    lengths=st.lists(st.integers(1, 60), min_size=1, max_size=5),
    kind=st.sampled_from(["padded", "bare", "pieces"]),
)
def test_several_templates_match_as_each_by_itself(seed, rows, lengths, kind):
    rng = np.random.default_rng(seed)
    bounds = np.cumsum([0, *lengths])
    words = rng.integers(0, 256, bounds[-1], dtype=np.uint64)
    several = [quantise(rng.choice([0.0, 0.5, 1.0], (k, 8)), 0.1) for k in rows]
    ends = tuple(rng.random((2, len(lengths))) < 0.5)
    padded = {"padded": True, "bare": False, "pieces": ends}[kind]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(match, "CELLS_AT_ONCE", 2 * len(words))
        together = list(match.match_several(several, words, bounds, padded=padded, threads=2))
    for quantised, ours in zip(several, together, strict=True):
        alone = match_documents(quantised, words, bounds, padded=padded)
        np.testing.assert_array_equal(ours.costs, alone.costs)
        hits, expected = find_hits(ours, 0.6), find_hits(alone, 0.6)
        for name in ("documents", "starts", "ends", "costs"):
            np.testing.assert_array_equal(getattr(hits, name), getattr(expected, name))
