"""Feature sets as TOML: what a good one says, and what a bad one is told."""

import os
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import FeatureSetError, ParameterError
from mocapidx.features.featureset import load_feature_set, parse_feature_set, shipped_sets

HEADER = 'name = "own"\nsource = "nobody"\n'
HAND = """
[[feature]]
id = "hand"
name = "right hand above neck"
part = "upper"
kind = "nplane"
joints = ["chest", "neck", "neck", "rwrist"]
unit = "hl"
on = 0.2
off = 0
"""
OTHER_HAND = """
[[feature]]
id = "other"
mirror_of = "hand"
"""
SPINE = """
[[feature]]
id = "spine"
part = "mix"
kind = "tilt"
joints = ["neck", "root"]
unit = "deg"
on = [70, 110]
off = [60, 120]
"""
GOOD = HEADER + HAND + OTHER_HAND + SPINE


def table(**keys):
    """A feature table of raw TOML values."""
    return "\n[[feature]]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items())


def fails(text, *words):
    with pytest.raises(FeatureSetError) as caught:
        parse_feature_set(text, "own.toml")
    message = str(caught.value)
    assert message.startswith("own.toml: ")
    assert "\n" not in message
    for word in words:
        assert word in message, message
    return message


@pytest.mark.parametrize("name", shipped_sets())
def test_shipped_sets_are_found_by_name_and_their_mirrors_are_pairs(name):
    features = load_feature_set(name)
    assert features.name == name
    np.testing.assert_array_equal(features.mirror[features.mirror], np.arange(len(features.ids)))
    for feature, partner in zip(features.features, features.mirror, strict=True):
        words = feature.name.replace("right", "?").replace("left", "right").replace("?", "left")
        assert features.features[partner].name == words or feature.mirror == feature.id


def test_f39_has_14_upper_12_lower_and_13_mixed_features():
    f39 = load_feature_set("f39")
    assert f39.ids == tuple(f"F{i}" for i in range(1, 40))
    assert f39.part_mask("upper") == (1 << 14) - 1
    assert f39.part_mask("lower") == ((1 << 12) - 1) << 14
    assert f39.part_mask("mix") == ((1 << 13) - 1) << 26
    pairs = ["1", "3", "5", "7", "11", "13", "15", "17", "20", "25", "27", "29", "33", "35"]
    expected = {f"F{i}": f"F{i}" for i in range(1, 40)}
    for right in map(int, pairs):
        expected |= {f"F{right}": f"F{right + 1}", f"F{right + 1}": f"F{right}"}
    assert {feature.id: feature.mirror for feature in f39.features} == expected


def test_the_digest_of_f39_is_that_of_released_stores():
    digest = "84c0ce512e6e107e340108b56593d4b9a460541559b4cd78274901b7e1711507"
    assert load_feature_set("f39").digest == digest


