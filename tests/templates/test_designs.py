import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.errors import FormatError
from mocapidx.features.featureset import load_feature_set
from mocapidx.templates.designs import apply_design, parse_designs
from mocapidx.templates.template import MotionTemplate, TemplateSet

F39 = load_feature_set("f39")


def squats(**changes):
    squat = MotionTemplate("squat", np.ones((60, 39)), F39.digest, 30.0, tau=0.04, **changes)
    return TemplateSet((squat,), F39.name, F39.digest, F39.text, 30.0)


def made(text, templates=None):
    """Apply the designs of a text one after the other; the templates of the last one."""
    for design in parse_designs(text, "d.toml").designs:
        found = apply_design(design, templates or squats(), F39)
    return found


def test_sweeping_with_a_hand_brush_from_toml():
    (sweep,) = made(
        """
        [[template]]
        class = "sweep"
        frames = 50

        [[template.set]]
        features = "F13,F32,F33"
        value = 1
        """
    )
    expected = np.full((50, 39), 0.5)
    expected[:, [12, 31, 32]] = 1
    np.testing.assert_array_equal(sweep.matrix, expected)
    assert (sweep.label, sweep.tau, sweep.documents) == ("sweep", None, ())


def test_blocks_by_frames_and_by_seconds_the_later_one_wins():
    (squat,) = made(
        """
        [[template]]
        class = "squat"
        as = "squat with any arms"
        delta = 0.2
        tau = 0.08
        keyframes = [40, 5]
        keyframe_tolerance = 2

        [[template.set]]
        features = "upper"
        value = "undecided"

        [[template.set]]
        features = "F1"
        frames = [0, 10]
        value = 0

        [[template.set]]
        features = "F1,F2"
        seconds = [0.1, 0.2]
        value = 0.75
        """
    )
    assert (squat.label, squat.delta, squat.tau) == ("squat with any arms", 0.2, 0.08)
    assert (squat.keyframes, squat.keyframe_tolerance) == ((5, 40), 2)
    expected = np.ones((60, 39))
    expected[:, :14] = 0.5
    expected[:10, 0] = 0
    expected[3:6, :2] = 0.75
    np.testing.assert_array_equal(squat.matrix, expected)


def test_a_changed_template_loses_its_threshold_an_untouched_one_keeps_it():
    entries = '[[template.set]]\nfeatures = "F1"\nvalue = 0'
    assert made(f'[[template]]\nclass = "squat"\n{entries}')[0].tau is None
    assert made('[[template]]\nclass = "squat"\ndelta = 0.2')[0].tau is None
    assert made('[[template]]\nclass = "squat"\nkeyframes = [1]')[0].tau == 0.04


def test_a_class_is_changed_with_its_stretch_templates():
    one = squats().templates[0]
    stretch = MotionTemplate("squat", np.ones((90, 39)), F39.digest, 30.0, kind="stretch")
    both = TemplateSet((one, stretch), F39.name, F39.digest, F39.text, 30.0)
    text = '[[template]]\nclass = "squat"\n[[template.set]]\nfeatures = "F1"\nvalue = 0'
    changed = made(text, both)
    assert [len(each.matrix) for each in changed] == [60, 90]
    assert all((each.matrix[:, 0] == 0).all() for each in changed)


HEAD = '[[template]]\nclass = "squat"\n'
SET = HEAD + "[[template.set]]\n"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", r"no \[\[template\]\] table"),
        ("x = ", "is not TOML"),
        ("a = 1\n[[template]]\nclass = 'x'", "unknown key 'a'; expected feature_set, rate"),
        ("template = 3", r"expected \[\[template\]\] tables"),
        ("[[template]]\nframes = 3", "template number 1: key 'class' is missing"),
        (HEAD + "frames = 0", "key 'frames': expected a whole number from 1 to 4096"),
        (HEAD + "frames = 1e3", "key 'frames': expected a whole number"),
        (HEAD + "tau = nan", "key 'tau': expected a number from 0 to 1"),
        (HEAD + "delta = true", "key 'delta': expected a number"),
        (HEAD + "keyframes = [1.5]", "key 'keyframes': expected a list of frames"),
        (SET + "features = 'F1'", "set number 1: key 'value' is missing"),
        (SET + "value = 1", "key 'features' is missing"),
        (SET + "features = 'F1'\nvalue = 'maybe'", "key 'value': expected a number from 0 to 1"),
        (SET + "features = 'F1'\nvalue = 1\nframes = [3]", "two rising numbers"),
        (SET + "features = 'F1'\nvalue = 1\nframes = [3, 3]", "two rising numbers"),
        (SET + "features = 'F1'\nvalue = 1\nframes = [-1, 3]", "two rising numbers"),
        (SET + "features = 'F1'\nvalue = 1\nframes = [0.5, 3]", "expected whole numbers"),
        (SET + "features = 'F1'\nvalue = 1\nseconds = [0, inf]", "two rising numbers"),
        (SET + "features = 'F1'\nvalue = 1\nseconds=[0,1]\nframes=[0,1]", "both 'frames' and"),
        ("a" * 3000, "d.toml: line 1 is longer than 2000 characters"),
        ("x\n" * (1 << 20), "larger than 1 MiB"),
        ("x = " + "[" * 1900, "(?:nested too deeply|not TOML)"),
    ],
)
def test_a_wrong_file_is_told_by_place_and_key(text, complaint):
    with pytest.raises(FormatError, match=complaint) as caught:
        parse_designs(text, "d.toml")
    assert str(caught.value).startswith("d.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[[template]]\nclass = 'jump'", "no template of a class 'jump'; there are: squat"),
        (SET + "features = 'F77'\nvalue = 1", "'F77' names no feature"),
        (SET + "features = 'F1'\nvalue = 1\nframes = [50, 61]", "frames 0 to 60, not 50 to 61"),
        (HEAD + "keyframes = [60]", "from 0 to 59"),
        (HEAD + "delta = 0.5", "delta must lie between 0 and 0.5"),
    ],
)
def test_what_does_not_fit_the_templates_is_told_by_place(text, complaint):
    with pytest.raises(FormatError, match=complaint) as caught:
        made(text)
    assert str(caught.value).startswith("d.toml: template number 1: ")


@given(st.text(max_size=60))
def test_no_text_breaks_the_reader(text):
    with contextlib.suppress(FormatError):
        parse_designs(text, "d.toml")
