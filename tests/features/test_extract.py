"""Extraction against a frame-by-frame oracle, and what must not change the features."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import FeatureSetError
from mocapidx.features import extract
from mocapidx.features.extract import (
    condition_values,
    extract_features,
    feature_margins,
    feature_values,
    untrusted_features,
)
from mocapidx.features.featureset import load_feature_set
from mocapidx.features.relations import leaves
from mocapidx.features.trust import body_lengths
from mocapidx.model import Motion
from tests import naive_features as naive

F39 = load_feature_set("f39")
STANDING = {
    **{"root": (0, 0.95, 0), "belly": (0, 1.08, 0.01), "chest": (0, 1.22, 0), "neck": (0, 1.42, 0)},
    **{"head": (0, 1.52, 0.02), "headtop": (0, 1.72, 0.03)},
    **{"lhip": (0.1, 0.9, 0), "lknee": (0.11, 0.5, 0.01), "lankle": (0.12, 0.1, 0)},
    **{"ltoes": (0.13, 0.02, 0.16), "lclavicle": (0.01, 1.42, 0), "lshoulder": (0.2, 1.4, 0)},
    **{"lelbow": (0.22, 1.12, 0), "lwrist": (0.23, 0.86, 0.02), "lfingers": (0.23, 0.7, 0.03)},
}


def standing():
    """A standing body, shape (24, 3)."""
    right = {"r" + j[1:]: (-x, y, z) for j, (x, y, z) in STANDING.items() if j[0] == "l"}
    body = STANDING | right
    return np.array([body[joint] for joint in naive.JOINTS])


def random_motion(seed, frames=60, rate=30.0, rest=False, swing=0.15):
    """A body whose joints wander smoothly, far enough to switch most features."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames) / 30
    waves = rng.normal(size=(3, 24, 3)) * swing * rng.uniform(0.2, 2)
    phases = rng.uniform(0, 6.3, size=(3, 24, 3))
    speeds = rng.uniform(0.5, 9, size=(3, 24, 3))
    wander = (waves * np.sin(times[:, None, None, None] * speeds + phases)).sum(axis=1)
    reach = rng.uniform(0, 1) * np.sin(times * rng.uniform(0.5, 3)) ** 2
    for hand, side in (("lwrist", 1), ("rwrist", -1)):
        wander[:, naive.JOINTS.index(hand), 0] += side * reach
    travel = np.zeros((frames, 1, 3))
    travel[:, 0, 2] = times * rng.uniform(0, 1.5)
    return Motion(
        tuple(naive.JOINTS), standing() + wander + travel, rate, standing() if rest else None
    )


def changed(motion, positions, joints=None, **others):
    return Motion(joints or motion.joints, positions, motion.rate, motion.rest, **others)


def without_rest(motion):
    return Motion(motion.joints, motion.positions, motion.rate)


def mask(*ids):
    return F39.select(",".join(ids)) if ids else 0


seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.integers(1, 40), st.sampled_from([15.0, 30.0, 120.0]), st.booleans())
@settings(max_examples=25, deadline=None)
def test_features_are_those_of_the_frame_by_frame_formulas(seed, frames, rate, rest):
    motion = random_motion(seed, frames, rate, rest)
    found = extract_features(motion, rate=rate)
    assert found.dtype == np.bool_
    np.testing.assert_array_equal(found, naive.f39(motion))


def test_the_random_bodies_of_these_tests_switch_every_feature():
    on = np.concatenate([extract_features(random_motion(seed)) for seed in range(60)])
    assert (on.any(axis=0) & ~on.all(axis=0)).all()


