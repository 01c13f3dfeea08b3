import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.features.learn import learn_thresholds


def examples(*stretches):
    """One document: each stretch a kind and its values."""
    kinds = [kind for kind, own in stretches for _ in own]
    return np.array([v for _, own in stretches for v in own], float), np.array(kinds, np.int8)


def learned(*documents):
    values, wanted = zip(*documents, strict=True)
    return learn_thresholds(values, wanted)


def naive_best(above, below):
    """The most frames right, as a mean of both shares, over every threshold there is."""
    values = sorted({*above, *below})
    candidates = [values[0] - 1, *values]
    return max(
        (sum(v > t for v in above) / len(above) + sum(v <= t for v in below) / len(below)) / 2
        for t in candidates
    )


def test_separate_examples_are_told_apart_with_room_on_both_sides():
    found = learned(examples((1, [5, 6, 7]), (0, [4] * 3), (-1, [1, 2, 3])))
    assert found.threshold == 4
    assert 3 <= found.off < 4 < found.on < 5
    assert (found.right, found.single_right, found.area, found.changes) == (1, 1, 1, 0)


def test_two_thresholds_calm_a_value_that_trembles_around_one():
    rng = np.random.default_rng(0)
    high, low = 1 + rng.normal(0, 0.6, 300), -1 + rng.normal(0, 0.6, 300)
    found = learned(examples((1, high), (-1, low)))
    assert found.changes < found.single_changes
    assert found.right >= found.single_right - 0.01
    assert found.off < found.threshold < found.on


finite = st.integers(-8, 8)
some = st.lists(finite, min_size=1, max_size=20)


@given(some, some)
def test_no_single_threshold_is_right_more_often(above, below):
    found = learned(examples((1, above), (-1, below)))
    best = naive_best(above, below)
    # A threshold beyond all values decides nothing; it is never taken.
    assert found.single_right == pytest.approx(best) or best == 0.5


@given(some, some)
def test_the_area_is_how_often_a_positive_value_is_above_a_negative_one(above, below):
    found = learned(examples((1, above), (-1, below)))
    pairs = [(a > b) + 0.5 * (a == b) for a in above for b in below]
    assert found.area == pytest.approx(np.mean(pairs))


@given(some, some)
def test_the_shares_are_those_of_the_feature_that_the_thresholds_make(above, below):
    found = learned(examples((1, above), (0, [0, 0]), (-1, below)))
    state, on = False, []
    for value in [*above, 0, 0, *below]:
        state = True if value > found.on else (False if value <= found.off else state)
        on.append(state)
    assert found.positive_on == pytest.approx(np.mean(on[: len(above)]))
    assert found.negative_off == pytest.approx(1 - np.mean(on[-len(below) :]))


def test_both_kinds_weigh_the_same_however_many_frames_they_have():
    found = learned(examples((1, [3.0]), (-1, [1.0] * 1000)))
    assert (found.threshold, found.right) == (2, 1)


def test_unknown_values_do_not_count():
    found = learned(examples((1, [5, np.nan, 5]), (-1, [1, np.nan])))
    assert found.threshold == 3


@pytest.mark.parametrize(("kind", "named"), [(1, "negative"), (-1, "positive")])
def test_examples_of_both_kinds_are_needed(kind, named):
    with pytest.raises(ParameterError, match=f"no {named} example"):
        learned(examples((kind, [1, 2]), (-kind, [np.nan])))
