"""Where joints are missing for a while, the features over them are open, and only there."""

from itertools import pairwise

import numpy as np
import pytest

from mocapidx.features.extract import extract_features, untrusted_features
from mocapidx.features.featureset import load_feature_set
from mocapidx.features.gaps import unspecified_within
from mocapidx.features.unspecified import feature_words
from mocapidx.features.words import pack_words
from mocapidx.model import Motion
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX

IDS = load_feature_set("f39").ids


def some_motion(frames=90):
    rng = np.random.default_rng(9)
    steps = rng.normal(0, 0.02, (frames, 24, 3)).cumsum(axis=0)
    return Motion(CANONICAL_JOINTS, rng.normal(0, 0.4, (24, 3)) + steps, 30.0)


def without(motion, joint, frames):
    positions = motion.positions.copy()
    positions[frames, INDEX[joint]] = np.nan
    return Motion(motion.joints, positions, motion.rate)


def bits(*ids):
    return sum(1 << IDS.index(id) for id in ids)


def test_motion_without_gaps_has_the_words_it_always_had():
    motion = some_motion()
    told = feature_words(motion)
    np.testing.assert_array_equal(told.words, pack_words(extract_features(motion, "f39", 30.0)))
    assert told.unspecified == ()
    assert told.untrusted == untrusted_features(motion, "f39")


def test_a_joint_that_is_missing_for_a_while_leaves_its_features_open():
    whole = some_motion()
    told = feature_words(without(whole, "rwrist", slice(30, 45)))
    mask = unspecified_within(told.unspecified, 30, 45)
    # every relation of the right hand; heights and extents look at all joints
    hand = bits("F1", "F3", "F5", "F7", "F9", "F10", "F11", "F13")
    everywhere = bits("F17", "F18", "F33", "F34", "F37", "F38")
    assert mask == hand | everywhere
    assert not unspecified_within(told.unspecified, 0, 29)
    assert not unspecified_within(told.unspecified, 46, 90)
    # velocities look at neighbours, positions do not
    assert unspecified_within(told.unspecified, 29, 30) == bits("F1", "F5", "F10", "F11", "F13")
    assert unspecified_within(told.unspecified, 45, 46) == unspecified_within(
        told.unspecified, 29, 30
    )
    expected = feature_words(whole).words
    np.testing.assert_array_equal(
        told.words[30:45] & np.uint64(~(mask | told.untrusted) & (1 << 39) - 1),
        expected[30:45] & np.uint64(~(mask | told.untrusted) & (1 << 39) - 1),
    )
    assert not (told.words[30:45] & np.uint64(mask)).any()
    np.testing.assert_array_equal(told.words[:29], expected[:29])


def test_stretches_come_in_order_and_never_overlap():
    motion = without(some_motion(), "rwrist", slice(10, 30))
    motion = without(motion, "lankle", slice(25, 40))
    rows = feature_words(motion).unspecified
    assert all(start < end for start, end, _ in rows)
    assert all(one[1] <= other[0] for one, other in pairwise(rows))


def test_a_joint_that_is_never_there_is_untrusted_and_no_gap():
    motion = without(some_motion(), "rwrist", slice(None))
    told = feature_words(motion)
    assert told.unspecified == ()
    assert told.untrusted & bits("F1", "F13") == bits("F1", "F13")


def test_what_comes_and_goes_too_often_is_not_trusted_at_all():
    motion = some_motion(9000)
    told = feature_words(without(motion, "rwrist", slice(None, None, 8)))
    assert len(told.unspecified) == 1  # so near that they are one
    sparse = feature_words(without(some_motion(200_000), "rwrist", slice(5, None, 190)))
    assert sparse.unspecified == ()
    assert sparse.untrusted & bits("F13")


@pytest.mark.parametrize("frames", [1, 2])
def test_motion_of_hardly_any_frames(frames):
    motion = without(some_motion(frames), "rwrist", slice(0, 1))
    told = feature_words(motion)
    assert len(told.words) == frames
    assert (told.untrusted | unspecified_within(told.unspecified, 0, 1)) & bits("F13")
