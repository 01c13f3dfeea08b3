import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.features.featureset import load_feature_set
from mocapidx.features.words import pack_words
from mocapidx.templates.edit import (
    UNDECIDED,
    combine_templates,
    decided_entries,
    mask_template,
    mirror_template,
    new_template,
    set_entries,
    subtract_templates,
    with_keyframes,
)
from mocapidx.templates.match import distance_function
from mocapidx.templates.template import MotionTemplate

F39 = load_feature_set("f39")
MEASURED = {"positive_cost": 0.01, "background_cost": 0.1, "tau": 0.07, "spread": (0.02,)}


def template(matrix, label="squat", **changes):
    matrix = np.array(matrix, dtype=np.float64)
    return MotionTemplate(label, matrix, "d", 30.0, mean_length=len(matrix), **changes)


def random_template(seed, frames=12, features=39, **changes):
    choice = np.random.default_rng(seed).choice([0.0, 0.03, 0.4, 0.95, 1.0], (frames, features))
    return template(choice, **changes)


def test_mirroring_exchanges_paired_features_and_keeps_what_was_measured():
    cartwheel = random_template(0, keyframes=(3,), **MEASURED)
    mirrored = mirror_template(cartwheel, F39.mirror, "right")
    for i, j in enumerate(F39.mirror):
        np.testing.assert_array_equal(mirrored.matrix[:, i], cartwheel.matrix[:, j])
    assert (mirrored.label, mirrored.tau, mirrored.keyframes) == ("right", 0.07, (3,))
    again = mirror_template(mirrored, F39.mirror, "left")
    np.testing.assert_array_equal(again.matrix, cartwheel.matrix)


@given(st.integers(0, 1000))
def test_a_mirrored_template_costs_as_much_on_mirrored_motion(seed):
    features = np.random.default_rng(seed).random((30, 39)) < 0.5
    cartwheel = random_template(seed)
    mirrored = mirror_template(cartwheel, F39.mirror, "right")
    np.testing.assert_array_equal(
        distance_function(cartwheel, pack_words(features)),
        distance_function(mirrored, pack_words(features[:, F39.mirror])),
    )


def test_what_is_no_permutation_can_not_mirror():
    with pytest.raises(ParameterError, match="permutation of 39"):
        mirror_template(random_template(0), np.arange(38), "x")


def test_what_tells_combined_classes_apart_becomes_undecided():
    forwards = template([[1, 0, 1], [1, 0, 1], [1, 0, 1]], "forwards", documents=("a", "b"))
    backwards = template([[1, 1, 1], [1, 1, 1], [1, 1, 1]], "backwards", documents=("b", "c"))
    both = combine_templates([forwards, backwards], "arms")
    np.testing.assert_array_equal(both.matrix, [[1, 0.5, 1]] * 3)
    assert (both.label, both.documents, both.mean_length) == ("arms", ("a", "b", "c"), 3)


def test_combining_wants_two_templates_that_go_together():
    one = random_template(0)
    with pytest.raises(ParameterError, match="at least two"):
        combine_templates([one], "x")
    with pytest.raises(ParameterError, match="deltas"):
        combine_templates([one, random_template(1, delta=0.2)], "x")


def test_masking_touches_the_block_only_and_drops_what_was_measured():
    squat = template(np.ones((4, 3)), keyframes=(0, 1, 3), **MEASURED)
    masked = mask_template(squat, 0b101, 1, 3)
    expected = np.ones((4, 3))
    expected[1:3, [0, 2]] = UNDECIDED
    np.testing.assert_array_equal(masked.matrix, expected)
    assert (masked.tau, masked.positive_cost, masked.background_cost) == (None, None, None)
    assert masked.spread == ()
    assert masked.keyframes == (0, 1, 3)
    np.testing.assert_array_equal(squat.matrix, np.ones((4, 3)))


def test_a_keyframe_without_decided_entries_is_none():
    squat = template(np.ones((4, 3)), keyframes=(0, 1, 3))
    assert mask_template(squat, 0b111, 1, 2).keyframes == (0, 3)


