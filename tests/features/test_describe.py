import pytest

from mocapidx.features.describe import common_threshold, formula_text, threshold_text
from mocapidx.features.featureset import load_feature_set


def condition_of(name, key):
    features = load_feature_set(name)
    return features.features[features.ids.index(key)].condition


@pytest.mark.parametrize(
    ("name", "key", "formula", "on", "off"),
    [
        ("f39", "F17", "height(rankle)", "> 1.2", "> 1"),
        ("f39", "F33", "height(rwrist)", "< 1.2", "< 1.4"),
        ("f39", "F32", "tilt(neck, root)", "[70, 110]", "[60, 120]"),
        ("f39", "F25", "all of (fast(rankle), fast(rtoes))", "> 2.5", "> 2"),
        ("f31", "M3", "touch(rwrist, neck-head)", "< 0.9", "< 1.05"),
    ],
)
def test_a_feature_reads_as_in_the_documentation(name, key, formula, on, off):
    condition = condition_of(name, key)
    assert formula_text(condition) == formula
    assert threshold_text(condition, strong=True) == on
    assert threshold_text(condition, strong=False) == off


def test_parts_with_different_thresholds_carry_their_own():
    raised, fast = condition_of("f39", "F17"), condition_of("f39", "F13")
    both = type(raised)(kind="all_of", of=(raised, fast))
    assert formula_text(both) == "all of (height(rankle) > 1.2 hl, fast(rwrist) > 2.5 hl/s)"
    assert threshold_text(both, strong=True) == ""
    assert common_threshold(both) is None


def test_what_is_denied_has_no_threshold_of_its_own():
    denied = type(condition_of("f39", "F17"))(kind="not", of=(condition_of("f39", "F17"),))
    assert common_threshold(denied) is None
    assert formula_text(denied) == "not (height(rankle) > 1.2 hl)"
