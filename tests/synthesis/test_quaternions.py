import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.synthesis.quaternions import (
    about_vertical,
    averaged,
    continuous,
    from_matrices,
    product,
    sampled,
    to_matrices,
)


def some(count, seed=0):
    quaternions = np.random.default_rng(seed).normal(size=(count, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def test_matrices_and_back_are_the_same_rotations():
    quaternions = some(200)
    again = from_matrices(to_matrices(quaternions))
    np.testing.assert_allclose(np.abs(np.sum(again * quaternions, axis=1)), 1, atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_half_turns_survive_as_matrices(axis):
    half = -np.eye(3)
    half[axis, axis] = 1
    np.testing.assert_allclose(to_matrices(from_matrices(half)), half, atol=1e-12)


def test_products_are_those_of_matrices():
    one, other = some(50), some(50, 1)
    found = to_matrices(product(one, other))
    np.testing.assert_allclose(found, to_matrices(one) @ to_matrices(other), atol=1e-12)


def test_turns_about_the_vertical_go_from_z_towards_x():
    turn = to_matrices(about_vertical(np.array(np.pi / 2)))
    np.testing.assert_allclose(turn @ [0, 0, 1], [1, 0, 0], atol=1e-12)


@given(st.floats(0, 1), st.integers(0, 50))
def test_an_average_of_two_lies_between_them_whatever_their_signs(share, seed):
    one, other = some(2, seed)
    weights = np.array([1 - share, share])
    found = averaged(np.array([one, other]), weights)
    again = averaged(np.array([one, -other]), weights)
    assert abs(abs(found @ again) - 1) < 1e-9
    assert abs(found @ one) >= abs(one @ other) - 1e-9


def test_equal_rotations_average_to_themselves():
    one = some(5)
    found = averaged(np.array([one, -one, one]), np.array([0.7, 0.4, -0.1]))
    np.testing.assert_allclose(np.abs(np.sum(found * one, axis=1)), 1, atol=1e-12)


def test_signs_follow_from_frame_to_frame():
    steady = np.repeat(some(1)[None], 6, axis=0)
    flipped = steady * np.array([1, -1, -1, 1, -1, 1.0])[:, None, None]
    np.testing.assert_allclose(continuous(flipped), steady)
    np.testing.assert_allclose(
        sampled(continuous(flipped), np.array([2]), np.array([0.5])), steady[:1]
    )
