"""One example as a template: weights, matching against the plain version, guarded feedback."""

import math

import numpy as np
import pytest

from mocapidx.errors import ParameterError
from mocapidx.features.words import pack_words
from mocapidx.templates.layout import end_padding
from mocapidx.templates.oneshot import (
    FARTHEST,
    OneShot,
    Pattern,
    accept,
    flipping_distances,
    join_examples,
    lowest_places,
    match_pattern,
    pattern_hits,
    signed_distances,
    warp_to,
    weigh,
    weight_shares,
)
from tests import naive_weighted

NAN = math.nan


def random_pattern(rng, rows, features=6):
    return weigh(rng.normal(0, 3, (rows, features)))


def random_documents(rng, lengths, features=6):
    """Documents in which words stay for a while; words and bounds."""
    documents = [
        np.repeat(rng.random((length, features)) < 0.5, 2, axis=0)[:length] for length in lengths
    ]
    return documents, pack_words(np.vstack(documents)), np.cumsum([0, *lengths])


def test_a_feature_flips_at_the_threshold_that_it_is_held_by():
    bits = np.array([[True, True, False, False, True, False]])
    strong = np.array([[0.5, -0.2, -0.7, -0.1, 0.3, NAN]])
    weak = np.array([[0.9, 0.2, -0.3, 0.4, -0.1, NAN]])
    distances = flipping_distances(bits, strong, weak)
    # On: what may be lost down to the weak threshold; off: what lacks to the strong one.
    np.testing.assert_array_equal(distances, [[0.9, 0.2, 0.7, 0.1, 0.0, NAN]])


def test_distances_are_signed_and_counted_in_standard_deviations():
    shot = OneShot(np.array([[True, False, True]]), np.array([[0.9, 0.6, NAN]]))
    signed = signed_distances(shot, np.array([0.3, 0.2, 1.0]))
    np.testing.assert_allclose(signed, [[3.0, -3.0, NAN]])


def test_weight_grows_with_the_distance_up_to_a_limit():
    pattern = weigh(np.array([[1.0, -2.0, FARTHEST, -90.0, NAN, 0.0]]), power=1.5)
    shares = pattern.weights[0] / pattern.weights[0, 2]
    expected = [FARTHEST**-1.5, (2 / FARTHEST) ** 1.5, 1, 1, 0, 0]
    np.testing.assert_allclose(shares, expected, atol=1e-5)
    assert pattern.ones.tolist() == [[True, False, True, False, False, False]]


def test_an_example_that_tells_nothing_is_refused():
    with pytest.raises(ParameterError, match="no feature of the example can be trusted"):
        weigh(np.full((3, 2), NAN))


def test_what_carries_the_weight_comes_first():
    pattern = Pattern(np.zeros((2, 3), bool), np.array([[1.0, 6.0, 0.0], [1.0, 2.0, 0.0]]))
    assert list(weight_shares(pattern)) == [(1, 0.8), (0, 0.2)]


@pytest.mark.parametrize("seed", range(6))
def test_costs_are_those_of_the_plain_version_with_repeated_ends(seed):
    rng = np.random.default_rng(seed)
    pattern = random_pattern(rng, rows=7 + 5 * (seed % 2))
    documents, words, bounds = random_documents(rng, [4, 25, 1, 12])
    matching = match_pattern(pattern, words, bounds)
    repeated = end_padding(np.diff(bounds), len(pattern.ones))
    for number, (frames, extra) in enumerate(zip(documents, repeated.tolist(), strict=True)):
        padded = np.vstack([frames[:1]] * extra + [frames] + [frames[-1:]] * extra)
        plain = naive_weighted.matches(pattern.ones, pattern.weights, padded)
        ends = plain[extra : extra + len(frames)]
        ends[-1] = min(plain[extra + len(frames) - 1 :], key=lambda end: end[0])
        own = slice(bounds[number], bounds[number + 1])
        expected = np.array([cost for cost, _ in ends]) / pattern.total
        np.testing.assert_array_equal(matching.costs[own], expected.astype(np.float32))
        starts = np.clip([start - extra for _, start in ends], 0, len(frames) - 1)
        found = np.isfinite(matching.costs[own])
        np.testing.assert_array_equal(matching.starts[own][found], starts[found])


