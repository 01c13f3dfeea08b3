"""What people write, and what it means."""

import json
import math
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import FormatError, MocapidxError, ParameterError
from mocapidx.features.featureset import load_feature_set
from mocapidx.queries.files import (
    parse_pattern,
    parse_scene,
    read_query_text,
    shipped_scenes,
)
from mocapidx.queries.language import (
    Step,
    describe,
    parse_short,
    parse_step,
    pattern_from_steps,
)
from mocapidx.queries.pattern import UNLIMITED
from mocapidx.queries.scene import Condition, Place
from mocapidx.queries.steps import FuzzySet

F39 = load_feature_set("f39")


def bit(identifier):
    return 1 << F39.ids.index(identifier)


KNEE, FOOT = bit("F20"), bit("F17")
BENT = FuzzySet(((KNEE, KNEE),))


@pytest.mark.parametrize(
    ("text", "cubes"),
    [
        ("right knee bent", [(KNEE, KNEE)]),
        ("F20 = 1", [(KNEE, KNEE)]),
        ("f20=0", [(KNEE, 0)]),
        ("not Right  Knee Bent", [(KNEE, 0)]),
        ("not F20 = 0", [(KNEE, KNEE)]),
        ("F20, not F17", [(KNEE | FOOT, KNEE)]),
        ("F20 | not right foot raised", [(KNEE, KNEE), (FOOT, 0)]),
    ],
)
def test_steps_in_words_of_the_body(text, cubes):
    assert parse_step(text, F39) == FuzzySet(tuple(cubes))


def test_a_star_leaves_everything_open():
    assert parse_step(" * ", F39) is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("right knee bend", "is 'right knee bent' meant"),
        ("", "is no id or name"),
        ("F20,", "is no id or name"),
        ("lower", "is no id or name"),
        ("F20 = 2", "= 0 or = 1"),
        ("F20, not F20", "to be 0 and 1"),
    ],
)
def test_what_can_not_be_meant_is_refused_with_advice(text, says):
    with pytest.raises(ParameterError, match=says):
        parse_step(text, F39)


def test_the_short_form():
    steps = parse_short("F20, right foot raised", "00 1x@0.2:1.5 01|10@:2 *@1: xx 11", F39)
    assert steps == [
        Step(FuzzySet(((KNEE | FOOT, 0),))),
        Step(BENT, 0.2, 1.5),
        Step(FuzzySet(((KNEE | FOOT, FOOT), (KNEE | FOOT, KNEE))), 0.0, 2.0),
        Step(None, 1.0, math.inf),
        Step(None),
        Step(FuzzySet(((KNEE | FOOT, KNEE | FOOT),))),
    ]


def test_repetitions_are_written_out_the_inner_ones_first():
    words = [step.demand for step in parse_short("F20", "2x(0 2x(1 0)) 1", F39)]
    expected = [step.demand for step in parse_short("F20", "0 1 0 1 0 0 1 0 1 0 1", F39)]
    assert words == expected


@pytest.mark.parametrize(
    ("features", "text", "says"),
    [
        ("F20", "", "needs a step"),
        ("F20", "00", "2 digits for 1 feature"),
        ("F20,F20", "00", "twice"),
        ("F20", "2", "is no step"),
        ("F20", "1@2:1", "at least 2 s but at most 1 s"),
        ("F20", "1@1.2.3:", "seconds such as"),
        ("F20", "0x(1)", "repeats"),
        ("F20", "1000x(1000x(1))", "repeats"),
        ("F20", "3x(1 0", "is no step"),
        ("F99", "0", "is no id or name"),
    ],
)
def test_odd_short_forms_are_refused(features, text, says):
    with pytest.raises(ParameterError, match=says):
        parse_short(features, text, F39)


def test_open_steps_are_gaps_and_seconds_are_frames():
    steps = parse_short("F20", "* 0 1@0.1:0.2 *@0.5:1 *@0:1 0 *", F39)
    pattern = pattern_from_steps(steps, 30.0)
    assert [len(block.query.steps) for block in pattern.blocks] == [2, 1]
    assert pattern.gaps == ((15, 60),)
    assert pattern.blocks[0].shortest.tolist() == [0, 3]
    assert pattern.blocks[0].longest.tolist() == [UNLIMITED, 6]


@pytest.mark.parametrize(
    ("text", "says"), [("* *", "every step is open"), ("*@1: 0", "can't have a duration")]
)
def test_patterns_that_say_nothing_are_refused(text, says):
    with pytest.raises(ParameterError, match=says):
        pattern_from_steps(parse_short("F20", text, F39), 30.0)


