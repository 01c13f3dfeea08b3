import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import MocapidxError, ParameterError
from mocapidx.tasks.where import document_facts, meeting, name_facts, name_regex, parse_where
from tests.made_store import make_document

ANN = {"document": "kick/ann_kick_02.amc", "actor": "Ann", "class": "kick", "take": "02"} | {
    "seconds": 1.5
}


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("actor = ann", True),
        ("actor != ann", False),
        ("actor = a*", True),
        ("actor = 'A?N'", True),
        ("actor = a[nm]n", False),
        ("document = kick/*", True),
        ("take = 2", True),
        ("take > 1 and take <= 2", True),
        ("take < 2", False),
        ("seconds >= 1.5", True),
        ("actor < ben", True),
        ("not actor = ann", False),
        ("not (actor = ben or class = walk)", True),
        ("actor = ben or class = kick and take = 2", True),
        ("(actor = ben or class = kick) and take = 3", False),
        ("rate > 1", False),
        ("rate != 1", False),
        ('class = "kick"', True),
    ],
)
def test_conditions_hold_as_they_read(text, holds):
    assert parse_where(text).holds(ANN) == holds


@pytest.mark.parametrize(
    "text", ["", "actor", "actor =", "= ann", "actor = ann and", "(actor = ann", "actor = a b", "'"]
)
def test_odd_conditions_are_refused_with_an_example(text):
    with pytest.raises(ParameterError, match="must read like: actor = ann"):
        parse_where(text)


def test_deep_nesting_is_refused():
    with pytest.raises(ParameterError, match="50 deep"):
        parse_where("(" * 1000 + "a = 1" + ")" * 1000)


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="ab=<>!()'\" *?[]ornotand0.", max_size=40))
def test_no_text_crashes(text):
    try:
        condition = parse_where(text)
    except MocapidxError:
        return
    assert condition.holds(ANN) in (True, False)


def test_documents_that_meet_a_condition_live_ones_only():
    documents = [
        make_document("a.bvh", 60, facts={"actor": "ann"}),
        make_document("b.bvh", 90),
        make_document("c.bvh", 90, facts={"actor": "ann"}, live=False),
    ]
    assert meeting(documents, "actor = ann", 30.0) == [True, False, False]
    assert meeting(documents, "not actor = ann and seconds > 2.5", 30.0) == [False, True, False]
    assert meeting([], "actor = ann", 30.0) == []


def test_a_key_that_no_document_has_is_named_with_those_there_are():
    documents = [make_document("a.bvh", 60, facts={"actor": "ann"})]
    with pytest.raises(ParameterError, match=r"no document has 'actr'; there are .*, actor"):
        meeting(documents, "actr = ann", 30.0)


def test_facts_come_from_names_by_groups():
    regex = name_regex(r"(?P<Actor>[a-z]+)_(?P<class>\w+?)_(?P<take>[0-9]+)(?P<rest>x)?")
    assert name_facts(regex, "a/ann_kick_02.amc") == {"actor": "ann", "class": "kick", "take": "02"}
    assert name_facts(regex, "nothing.amc") == {}
    assert name_facts(None, "a/ann_kick_02.amc") == {}


@pytest.mark.parametrize(
    ("pattern", "says"),
    [
        ("(", "no regular expression"),
        ("[a-z]+", "no named groups"),
        ("(?P<document>a)", "not be called"),
        ("(?P<a>a)(?P<A>b)", "must differ"),
        ("x" * 2000, "2000 characters"),
    ],
)
def test_odd_name_patterns_are_refused(pattern, says):
    with pytest.raises(ParameterError, match=says):
        name_regex(pattern)


def test_what_a_name_tells_goes_before_what_is_measured():
    document = make_document("a.bvh", 60, facts={"rate": "slow"})
    facts = document_facts(document, 30.0)
    assert facts == {"document": "a.bvh", "seconds": 2.0, "frames": 60.0, "rate": "slow"}