def test_a_set_of_ones_own_is_read_from_a_file(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(GOOD)
    own = load_feature_set(path)
    assert own.ids == ("hand", "other", "spine")
    assert own.mirror.tolist() == [1, 0, 2]
    assert own.text == GOOD
    assert own == load_feature_set(str(path)) == load_feature_set(own)


def test_the_digest_tells_sets_apart_by_what_decides_the_bits():
    digest = parse_feature_set(GOOD).digest
    assert re.fullmatch("[0-9a-f]{64}", digest)
    spelled_out = """
[[feature]]
id = "other"
part = "upper"
mirror = "hand"
kind = "nplane"
joints = ["chest", "neck", "neck", "lwrist"]
unit = "hl"
on = 0.2
off = 0.0
"""
    same = (
        "# a remark\n" + GOOD.replace("\n", "\r\n"),
        GOOD.replace("nobody", "somebody").replace("right hand above neck", "hand up"),
        HEADER + HAND + 'mirror = "other"\n' + spelled_out + SPINE,
    )
    assert [parse_feature_set(text).digest for text in same] == [digest] * 3
    other = (
        GOOD.replace("0.2", "0.25"),
        GOOD.replace('"upper"', '"mix"'),
        GOOD.replace('id = "spine"', 'id = "back"'),
        HEADER + SPINE + HAND + OTHER_HAND,
    )
    assert len({digest, *(parse_feature_set(text).digest for text in other)}) == 5


@pytest.mark.parametrize(
    ("expression", "bits"),
    [
        ("hand", 0b001),
        ("OTHER , spine", 0b110),
        ("upper", 0b011),
        ("mix,hand", 0b101),
        ("all", 0b111),
        ("lower", 0),
        ("Right hand above neck", 0b001),
    ],
)
def test_a_selection_names_ids_names_parts_or_all(expression, bits):
    assert parse_feature_set(GOOD).select(expression) == bits


@pytest.mark.parametrize("expression", ["", "F1", "hand,", "hand;other"])
def test_a_selection_of_nothing_known_is_told_what_there_is(expression):
    with pytest.raises(ParameterError, match=r"names no feature of the set own; expected"):
        parse_feature_set(GOOD).select(expression)


def test_an_unknown_part_is_named():
    with pytest.raises(ParameterError, match="no part 'middle'"):
        parse_feature_set(GOOD).part_mask("middle")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("on = 0.2", "on = 0.2\nhysteresis = 1", "unknown key 'hysteresis'; expected id, name"),
        ('"rwrist"', '"rhand"', "key 'joints': 'rhand' is no joint"),
        ('"rwrist"', '"rwrist", "root"', "nplane needs 4 joints"),
        ('"rwrist"', '["rwrist", "relbow"]', "is no joint"),
        ('"rwrist"', '"neck"', "different joints in the places 3 and 4, found 'neck'"),
        ('joints = ["chest", "neck", "neck", "rwrist"]', "", "key 'joints': missing"),
        ('"nplane"', '"nplan"', "key 'kind': found 'nplan', expected plane, plane_gap, nplane"),
        ('kind = "nplane"', "", "key 'kind': missing"),
        ('part = "upper"', "", "key 'part': missing, expected upper, lower or mix"),
        ('"upper"', '"middle"', "key 'part': found 'middle'"),
        ('"hl"', '"hl/s"', "key 'unit': found 'hl/s', nplane has hl, sw, hw or m"),
        ('unit = "hl"', "", "key 'unit': missing"),
        ("on = 0.2", "on = -0.2", "key 'off': with when = 'above', off (0) must be not above on"),
        ("off = 0", 'off = 0\nwhen = "below"', "off (0) must be not below on (0.2)"),
        ("off = 0", 'off = 0\nwhen = "beyond"', "key 'when': found 'beyond'"),
        ("off = 0", "", "key 'off': missing, expected a number or a range"),
        ("on = 0.2", "on = nan", "key 'on': found nan"),
        ("on = 0.2", "on = 1e999", "key 'on': found inf"),
        ("on = 0.2", "on = true", "key 'on': found True"),
        ("on = 0.2", "on = [0.2, 1]", "two numbers or two ranges"),
        ("on = 0.2", "on = [0.2]", "a range has two numbers"),
        ("on = 0.2", 'on = "0.2"', "key 'on': found '0.2'"),
        ('name = "right hand above neck"', 'name = "a\\nb"', "expected one line of text"),
        ('name = "right hand above neck"', 'name = ""', "expected one line of text"),
        ('part = "upper"', 'part = "upper"\nmirror = "foot"', "there is no feature 'foot'"),
        ('part = "upper"', 'part = "upper"\nof = ["x"]', "unknown key 'of'"),
        ('part = "upper"', 'part = "upper"\nmirror = "hand"', "hand is not this feature"),
    ],
)
def test_a_wrong_key_is_one_line_with_file_feature_and_key(old, new, words):
    assert old in HAND
    fails(HEADER + HAND.replace(old, new), "feature hand: ", words)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "key 'name': missing"),
        ('name = "own"', "key 'source': missing"),
        (HEADER, "one [[feature]] table for each feature"),
        (HEADER + 'feature = "F1"', "one [[feature]] table for each feature"),
        (HEADER + "feature = [1]", "feature number 1: expected a [[feature]] table"),
        (HEADER + "colour = 1\n" + HAND, "unknown key 'colour'"),
        (HEADER + table(part='"upper"'), "feature number 1: key 'id': missing"),
        (HEADER + table(id='"a b"'), "key 'id': found 'a b', expected a letter"),
        (HEADER + table(id='"upper"'), "has a meaning of its own in selections"),
        (HEADER + HAND + HAND, "feature hand: key 'id': stands twice"),
        (HEADER + HAND + SPINE, "feature hand: key 'mirror': missing"),
        (HEADER + OTHER_HAND + HAND, "feature other: key 'mirror_of': no feature 'hand' stands"),
        (GOOD + OTHER_HAND.replace('"other"', '"third"'), "is the mirror of other already"),
        (HEADER + HAND + OTHER_HAND + "on = 1\n", "feature other: unknown key 'on'"),
        (HEADER + SPINE.replace("[60, 120]", "[80, 120]"), "must contain the range [70.0, 110.0]"),
        (HEADER + SPINE + 'when = "above"\n', "feature spine: key 'when': a range has no sides"),
        (GOOD.replace("[", "", 1), "is not TOML"),
        (GOOD + "x = \x00", "is not TOML"),
    ],
)
def test_a_wrong_set_is_one_line(text, words):
    fails(text, words)


def test_mirrors_that_contradict_each_other_are_named():
    third = OTHER_HAND.replace('"other"', '"third"').replace("mirror_of", "mirror")
    third += HAND.split("name", 1)[1].split("\n", 1)[1].replace("rwrist", "lwrist")
    text = HEADER + HAND + OTHER_HAND + third
    fails(text, "feature third: key 'mirror': is hand, whose own mirror is other")