def test_a_pattern_file():
    name, pattern = parse_pattern(
        """
        name = "three squats"
        steps = [
            "not right knee bent, not left knee bent",
            { times = 3, steps = [
                { is = "right knee bent, left knee bent", min = 0.3 },
                { is = "not right knee bent, not left knee bent", max = 2 },
            ] },
            "*",
            "F37",
        ]
        """,
        F39,
        30.0,
    )
    assert name == "three squats"
    assert [len(block.query.steps) for block in pattern.blocks] == [7, 1]
    assert pattern.blocks[0].shortest.tolist() == [0, 9, 0, 9, 0, 9, 0]
    assert pattern.blocks[0].longest.tolist()[1:3] == [UNLIMITED, 60]
    assert pattern.gaps == ((0, UNLIMITED),)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("steps = [", "not TOML"),
        ("steps = []", "a pattern needs a step"),
        ("step = []", "'step' is no key here"),
        ("steps = [1]", "step 1: must be text or a table"),
        ("steps = ['F20', 'F99']", "step 2: 'F99' is no id"),
        ("steps = [{ is = 'F20', min = 'a' }]", "step 1: 'min' must be seconds"),
        ("steps = [{ is = 'F20', min = nan }]", "'min' must be seconds"),
        ("steps = [{ is = 'F20', min = 2, max = 1 }]", "at least 2 s but at most 1 s"),
        ("steps = [{ is = 'F20', most = 2 }]", "'most' is no key here"),
        ("steps = [{ times = 2, steps = ['F20', 'F98'] }]", "step 1: step 2: 'F98'"),
        ("steps = [{ times = 2, steps = [] }]", "needs 'is'"),
        ("steps = [{ times = 1000, steps = ['F20', '*'] }]", "more than 1000 steps"),
        ("steps = '0 1'", "'of' must be text"),
        ("of = 'F20'\nsteps = ['F20']", "needs 'steps'"),
        ("name = 7\nsteps = ['F20']", "'name' must be text"),
    ],
)
def test_odd_pattern_files_are_refused_with_the_place(text, says):
    with pytest.raises(FormatError, match=says) as caught:
        parse_pattern(text, F39, 30.0, "p.toml")
    assert str(caught.value).startswith("p.toml: ")
    assert "\n" not in str(caught.value)


SCENE = """
conditions = [{conditions}]
[progressions.knee]
of = "F20"
steps = "0 1 0"
[progressions.foot]
steps = ["not F17", "F17", "not F17"]
"""


def scene_of(*conditions):
    quoted = ", ".join(f'"{condition}"' for condition in conditions)
    return parse_scene(SCENE.replace("{conditions}", quoted), F39, 30.0, "s.toml")[1]


@pytest.mark.parametrize(
    ("text", "condition"),
    [
        ("knee.2 overlaps foot.2", Condition(Place(0, 1), "overlaps", Place(1, 1))),
        ("knee during foot", Condition(Place(0), "during", Place(1))),
        ("knee before foot.1 within 1.5 s", Condition(Place(0), "before", Place(1, 0), 45)),
        ("knee.3 after foot", Condition(Place(1), "before", Place(0, 2))),
        ("knee near foot within 2s", Condition(Place(0), "near", Place(1), 60)),
    ],
)
def test_conditions_between_stretches(text, condition):
    assert scene_of(text).conditions == (condition,)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("knee touches foot", "must read like"),
        ("knee.2 overlaps hand.1", "'hand.1' is none of the progressions knee, foot"),
        ("knee.9 overlaps foot", "'knee' has 3 steps, no step 9"),
        ("knee.0 overlaps foot", "no step 0"),
        ("knee overlaps foot within 1 s", "takes no 'within'"),
        ("knee near foot", "needs 'within'"),
        ("knee near foot within 1.1.1 s", "no number of seconds"),
    ],
)
def test_odd_conditions_are_refused(text, says):
    with pytest.raises(FormatError, match=says):
        scene_of(text)


def test_a_scene_needs_progressions_that_are_linked():
    with pytest.raises(FormatError, match="no condition links 'foot'"):
        scene_of()
    with pytest.raises(FormatError, match=r"needs tables \[progressions"):
        parse_scene("conditions = []", F39, 30.0)


def test_the_shipped_scenes_can_be_read_for_the_shipped_features():
    assert "kick-then-punch" in shipped_scenes()
    for name in shipped_scenes():
        assert parse_scene(read_query_text(name, shipped=True), F39, 30.0)[0] == name


def test_files_that_can_not_be_read_are_one_line(tmp_path):
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe")
    for path, says in ((tmp_path, "no plain file"), (binary, "not UTF-8")):
        with pytest.raises(FormatError, match=says):
            read_query_text(path)
    with pytest.raises(FormatError, match="shipped are kick-then-punch"):
        read_query_text("kick-then-bunch", shipped=True)


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="01x|*@:.()F20, ", max_size=30))
def test_no_short_form_crashes(text):
    with suppress(MocapidxError):
        steps = parse_short("F20,F17", text, F39)
        pattern_from_steps(steps, 30.0)


@settings(max_examples=100, deadline=None)
@given(st.recursive(st.sampled_from(["F20", "*", 1, None]), lambda x: st.lists(x, max_size=3)))
def test_no_list_of_steps_crashes(items):
    text = f"steps = {json.dumps(items).replace('null', 'true')}"
    with suppress(MocapidxError):
        parse_pattern(text, F39, 30.0)


def test_a_step_is_described_in_the_words_it_is_written_in():
    text = "right foot raised, not right knee bent | left knee bent"
    assert parse_step(describe(parse_step(text, F39), F39), F39) == parse_step(text, F39)
    lower = F39.part_mask("lower")
    assert describe(FuzzySet(((lower, KNEE),)), F39) == "right knee bent, none of 11 others"
    many = FuzzySet(tuple((lower, value) for value in (0, KNEE, FOOT)))
    assert describe(many, F39, 2).endswith("| 1 more")
    assert np.all(many.masks == lower)
