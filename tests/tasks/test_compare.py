import pytest

from mocapidx.errors import FormatError, ParameterError, StoreError
from mocapidx.tasks.compare import COMPARE_COLUMNS, METHODS, compare_methods
from mocapidx.tasks.labels import LabelFile, labels_from_names
from mocapidx.tasks.records import render_records
from tests.made_words import make_word_store
from tests.tasks.test_learn import clips

NAMES = [
    f"clips/{label}/{actor}_{label}_00{number}_120.amc"
    for label in ("squat", "punchLeft", "kickFrontLeft")
    for actor in ("ann", "dov")
    for number in (1, 2)
]
BY_ACTOR = r"/(?P<label>\w+)/(?P<group>[a-z]+)_"


@pytest.fixture(scope="module")
def compared(fixtures_store):
    return compare_methods(fixtures_store, labels_from_names(NAMES, BY_ACTOR))


def test_every_class_is_searched_by_every_method(compared):
    classes = ("squat", "punchLeft", "kickFrontLeft", "all")
    assert [(r["class"], r["method"]) for r in compared] == [
        (label, method) for label in classes for method in METHODS
    ]
    assert all(r["labels"] == 4 for r in compared[:-4])
    assert all(r["labels"] == 12 for r in compared[-4:])


def test_templates_find_clips_of_unseen_people_and_separate_them_best(compared):
    (templates, *others) = compared[-4:]
    assert templates["average_precision"] > 0.95
    assert templates["found_top_5"] == 12
    assert all(templates["separation"] > other["separation"] for other in others)


def test_processes_find_the_same(fixtures_store, compared):
    labels = labels_from_names(NAMES, BY_ACTOR)
    assert compare_methods(fixtures_store, labels, jobs=2) == compared


def test_clips_without_groups_are_divided_one_by_one(fixtures_store):
    seen = []
    labels = labels_from_names(NAMES, r"/(?P<label>\w+)/")
    records = compare_methods(
        fixtures_store, labels, classes=["squat"], progress=lambda *done: seen.append(done)
    )
    assert seen[-1] == (5, 5)
    assert records[0]["labels"] == 4
    assert all(isinstance(line, str) for line in render_records(records, "csv", COMPARE_COLUMNS))


def test_what_can_not_be_compared_is_refused(fixtures_store, tmp_path):
    labels = labels_from_names(NAMES, BY_ACTOR)
    with pytest.raises(ParameterError, match="no label says 'jump'"):
        compare_methods(fixtures_store, labels, classes=["jump"])
    one = LabelFile(tuple(label for label in labels.labels if label.group == "ann"))
    with pytest.raises(ParameterError, match="all labels are of one group"):
        compare_methods(fixtures_store, one)
    with pytest.raises(FormatError, match="no document 'none/x'"):
        compare_methods(fixtures_store, labels_from_names(["none/x"], "folder"))


def test_a_store_without_poses_is_refused(tmp_path):
    store = make_word_store(tmp_path / "s.store", clips(2))
    with pytest.raises(StoreError, match="--no-poses"):
        compare_methods(store, labels_from_names(clips(2), "folder"))
