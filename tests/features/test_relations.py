"""Hysteresis, mirroring and combinations of conditions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mocapidx.features.geometry import Poses
from mocapidx.features.kinds import KINDS
from mocapidx.features.relations import (
    Condition,
    combine,
    combine_margins,
    mirrored,
    normal_form,
    open_interval,
    robust_threshold,
)
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from tests import naive_features as naive

seeds = st.integers(0, 2**32 - 1)


def decide(values, on, off, before=False):
    values = np.array([values], dtype=float)
    return robust_threshold(values > on, values <= off, np.array([before]))[0].astype(int).tolist()


def test_the_weak_threshold_holds_what_the_strong_one_began():
    assert decide([0, 1.1, 1.3, 1.1, 0.9, 1.1], on=1.2, off=1.0) == [0, 0, 1, 1, 0, 0]


def test_between_the_thresholds_the_state_before_the_first_frame_stays():
    assert decide([1.1, 1.1], on=1.2, off=1.0) == [0, 0]
    assert decide([1.1, 1.1, 0.5], on=1.2, off=1.0, before=True) == [1, 1, 0]


def test_comparisons_with_one_number_are_strict():
    assert decide([1.2, 1.3, 1.0], on=1.2, off=1.0) == [0, 1, 0]


def test_an_unknown_value_decides_nothing():
    nan = float("nan")
    assert decide([nan, 2, nan, nan, 0, nan], on=1.2, off=1.0) == [0, 1, 1, 1, 0, 0]


@given(arrays(np.float64, st.integers(1, 50), elements=st.floats(0, 3)), st.booleans())
def test_hysteresis_is_that_of_a_walk_over_the_frames(values, equal):
    on, off = 2.0, 2.0 if equal else 1.0
    expected = naive.hysteresis(values, (lambda x: x > on, lambda x: x > off))
    assert decide(values, on, off) == expected


def test_ranges_are_closed_and_the_ends_of_the_scale_are_no_ends():
    def inside(low, high, value):
        condition = Condition(kind="angle", unit="deg", when="within", on=(low, high))
        start, end = open_interval(condition, condition.on)
        return start < value < end

    assert inside(70.0, 110.0, 70)
    assert inside(70.0, 110.0, 110)
    assert not inside(70.0, 110.0, np.nextafter(110, 111))
    assert inside(0.0, 110.0, 0)
    assert inside(25.0, 180.0, 180.00000000000003)


def random_poses(seed):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(2, 24, 3, 5))


def poses(points, velocities):
    rows = {joint: i for i, joint in enumerate(CANONICAL_JOINTS)}
    return Poses(rows, points, velocities, np.arange(24))


def mirror_vectors(vectors):
    order = [CANONICAL_JOINTS.index(naive.other_side(joint)) for joint in CANONICAL_JOINTS]
    return vectors[order] * np.array([-1.0, 1.0, 1.0])[:, None]


def random_condition(kind, rng):
    joints = [str(joint) for joint in rng.permutation(CANONICAL_JOINTS)]
    places = tuple(joints[: KINDS[kind].count])
    if kind == "touch":
        places = (places[0], tuple(sorted(joints[2:4])))
    return Condition(kind=kind, joints=places)


@pytest.mark.parametrize("kind", KINDS)
@given(seed=seeds)
@settings(max_examples=10, deadline=None)
def test_the_left_version_is_the_right_one_on_the_mirrored_pose_bit_by_bit(kind, seed):
    right = random_condition(kind, np.random.default_rng(seed))
    left = mirrored(right)
    points, velocities = random_poses(seed)
    reflected = poses(mirror_vectors(points), mirror_vectors(velocities))
    value = KINDS[kind].value
    np.testing.assert_array_equal(
        value(poses(points, velocities), *left.joints), value(reflected, *right.joints)
    )
    assert mirrored(left) == right


@pytest.mark.parametrize("kind", KINDS)
@given(seed=seeds)
@settings(max_examples=10, deadline=None)
def test_other_orders_of_the_joints_that_count_as_equal_have_equal_values(kind, seed):
    condition = random_condition(kind, np.random.default_rng(seed))
    stretch = poses(*random_poses(seed))
    value = KINDS[kind].value(stretch, *condition.joints)
    for order in KINDS[kind].same:
        joints = tuple(condition.joints[i] for i in order)
        np.testing.assert_allclose(KINDS[kind].value(stretch, *joints), value, rtol=1e-9, atol=1e-9)
        assert normal_form(Condition(kind=kind, joints=joints)) == normal_form(condition)


A, B = Condition(kind="fast", joints=("root",)), Condition(kind="fast", joints=("head",))
NEITHER = Condition(kind="not", of=(Condition(kind="any_of", of=(A, B)),))
BOTH = Condition(kind="all_of", of=(A, B))


def test_combinations_are_those_of_logic():
    states = {A: np.array([0, 0, 1, 1], dtype=bool), B: np.array([0, 1, 0, 1], dtype=bool)}
    assert combine(BOTH, states).astype(int).tolist() == [0, 0, 0, 1]
    assert combine(NEITHER, states).astype(int).tolist() == [1, 0, 0, 0]


def test_a_combination_is_as_far_from_turning_as_the_part_that_decides():
    margins = {
        A: (np.array([1.0]), np.array([2.0])),
        B: (np.array([-3.0]), np.array([-2.0])),
    }
    assert [m.tolist() for m in combine_margins(BOTH, margins)] == [[-3], [-2]]
    # Turns on once A has lost its weak margin of 2, is off by its strong margin of 1.
    assert [m.tolist() for m in combine_margins(NEITHER, margins)] == [[-2], [-1]]