def test_more_features_than_a_word_or_a_part_holds_are_refused():
    def many(count, part):
        return "".join(
            SPINE.replace('"spine"', f'"S{i}"').replace("mix", part(i)) for i in range(count)
        )

    fails(HEADER + many(65, lambda i: "mix"), "has 65 features; a set has at most 64")
    fails(HEADER + many(32, lambda i: "mix"), "feature S31", "'mix' has more than 31 features")
    full = parse_feature_set(HEADER + many(62, lambda i: ("mix", "lower")[i % 2]))
    assert full.part_mask("mix").bit_count() == 31


COMBINED = """
[[feature]]
id = "either"
part = "upper"
kind = "any_of"
of = [
    "hand",
    { kind = "not", of = ["other"] },
    { kind = "touch", joints = ["rwrist", ["lknee", "lhip"]], unit = "m", on = 0.1, off = 0.2 },
]
[[feature]]
id = "either_left"
mirror_of = "either"
"""


def test_combinations_take_conditions_and_features_that_stand_before():
    own = parse_feature_set(GOOD + COMBINED)
    either, left = (feature.condition for feature in own.features[3:])
    assert either.of[0] == own.features[0].condition
    assert either.of[1].of == (own.features[1].condition,)
    assert (either.of[2].when, either.of[2].on) == ("below", 0.1)
    assert left.of[0] == own.features[1].condition
    assert left.of[2].joints == ("lwrist", ("rknee", "rhip"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"hand",', '"foot",', "condition 1 of 'any_of': no feature 'foot' stands before"),
        ('"hand",', "7,", "expected a table or the id of a feature, found 7"),
        ('"other"', '"other", "hand"', "key 'of': 'not' has one condition, found 2"),
        ('"m"', '"deg"', "condition 3 of 'any_of': key 'unit': found 'deg', touch has"),
        ('["lknee", "lhip"]', '["lknee"]', "a segment has two joints"),
        ('["lknee", "lhip"]', '["lknee", "lknee"]', "found 'lknee' twice"),
        ('["lknee", "lhip"]', '["lknee", "rwrist"]', "found 'rwrist' in both"),
        ('["lknee", "lhip"]', '["lknee", ["lhip"]]', "a segment has two joints"),
        ("touch", "any_of", "unknown key 'joints'; expected kind or of"),
        ('kind = "any_of"', 'kind = "any_of"\non = 1', "unknown key 'on'; expected kind or of"),
    ],
)
def test_a_wrong_combination_is_one_line_that_names_the_condition(old, new, words):
    assert old in COMBINED
    fails(GOOD + COMBINED.replace(old, new, 1), "feature either: ", words)


def test_a_few_lines_cant_grow_into_millions_of_conditions():
    text = (
        HEADER
        + SPINE
        + "".join(
            table(id=f'"X{i}"', part='"mix"', kind='"all_of"', of=f'["{before}", "{before}"]')
            for i, before in enumerate(["spine", *(f"X{i}" for i in range(60))])
            if i < 31
        )
    )
    fails(text, "feature X6: key 'of': more than 64 conditions in all")


@pytest.mark.parametrize(
    "text",
    [
        HEADER + "x = " + "[\n" * 100_000,
        HEADER + "x = " + "{a=" * 600,
        HEADER + "\n".join(".".join(["a"] * 900) + " = 1" for _ in range(500)),
        HEADER + "a." * 200_000 + "b = 1",
        HEADER + f"x = {'9' * 5_000}",
        HEADER + f"x = 0x{'f' * 1_900}",
        HEADER + "x = 1\n" * 200_000,
        HEADER + "#" * (1 << 20),
        HEADER + "[[feature]]\n" * 80_000,
        HEADER + "[a.b.c]\n" * 10,
    ],
    ids=lambda text: text[len(HEADER) :][:12],
)
def test_hostile_text_is_refused_at_once_with_one_line(text):
    assert len(fails(text)) < 500


@given(st.text(max_size=200))
@settings(max_examples=200, deadline=None)
def test_any_text_is_read_or_refused(text):
    for whole in (text, HEADER + text, GOOD + text, HEADER + HAND.replace("neck", text)):
        message = ""
        try:
            parse_feature_set(whole, "own.toml")
        except FeatureSetError as refusal:
            message = str(refusal)
        assert "\n" not in message


@pytest.mark.parametrize("name", ["f40", "no/such.toml", "", ".", "a\0b"])
def test_what_is_neither_a_set_nor_a_file_is_told_so(name):
    with pytest.raises(FeatureSetError, match="; shipped sets are f31, f39"):
        load_feature_set(name)


def test_files_that_are_no_small_text_are_refused(tmp_path):
    path = tmp_path / "own.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(FeatureSetError, match="not UTF-8 text at byte 0"):
        load_feature_set(path)
    path.write_bytes(b"#" * ((1 << 20) + 1))
    with pytest.raises(FeatureSetError, match="larger than 1 MiB"):
        load_feature_set(path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FeatureSetError, match="is no plain file"):
        load_feature_set(tmp_path / "pipe")


def test_a_byte_order_mark_is_passed_over(tmp_path):
    path = tmp_path / "own.toml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.encode())
    assert load_feature_set(path).digest == parse_feature_set(GOOD).digest
