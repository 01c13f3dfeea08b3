"""The building blocks against slow geometry."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.features.geometry import (
    along,
    angle_between,
    cross,
    difference_quotient,
    plane_normal,
    segment_distance,
    widest_floor_distance,
)

seeds = st.integers(0, 2**32 - 1)


def vectors(*rows):
    return np.array(rows, dtype=float).T


def test_velocities_are_central_differences_and_one_sided_at_the_ends():
    points = np.array([0.0, 1.0, 4.0, 9.0])
    assert difference_quotient(points, 10.0).tolist() == [10, 20, 40, 50]
    assert difference_quotient(points[:2], 10.0).tolist() == [10, 10]
    assert difference_quotient(points[:1], 10.0).tolist() == [0]
    assert difference_quotient(points[:0], 10.0).tolist() == []


def test_the_cross_product_is_right_handed():
    assert cross(vectors([1, 0, 0]), vectors([0, 1, 0])).T.tolist() == [[0, 0, 1]]
    normal = plane_normal(vectors([0, 0, 0]), vectors([1, 0, 0]), vectors([0, 1, 0]))
    assert normal.T.tolist() == [[0, 0, 1]]


def test_a_direction_without_length_has_no_component():
    found = along(vectors([1, 2, 3], [1, 2, 3]), vectors([0, 0, 0], [0, 0, 5]))
    np.testing.assert_array_equal(found, [np.nan, 3])


def test_angles_are_exact_at_both_ends_of_the_scale():
    a = vectors([1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0])
    b = vectors([2, 0, 0], [-3, 0, 0], [0, 4, 0], [1, 1e-9, 0], [1, 0, 0])
    expected = [0, 180, 90, np.degrees(1e-9), np.nan]
    np.testing.assert_allclose(angle_between(a, b), expected, rtol=1e-12)


@pytest.mark.parametrize("factor", [0, 1, 1e-3, 1e3])
@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_segment_distance_is_the_least_over_all_pairs_of_points(factor, seed):
    a, b, c, d = np.random.default_rng(seed).normal(size=(4, 3))
    d = c + factor * (d - c)
    found = float(segment_distance(*(p[:, None] for p in (a, b, c, d)))[0])
    shares = np.linspace(0, 1, 201)[:, None]
    first, second = a + shares * (b - a), c + shares * (d - c)
    brute = np.sqrt(((first[:, None] - second[None]) ** 2).sum(axis=2)).min()
    step = (np.linalg.norm(b - a) + np.linalg.norm(d - c)) / 200
    assert brute - step <= found <= brute + 1e-12


@pytest.mark.parametrize(
    ("ends", "distance"),
    [
        (([0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]), 1),  # parallel
        (([0, 0, 0], [1, 0, 0], [3, 0, 0], [2, 0, 0]), 1),  # one behind the other
        (([0, 0, 0], [2, 0, 0], [1, -1, 0], [1, 1, 0]), 0),  # crossing
        (([0, 0, 0], [2, 0, 0], [1, -1, 5], [1, 1, 5]), 5),  # passing
        (([1, 1, 1], [1, 1, 1], [1, 1, 3], [1, 1, 3]), 2),  # two points
    ],
)
def test_segments_in_special_places_have_the_right_distance(ends, distance):
    points = [vectors(end) for end in ends]
    assert segment_distance(*points).tolist() == [distance]
    assert segment_distance(*points[2:], *points[:2]).tolist() == [distance]


@given(seeds, st.integers(1, 24))
@settings(max_examples=25, deadline=None)
def test_the_widest_floor_distance_is_that_of_the_farthest_pair(seed, joints):
    points = np.random.default_rng(seed).normal(size=(joints, 3, 4))
    pairs = [(points[i] - points[j])[[0, 2]] for i in range(joints) for j in range(joints)]
    expected = np.sqrt((np.array(pairs) ** 2).sum(axis=1)).max(axis=0)
    np.testing.assert_allclose(widest_floor_distance(points), expected, rtol=1e-12)