def test_the_example_itself_costs_nothing_and_its_opposite_everything():
    rng = np.random.default_rng(3)
    signed = np.tile(rng.normal(0, 2, 9), (20, 1))
    bits = np.vstack([signed > 0, signed <= 0])
    hits = lowest_places(
        match_pattern(weigh(signed), pack_words(bits), np.array([0, 20, 40]), padded=False)
    )
    assert (hits.costs[0], hits.starts[0], hits.ends[0]) == (0.0, 0, 20)
    assert hits.costs[1] == pytest.approx(1.0)


def test_features_that_documents_cannot_tell_do_not_count():
    rng = np.random.default_rng(4)
    pattern = random_pattern(rng, rows=9)
    _, words, bounds = random_documents(rng, [30, 14])
    mask = 0b010010
    blind = match_pattern(pattern.without(mask), words, bounds)
    altered = match_pattern(pattern.without(mask), words ^ np.uint64(mask), bounds)
    np.testing.assert_array_equal(blind.costs, altered.costs)
    assert pattern.without(mask).total < pattern.total
    nothing = match_pattern(pattern.without(0b111111), words, bounds)
    assert np.isinf(nothing.costs).all()
    assert len(pattern_hits(nothing).costs) == len(lowest_places(nothing).costs) == 0


def test_hits_are_best_first_and_share_at_most_half():
    rng = np.random.default_rng(5)
    _, words, bounds = random_documents(rng, [90, 70])
    hits = pattern_hits(match_pattern(random_pattern(rng, rows=12), words, bounds))
    assert (np.diff(hits.costs) >= 0).all()
    for one in range(len(hits.costs)):
        for other in range(one):
            if hits.documents[one] == hits.documents[other]:
                common = min(hits.ends[one], hits.ends[other])
                common -= max(hits.starts[one], hits.starts[other])
                shorter = min(hits.ends[[one, other]] - hits.starts[[one, other]])
                assert common <= shorter / 2


def test_feedback_takes_one_hit_a_document_five_at_most_and_cheap_ones_only():
    costs = np.array([0.01, 0.02, 0.03, 0.05, 0.06, 0.07, 0.08, 0.3], dtype=np.float32)
    documents = [7, 7, 2, 4, 5, 6, 1, 3]
    assert accept(costs, documents, median=1.0).tolist() == [0, 2, 3, 4, 5]
    assert accept(costs, documents, median=0.1).tolist() == [0, 2]
    assert accept(costs, documents, median=0.02).tolist() == []
    assert accept(costs[:0], [], median=0.0).tolist() == []


def test_warping_puts_values_where_the_features_agree():
    bits = np.array([[0], [0], [1]], dtype=bool)
    other = np.array([[0], [1], [1]], dtype=bool)
    (warped,) = warp_to(bits, [(other, np.array([[-5.0], [2.0], [4.0]]))])
    np.testing.assert_allclose(warped, [[-5.0], [-5.0], [3.0]])


def test_warping_leaves_out_what_is_unknown():
    bits = np.array([[0, 1], [1, 1]], dtype=bool)
    other = np.array([[0, 1], [1, 1], [1, 1]], dtype=bool)
    values = np.array([[-5.0, NAN], [NAN, NAN], [4.0, NAN]])
    (warped,) = warp_to(bits, [(other, values)])
    np.testing.assert_allclose(warped, [[-5.0, NAN], [4.0, NAN]])


def test_joined_examples_are_averaged_by_trust():
    bits = np.array([[True, False]])
    signed = np.array([[3.0, -1.0]])
    joined = join_examples(bits, signed, [(bits, np.array([[6.0, NAN]]))], [0.5])
    np.testing.assert_allclose(joined, [[4.0, -1.0]])
    # What only the other knows is taken from it, and what nobody knows stays unknown.
    joined = join_examples(bits, np.array([[NAN, NAN]]), [(bits, np.array([[6.0, NAN]]))], [0.5])
    np.testing.assert_allclose(joined, [[6.0, NAN]])


def test_others_can_turn_what_the_example_does_by_accident():
    bits = np.array([[True], [True]])
    signed = np.array([[0.1], [8.0]])
    other = np.array([[False], [True]])
    joined = join_examples(bits, signed, [(other, np.array([[-3.0], [7.0]]))], [1.0])
    assert (joined > 0).tolist() == [[False], [True]]
