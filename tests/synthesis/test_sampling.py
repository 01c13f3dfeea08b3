import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.synthesis.aiming import aim, bounded
from mocapidx.synthesis.sampling import (
    interpolated_weights,
    redundant_examples,
    sample_blends,
    shares,
    valid_weights,
)
from tests import naive_blending

EXAMPLES = np.array([[0.0, 0.0], [1.0, 0.1], [0.1, 1.0], [1.2, 1.1], [0.5, 0.4], [2.0, 0.5]])


def evaluate(weights):
    """A bent plane: what blends do is nearly, not quite, linear."""
    x, y = weights @ EXAMPLES
    return np.array([x + 0.05 * np.sin(2 * y), y - 0.04 * x * x])


MEASURED = np.array([evaluate(weights) for weights in np.eye(len(EXAMPLES))])


def samples(extrapolation=0.1, draws=300):
    return sample_blends(
        evaluate, MEASURED, np.ones(2), draws=draws, extrapolation=extrapolation, tolerance=0.01
    )


@given(st.integers(1, 8), st.floats(0, 1), st.integers(0, 10**6))
def test_valid_weights_keep_to_their_bounds(count, extrapolation, seed):
    weights = valid_weights(count, extrapolation, np.random.default_rng(seed))
    assert weights.sum() == pytest.approx(1)
    assert (weights >= -extrapolation - 1e-9).all()
    assert (weights <= 1 + extrapolation + 1e-9).all()


@given(st.integers(0, 10**6), st.integers(2, 12))
def test_interpolation_follows_equations_2_and_3(seed, count):
    random = np.random.default_rng(seed)
    points, weights, target = random.random((20, 3)), random.random((20, 5)), random.random(3)
    found = interpolated_weights(points, weights, target, count)
    expected = naive_blending.interpolate(points.tolist(), weights.tolist(), target, count)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_sample_that_is_hit_or_alone_has_all_the_share():
    assert shares(np.array([0.0, 0.5])).tolist() == [1, 0]
    assert shares(np.array([0.4])).tolist() == [1]
    assert shares(np.array([0.4, 0.4])).tolist() == [0.5, 0.5]


def test_samples_are_valid_blends_of_neighbours_and_keep_apart():
    weights, points = samples()
    count = len(EXAMPLES)
    np.testing.assert_array_equal(weights[:count], np.eye(count))
    np.testing.assert_array_equal(points[:count], MEASURED)
    assert ((weights != 0).sum(axis=1) <= 3).all()
    assert weights.min() >= -0.1 - 1e-9
    assert weights.max() <= 1.1 + 1e-9
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    for blend, point in zip(weights[count:], points[count:], strict=True):
        np.testing.assert_allclose(evaluate(blend), point)
    gaps = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(len(points))
    assert gaps[count:].min() >= 0.01
    again = samples()
    np.testing.assert_array_equal(again[0], weights)


def test_the_extreme_blends_of_neighbours_are_tried():
    weights, _ = samples(draws=1)
    own = weights[len(EXAMPLES) :]
    chosen = np.flatnonzero(own.any(axis=0))
    tried = {tuple((np.round(w[chosen], 6) + 0.0).tolist()) for w in own}
    assert naive_blending.corners(3, 0.1) <= tried


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=9), st.floats(0.01, 1))
def test_bounded_weights_are_the_nearest_valid_ones(values, extrapolation):
    values = np.array(values)
    low, high = -extrapolation, 1 + extrapolation
    found = bounded(values, low, high)
    assert found.sum() == pytest.approx(1, abs=1e-8)
    assert (found >= low).all()
    assert (found <= high).all()
    for seed in range(5):  # no other valid weights are nearer
        other = valid_weights(len(values), extrapolation, np.random.default_rng(seed))
        assert np.linalg.norm(found - values) <= np.linalg.norm(other - values) + 1e-6


@pytest.mark.parametrize("seed", range(15))
def test_what_can_be_reached_is_hit_within_a_thousandth(seed):
    weights, points = samples()
    random = np.random.default_rng(seed)
    chosen = np.argsort(np.linalg.norm(MEASURED - random.random(2), axis=1))[:3]
    blend = np.zeros(len(EXAMPLES))
    blend[chosen] = valid_weights(3, 0.1, random)
    target = evaluate(blend)
    found = aim(evaluate, points, weights, target, np.ones(2), extrapolation=0.1, enough=1e-3)
    assert found.miss <= 1e-3
    np.testing.assert_allclose(evaluate(found.weights), found.reached)
    assert found.weights.min() >= -0.1 - 1e-9
    assert found.weights.max() <= 1.1 + 1e-9
    assert found.weights.sum() == pytest.approx(1)


@pytest.mark.parametrize("angle", np.arange(0, 2 * np.pi, 0.7))
def test_what_can_not_be_reached_ends_on_the_border(angle):
    weights, points = samples()
    target = np.array([1 + 5 * np.cos(angle), 0.5 + 5 * np.sin(angle)])
    options = {"extrapolation": 0.1, "enough": 1e-3}
    found = aim(evaluate, points, weights, target, np.ones(2), **options)
    assert found.miss <= np.linalg.norm(points - target, axis=1).min() + 1e-9
    assert found.weights.min() >= -0.1 - 1e-9
    assert found.weights.max() <= 1.1 + 1e-9
    # a little further towards the target nothing is reachable any more
    beyond = found.reached + 0.05 * (target - found.reached) / found.miss
    assert aim(evaluate, points, weights, beyond, np.ones(2), **options).miss > 0.03
    again = aim(evaluate, points, weights, found.reached, np.ones(2), **options)
    assert again.miss < 5e-3


def test_examples_that_the_others_give_are_redundant():
    grid = np.array([[x, y] for x in np.linspace(0, 1, 5) for y in np.linspace(0, 1, 5)])

    def linear(weights):
        return weights @ grid

    gone = redundant_examples(linear, grid, np.ones(2), 0.05)
    assert gone.any()
    assert not gone[0]
    assert (~gone).sum() >= 3
    for example in np.flatnonzero(gone):
        weights = interpolated_weights(grid[~gone], np.eye(25)[~gone], grid[example])
        assert np.linalg.norm(linear(weights) - grid[example]) < 0.3
    assert not redundant_examples(linear, grid, np.ones(2), 0.0)[[0, 4, 20, 24]].any()