@pytest.mark.parametrize("seed", range(3))
def test_values_are_those_of_the_formulas_turned_so_that_larger_is_more_on(seed):
    motion = random_motion(seed, 20)
    values = feature_values(motion)
    for t, frame in enumerate(naive.f39_values(motion)):
        expected = []
        for k in range(1, 40):
            right = naive.LEFT_OF.get(k, k)
            value = min(frame[k]) if right == 25 else frame[k]
            if right in (7, 20, 37):
                value = -value
            if right == 32:
                value = min(value - 70, 110 - value)
            expected.append(value)
        np.testing.assert_allclose(values[t], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_margins_say_which_test_holds_and_bits_follow_from_them(seed):
    motion = random_motion(seed)
    margins, bits = feature_margins(motion), extract_features(motion)
    plain = [i for i, f in enumerate(F39.features) if f.condition.kind != "all_of"]
    assert bits[margins.strong > 0].all()
    assert not bits[margins.weak < 0].any()
    np.testing.assert_array_equal(
        bits[1:, plain],
        np.where((margins.strong > 0) | (margins.weak <= 0), margins.strong > 0, bits_before(bits))[
            1:, plain
        ],
    )
    assert (margins.weak >= margins.strong).all()


def bits_before(bits):
    return np.concatenate([np.zeros_like(bits[:1]), bits[:-1]])


def test_each_part_of_a_combination_has_its_own_value():
    motion = random_motion(1)
    parts = list(leaves(F39.features[24].condition))
    values = condition_values(motion, parts)
    assert values.shape == (60, 2)
    frames = naive.f39_values(motion)
    np.testing.assert_allclose(values, [frame[25] for frame in frames], rtol=1e-9)


def turned(positions, angle):
    c, s = np.cos(angle), np.sin(angle)
    return positions @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T


@given(
    seeds,
    st.floats(0, 6.3),
    st.tuples(*[st.floats(-20, 20)] * 3),
    st.floats(0.1, 10),
)
@settings(max_examples=25, deadline=None)
def test_turning_shifting_and_scaling_change_no_feature(seed, angle, shift, scale):
    motion = random_motion(seed, 30)
    moved = changed(motion, scale * (turned(motion.positions, angle) + shift))
    values = feature_values(motion)
    np.testing.assert_allclose(feature_values(moved), values, rtol=1e-7, atol=1e-7)
    margins = feature_margins(motion)
    near = np.minimum(np.abs(margins.strong), np.abs(margins.weak)).min(axis=0) < 1e-7
    np.testing.assert_array_equal(
        extract_features(moved)[:, ~near], extract_features(motion)[:, ~near]
    )


@given(seeds, st.booleans())
@settings(max_examples=25, deadline=None)
def test_mirroring_a_motion_exchanges_the_pairs_exactly(seed, rest):
    motion = random_motion(seed, 30, rest=rest)
    mirrored = changed(motion, naive.mirror_motion(motion.positions))
    own = F39.mirror == np.arange(39)
    values, expected = feature_values(mirrored), feature_values(motion)[:, F39.mirror]
    np.testing.assert_array_equal(values[:, ~own], expected[:, ~own])
    np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(
        extract_features(mirrored), extract_features(motion)[:, F39.mirror]
    )


def test_joints_may_stand_in_any_order_with_others_between():
    motion = random_motion(3)
    order = np.random.default_rng(0).permutation(24)
    positions = motion.positions[:, order]
    joints = tuple(naive.JOINTS[i] for i in order)
    far = np.full((60, 1, 3), -50.0)  # would be the lowest joint and widen the body
    shuffled = changed(motion, np.concatenate([far, positions], axis=1), ("sword", *joints))
    np.testing.assert_array_equal(extract_features(shuffled), extract_features(motion))
    assert untrusted_features(shuffled) == 0


@pytest.mark.parametrize("block", [1, 2, 7])
def test_long_motions_are_worked_on_in_blocks_without_a_seam(block, monkeypatch):
    motion = random_motion(5)
    whole, values = extract_features(motion), feature_values(motion)
    monkeypatch.setattr(extract, "BLOCK", block)
    np.testing.assert_array_equal(extract_features(motion), whole)
    np.testing.assert_array_equal(feature_values(motion), values)


def test_one_frame_and_no_frame_have_features():
    motion = random_motion(0, frames=1)
    assert extract_features(motion).shape == (1, 39)
    empty = changed(motion, motion.positions[:0])
    assert extract_features(empty).shape == (0, 39)
    assert feature_margins(empty).weak.shape == (0, 39)


def test_single_precision_positions_give_the_same_features():
    motion = random_motion(8)
    single = changed(motion, motion.positions.astype(np.float32))
    margins = feature_margins(motion)
    near = np.minimum(np.abs(margins.strong), np.abs(margins.weak)).min(axis=0) < 1e-3
    np.testing.assert_array_equal(
        extract_features(single)[:, ~near], extract_features(motion)[:, ~near]
    )


def test_other_rates_are_resampled_by_time():
    motion = random_motion(2, frames=121, rate=120.0)
    every_fourth = Motion(motion.joints, motion.positions[::4], 30.0)
    np.testing.assert_array_equal(extract_features(motion), extract_features(every_fourth))


@pytest.mark.parametrize(
    ("joint", "features"),
    [
        ("rwrist", ("F1", "F3", "F5", "F7", "F9", "F10", "F11", "F13", "F33")),
        ("ltoes", ("F15", "F26")),
        ("lclavicle", ()),
        ("headtop", ()),
        ("rhip", ("F1", "F2", "F16", "F19", "F20", "F22", "F23", "F24", "F29", "F35", "F36")),
    ],
)
@pytest.mark.parametrize("how", ["absent", "nan", "made"])
def test_a_missing_or_made_joint_spoils_the_features_that_name_it(joint, features, how):
    motion = random_motion(4)
    column = naive.JOINTS.index(joint)
    if how == "absent":
        joints = tuple(j for j in naive.JOINTS if j != joint)
        poor = changed(without_rest(motion), np.delete(motion.positions, column, axis=1), joints)
    elif how == "nan":
        positions = motion.positions.copy()
        positions[:, column] = np.nan
        poor = changed(motion, positions)
    else:
        poor = changed(motion, motion.positions, made=(joint,))
    untrusted = untrusted_features(poor)
    assert untrusted == mask(*features)
    found = extract_features(poor)
    assert not found[:, [i for i in range(39) if untrusted >> i & 1]].any()
    named = set(features) | {"F17", "F18", "F33", "F34", "F37", "F38"}
    same = [i for i, key in enumerate(F39.ids) if key not in named]
    np.testing.assert_array_equal(found[:, same], extract_features(motion)[:, same])


def test_without_any_humerus_the_legs_tell_its_length():
    motion = random_motion(4)
    one_side = changed(motion, motion.positions, made=("relbow",))
    assert untrusted_features(one_side) == mask("F7", "F27")
    both = changed(motion, motion.positions, made=("relbow", "lelbow"))
    assert untrusted_features(both) == mask("F7", "F8", "F27", "F28")
    no_length = ("relbow", "lelbow", "rknee", "lknee")
    both = changed(motion, motion.positions, made=no_length)
    in_degrees_or_widths = ["F9", "F19", "F22", "F32", "F35", "F36"]
    assert F39.select("all") & ~untrusted_features(both) == mask(*in_degrees_or_widths)


def test_legs_alone_tell_what_legs_do_and_nothing_of_extents():
    motion = random_motion(4)
    arms_and_head = [j for j in naive.JOINTS if not j.endswith(("hip", "knee", "ankle", "toes"))]
    legs = changed(motion, motion.positions, made=tuple(set(arms_and_head) - {"root"}))
    known = F39.select("all") & ~untrusted_features(legs)
    assert known == mask(*(f"F{i}" for i in range(15, 27)), "F39")
    arms = changed(motion, motion.positions, made=("lankle", "rankle"))
    assert untrusted_features(arms) & mask("F17", "F18", "F33", "F34", "F37", "F38") == mask(
        "F17", "F18", "F33", "F34", "F37", "F38"
    )


def test_the_legs_stand_in_by_the_proportions_of_people():
    motion = random_motion(4)
    column = {joint: i for i, joint in enumerate(naive.JOINTS)}
    positions = np.zeros((2, 24, 3))
    for joint, height in {"lhip": 0.9, "lknee": 0.5, "lankle": 0.1}.items():
        positions[:, column[joint], 1] = height
    positions[:, [column[j] for j in ("relbow", "lelbow", "rknee")]] = np.nan
    legs = Motion(motion.joints, positions, 30.0)
    assert body_lengths(legs)["hl"] == pytest.approx(0.33 * 0.8)


def test_joints_that_are_one_point_spoil_only_what_needs_them_apart():
    motion = random_motion(6)
    positions = motion.positions.copy()
    at = naive.JOINTS.index
    positions[:, at("lclavicle")] = positions[:, at("neck")]
    positions[:, at("rclavicle")] = positions[:, at("neck")]
    assert untrusted_features(changed(motion, positions)) == 0  # every Acclaim skeleton
    positions[:, at("chest")] = positions[:, at("neck")] + 1e-6
    assert untrusted_features(changed(motion, positions)) == mask("F3", "F4")
    positions[0, at("chest")] += 0.01  # one point in most frames only
    assert untrusted_features(changed(motion, positions)) == 0


def test_a_gap_in_a_joint_keeps_the_state_before_it():
    motion = random_motion(7)
    positions = motion.positions.copy()
    positions[20:25, naive.JOINTS.index("relbow")] = np.nan
    found = extract_features(changed(motion, positions))
    assert untrusted_features(changed(motion, positions)) == 0
    assert (found[20:25, 6] == found[19, 6]).all()
    np.testing.assert_array_equal(found[:, 12], extract_features(motion)[:, 12])


def test_lengths_come_from_the_zero_pose_where_there_is_one():
    motion = random_motion(9)
    large = Motion(motion.joints, motion.positions, 30.0, 2 * standing())
    small = Motion(motion.joints, motion.positions, 30.0, standing())
    speeds = [F39.ids.index(key) for key in ("F13", "F39")]
    np.testing.assert_allclose(
        2 * feature_values(large)[:, speeds], feature_values(small)[:, speeds], rtol=1e-12
    )


def test_an_unknown_set_is_named():
    with pytest.raises(FeatureSetError, match="f40: no such file; shipped sets are"):
        extract_features(random_motion(0, frames=2), "f40")