@given(st.integers(0, 1000), st.integers(1, (1 << 39) - 1))
def test_masked_features_have_no_say_in_a_match(seed, mask):
    random = np.random.default_rng(seed)
    features = random.random((30, 39)) < 0.5
    other = features.copy()
    chosen = [bit for bit in range(39) if mask >> bit & 1]
    other[:, chosen] = random.random((30, len(chosen))) < 0.5
    masked = mask_template(random_template(seed), mask)
    np.testing.assert_array_equal(
        distance_function(masked, pack_words(features)),
        distance_function(masked, pack_words(other)),
    )


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ((0.5, 1, 0, 5), "frames 0 to 4, not 0 to 5"),
        ((0.5, 1, 2, 2), "not 2 to 2"),
        ((0.5, 1, -1, 2), "not -1 to 2"),
        ((0.5, 0), "mask"),
        ((0.5, 8), "mask of some of 3 features"),
        ((1.5, 1), "between 0 and 1"),
        ((float("nan"), 1), "between 0 and 1"),
    ],
)
def test_blocks_outside_of_the_template_are_refused(arguments, complaint):
    with pytest.raises(ParameterError, match=complaint):
        set_entries(template(np.ones((4, 3))), *arguments)


def test_sweeping_with_a_hand_brush_needs_no_training():
    # The paper: 50 columns, F13, F32 and F33 one, all other entries 0.5.
    sweeping = new_template("sweep", 50, 39, F39.digest, 30.0)
    sweeping = set_entries(sweeping, 1.0, F39.select("F13,F32,F33"))
    assert sweeping.matrix.shape == (50, 39)
    features = np.random.default_rng(1).random((120, 39)) < 0.5
    features[:, [12, 31, 32]] = False
    features[40:90, [12, 31, 32]] = True
    costs = distance_function(sweeping, pack_words(features), padded=False)
    assert costs[89] == 0
    assert costs[39] == 1
    assert (costs[:60] > 0).all()


def test_a_new_template_has_a_length():
    with pytest.raises(ParameterError, match="frames"):
        new_template("x", 0, 39, "d", 30.0)


def test_subtracting_leaves_what_separates_the_classes():
    throwing = template([[1, 1, 0, 0.5], [1, 0, 0, 0]], "throw", **MEASURED)
    grabbing = template([[1, 0, 0.5, 0], [1, 0, 1, 1]], "grab")
    left = subtract_templates(throwing, [grabbing])
    np.testing.assert_array_equal(left.matrix, [[0.5, 1, 0, 0.5], [0.5, 0.5, 0, 0]])
    assert left.label == "throw"
    assert left.tau is None


def test_subtracting_several_keeps_what_separates_from_one_of_them():
    first = template([[1, 1, 1]] * 3)
    others = [template([[1, 1, 0]] * 3), template([[1, 0, 0]] * 5)]
    np.testing.assert_array_equal(subtract_templates(first, others).matrix, [[0.5, 1, 1]] * 3)


def test_subtracting_a_template_from_itself_leaves_nothing_and_is_refused():
    one = random_template(0)
    with pytest.raises(ParameterError, match="nothing would be left"):
        subtract_templates(one, [one])
    with pytest.raises(ParameterError, match="same feature set"):
        subtract_templates(one, [])


def test_keyframes_are_sorted_and_must_say_something():
    squat = mask_template(template(np.ones((6, 3))), 0b111, 2, 3)
    assert with_keyframes(squat, [5, 1], 2).keyframes == (1, 5)
    assert with_keyframes(squat, [5, 1], 2).keyframe_tolerance == 2
    with pytest.raises(ParameterError, match="nothing is decided in frame 2"):
        with_keyframes(squat, [2])
    with pytest.raises(ParameterError, match="keyframes must be different"):
        with_keyframes(squat, [1, 1])
    with pytest.raises(ParameterError, match="from 0 to 5"):
        with_keyframes(squat, [6])


def test_entries_are_decided_as_in_a_match():
    ones, zeros = decided_entries(np.array([[0.0, 0.05, 0.1, 0.5, 0.9, 0.95, 1.0]]), 0.1)
    np.testing.assert_array_equal(ones, [[0, 0, 0, 0, 0, 1, 1]])
    np.testing.assert_array_equal(zeros, [[1, 1, 0, 0, 0, 0, 0]])
