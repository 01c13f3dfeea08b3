"""Queries of every kind over stores of made-up words and of generated motion."""

import json

import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.featureset import load_feature_set
from mocapidx.features.words import pack_words
from mocapidx.store.read import open_store
from mocapidx.tasks.answers import open_archive
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.query import query_store
from mocapidx.tasks.query_example import load_example, mirror_example
from mocapidx.tasks.read import ReadOptions
from tests import naive_queries as naive
from tests.made_words import make_word_store

F39 = load_feature_set("f39")
KNEE, FOOT, OTHER_KNEE, OTHER_FOOT = (F39.ids.index(f) for f in ("F20", "F17", "F21", "F18"))


def made(steps, features=(KNEE, FOOT), frames=3):
    """A document of steps, each a word of digits over some features."""
    bits = np.zeros((len(steps) * frames, 39), dtype=bool)
    for number, word in enumerate(steps):
        for feature, digit in zip(features, word, strict=True):
            bits[number * frames : (number + 1) * frames, feature] = digit == "1"
    return bits


def found(answer):
    return [(hit.document, hit.start_frame, hit.end_frame) for hit in answer.hits]


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    documents = {
        "kick.amc": made(["00", "10", "11", "01", "11", "10", "00"]),
        "other/left.amc": made(
            ["00", "10", "11", "01", "11", "10", "00"], (OTHER_KNEE, OTHER_FOOT)
        ),
        "lame.amc": made(["00", "10", "11", "10", "11", "10", "00"], frames=2),
        "squats.amc": made(["00", "10", "00", "10", "00", "10", "00"], frames=9),
    }
    return make_word_store(tmp_path_factory.mktemp("stores") / "made.store", documents, batches=2)


def test_an_indexed_stretch_is_an_example(store):
    answer = query_store(store, "kick.amc@0.3:0.6", select="F20,F17", mode="adaptive")
    assert found(answer) == [("kick.amc", 9, 18)]
    assert answer.hits[0].label == "kick"


def test_a_mismatch_finds_what_misses_a_step(store):
    example = {"example": "kick.amc", "select": "F20,F17", "mode": "mismatch"}
    exact = query_store(store, **example)
    assert [name for name, _, _ in found(exact)] == ["kick.amc"]
    one = query_store(store, **example, mismatches=1)
    assert [name for name, _, _ in found(one)] == ["kick.amc", "lame.amc"]
    elsewhere = query_store(store, **example, mismatches=1, mismatch_at=[2])
    assert found(elsewhere) == found(exact)
    there = query_store(store, **example, mismatches=1, mismatch_at=[4])
    assert found(there) == found(one)


def test_mismatches_that_can_not_be_are_refused(store):
    for arguments, says in (
        ({"mode": "mismatch", "mismatches": 7}, "7 mismatches of 7 steps"),
        ({"mode": "mismatch", "mismatch_at": [8]}, "no step 8"),
        ({"mode": "exact", "mismatches": 1}, "for the mode mismatch"),
    ):
        with pytest.raises(ParameterError, match=says):
            query_store(store, "kick.amc", select="F20,F17", **arguments)


def test_the_mirrored_query_finds_the_other_side_and_says_so(store):
    answer = query_store(store, "kick.amc", select="F20,F17", mirror=True)
    assert [record["document"] for record in answer.records()] == ["kick.amc", "other/left.amc"]
    assert [record["mirrored"] for record in answer.records()] == [False, True]
    assert list(answer.records()[0])[-1] == "mirrored"


def test_a_query_that_is_its_own_mirror_has_each_hit_once(store):
    plain = query_store(store, steps_of=("F20,F21", "00 10|01 00"))
    both = query_store(store, steps_of=("F20,F21", "00 10|01 00"), mirror=True)
    assert found(plain) == found(both)
    assert not any(record["mirrored"] for record in both.records())


def test_any_of_several_examples_or_all(store):
    examples = ["kick.amc@0:0.8", "squats.amc@0:0.9"]
    any_of = query_store(store, examples, select="F20")
    assert len(found(any_of)) > 1
    one = query_store(store, ["kick.amc", "kick.amc@0.2:0.6"], select="F20,F17", combine="all")
    assert [name for name, _, _ in found(one)] == ["kick.amc"]
    none = query_store(store, ["kick.amc", "squats.amc"], select="F20,F17", combine="all")
    assert found(none) == []


def test_where_keeps_to_some_documents(store):
    answer = query_store(
        store, steps_of=("F20", "0 1 0"), where="document = squats* or frames < 15"
    )
    assert {name for name, _, _ in found(answer)} == {"squats.amc", "lame.amc"}
    with pytest.raises(ParameterError, match="no document has 'actor'"):
        query_store(store, "kick.amc", where="actor = ann")


def test_a_pattern_by_hand_with_durations_and_counts(store, tmp_path):
    path = tmp_path / "three.toml"
    path.write_text(
        'steps = ["not F20", { times = 3, steps = [{ is = "right knee bent", min = 0.25 }, '
        '"not right knee bent"] }]'
    )
    answer = query_store(store, pattern=path)
    assert found(answer) == [("squats.amc", 0, 63)]
    assert answer.hits[0].label == "three"
    assert answer.hits[0].cost == 0.0
    path.write_text('steps = ["F20", { is = "*", max = 0.1 }, "not F20, not F17"]\nname = "n"')
    assert query_store(store, pattern=path).hits[0].label == "n"


def test_steps_that_can_hold_at_once_are_joined_and_the_answer_says_so(store, tmp_path):
    path = tmp_path / "both.toml"
    path.write_text('steps = ["F20", "F17", "not F20, not F17"]')
    remarks = query_store(store, pattern=path).remarks
    assert any("3 steps became 2" in remark for remark in remarks)


def test_documents_that_can_not_tell_are_counted(tmp_path):
    documents = {
        "kick.amc": made(["00", "10", "11", "10", "00"]),
        "blind.amc": made(["00", "10", "10", "10", "00"]),
    }
    store = make_word_store(tmp_path / "s.store", documents, untrusted={"blind.amc": 1 << FOOT})
    answer = query_store(store, "kick.amc", select="F20,F17")
    assert {name for name, _, _ in found(answer)} == {"kick.amc", "blind.amc"}
    assert answer.remarks == ("in 1 document F17 is left open: its skeleton can't tell it",)
    answer = query_store(store, steps_of=("F17", "0 1 0"))
    assert {name for name, _, _ in found(answer)} == {"kick.amc"}
    assert answer.remarks == ("1 document can't be asked: its skeleton can't tell F17",)


def test_a_hit_is_explained_step_by_step(store):
    answer = query_store(
        store, "kick.amc", select="F20,F17", mode="mismatch", mismatches=1, explain=True
    )
    lame = next(record for record in answer.records() if record["document"] == "lame.amc")
    assert [step["agrees"] for step in lame["steps"]] == [True, True, True, False, True, True, True]
    assert lame["steps"][3]["demanded"] == "right foot raised, not right knee bent"
    assert lame["steps"][3]["frames"] == 2
    assert lame["steps"][3]["example_frames"] == 3
    text = "\n".join(answer.explanation)
    assert "DISAGREES: right knee bent, not right foot raised" in text
    assert "nearly failed" in text
    json.dumps(answer.records())


def test_no_hit_is_explained_by_the_step_that_loses_the_last_candidates(store):
    answer = query_store(store, steps_of=("F20,F17", "00 10 00 01"), explain=True)
    assert not answer.hits
    text = "\n".join(answer.explanation)
    assert "step 4 of 4 (right foot raised, not right knee bent) loses the last candidates" in text
    bounded = query_store(store, steps_of=("F20", "0 1@5: 0"), explain=True)
    assert "without the bounds on durations there would be" in "\n".join(bounded.explanation)


def test_only_one_kind_of_query_at_a_time(store):
    for arguments, says in (
        ({}, "a query is one of"),
        ({"example": "kick.amc", "scene": "kick-then-punch"}, "given are --example and --scene"),
        ({"steps_of": ("F20", "0 1"), "select": "F20"}, "--select is for examples"),
        ({"steps_of": ("F20", "0 1"), "rank": "dtw"}, "compares with an example"),
        ({"example": "kick.amc", "select": ""}, "'' names no feature"),
        ({"example": "kick.amc", "rank": "odd"}, "length, dtw, template, none"),
        ({"example": "kick.amc", "mode": "odd"}, "exact, fuzzy, adaptive, mismatch"),
        ({"scene": "kick-then-punch", "mode": "mismatch"}, "not for a scene"),
    ):
        with pytest.raises(ParameterError, match=says):
            query_store(store, **arguments)
    with pytest.raises(FormatError, match="no such file"):
        query_store(store, "nowhere.amc")


@pytest.fixture(scope="module")
def takes(fixtures_dir, tmp_path_factory):
    store = tmp_path_factory.mktemp("stores") / "takes.store"
    pattern = r"(?P<actor>ann|dov)_(?P<class>[A-Za-z]+)"
    index_files([fixtures_dir], store, IndexOptions(name_pattern=pattern))
    return store


def test_the_scene_of_the_paper_is_found_where_it_is_and_nowhere_else(takes):
    answer = query_store(takes, scene="kick-then-punch")
    assert [hit.document for hit in answer.hits] == [
        "bvh/ann_take.bvh",
        "takes/ann_take_120.amc",
        "takes/dov_take_120.amc",
    ]
    assert {hit.label for hit in answer.hits} == {"kick-then-punch"}
    mirrored = query_store(takes, scene="kick-then-punch", mirror=True)
    assert not any(record["mirrored"] for record in mirrored.records())
    assert len(mirrored.hits) == 3


def test_the_scene_is_not_in_a_take_without_it(fixtures_dir, tmp_path):
    clips = [
        fixtures_dir / "clips" / name for name in ("kickFrontRight", "kickFrontLeft", "punchLeft")
    ]
    index_files(clips, tmp_path / "s.store")
    answer = query_store(tmp_path / "s.store", scene="kick-then-punch", explain=True)
    assert answer.hits == ()
    assert any("'knee' is found" in line for line in answer.explanation)


def test_facts_of_names_choose_documents(takes):
    answer = query_store(takes, steps_of=("F20", "0 1 0"), where="actor = dov and class = squat")
    assert answer.hits
    assert all("dov_squat" in hit.document for hit in answer.hits)


def test_other_facts_make_a_document_new(fixtures_dir, tmp_path):
    clips, store = fixtures_dir / "clips" / "squat", tmp_path / "s.store"
    assert index_files([clips], store).added == 4
    named = IndexOptions(name_pattern="(?P<actor>[a-z]+)_")
    assert index_files([clips], store, named).changed == 4
    assert index_files([clips], store, named).unchanged == 4
    with open_store(store) as snapshot:
        facts = [entry.document.facts for entry in snapshot.documents()]
    assert facts == [{"actor": actor} for actor in ("ann", "ann", "dov", "dov")]


@pytest.mark.parametrize("rank", ["dtw", "template", "length"])
def test_rankings_put_the_example_first_at_no_cost(takes, rank):
    example = "clips/squat/ann_squat_001_120.amc"
    answer = query_store(takes, example, select="F20,F21", rank=rank)
    assert answer.hits[0].cost == pytest.approx(0.0, abs=1e-6)
    same = {hit.document for hit in answer.hits if hit.cost < 1e-6}
    assert example in same
    assert all(np.isfinite(hit.cost) for hit in answer.hits)


@pytest.mark.parametrize(("rank", "least"), [("dtw", 0.9), ("template", 0.9)])
def test_better_rankings_put_squats_before_other_bends(takes, rank, least):
    answer = query_store(takes, "clips/squat/ann_squat_001_120.amc", select="F20", rank=rank)
    clips = [hit.document for hit in answer.hits if not hit.document.endswith(("take.bvh", "120"))]
    first = [name for name in clips if "take" not in name][:5]
    assert sum("squat" in name for name in first) >= least * 5


def test_warping_of_words_is_the_cheapest_path(tmp_path):
    rng = np.random.default_rng(3)
    documents = {f"d{n}": rng.random((20, 39)) < 0.3 for n in range(3)}
    for bits in documents.values():
        bits[:, KNEE] = np.arange(20) // 10 == 1
    store = make_word_store(tmp_path / "s.store", documents)
    answer = query_store(store, "d0", select="F20", rank="dtw")
    assert len(answer.hits) == 3
    words = {name: pack_words(bits).tolist() for name, bits in documents.items()}
    for hit in answer.hits:
        table = [[(a ^ b).bit_count() for b in words[hit.document]] for a in words["d0"]]
        total = naive.warping_cost(table)
        # The mean is over the path's cells, of which there are 20 to 39.
        assert total / (39 * 39) <= hit.cost + 1e-9
        assert hit.cost <= total / (20 * 39) + 1e-9


def test_a_mirrored_example_is_the_example_of_the_mirrored_motion(fixtures_dir, takes):
    clip = fixtures_dir / "clips/kickFrontRight/ann_kickFrontRight_001_120.amc"
    with open_archive(takes) as archive:
        example = load_example(archive, clip, ReadOptions())
        permutation = archive.feature_set.mirror
    mirrored = mirror_example(example, permutation)
    assert mirrored.mirrored
    back = mirror_example(mirrored, permutation)
    assert back.words.tolist() == example.words.tolist()
    np.testing.assert_allclose(back.poses, example.poses)
    bits = lambda loaded, i: (loaded.words >> np.uint64(i) & np.uint64(1)).tolist()  # noqa: E731
    assert bits(mirrored, OTHER_KNEE) == bits(example, KNEE)


def test_real_clips_agree_with_brute_force(real_data, tmp_path):
    clips = sorted((real_data / "hdm05" / "kickRFront1Reps").glob("*.amc"))[:6]
    if not clips:
        clips = sorted((real_data / "hdm05").glob("kick*/*.amc"))[:6]
    store = tmp_path / "real.store"
    index_files(clips, store)
    with open_store(store) as snapshot:
        entries = sorted(snapshot.documents(), key=lambda entry: entry.document.name)
        words = []
        for entry in entries:
            rows = (entry.frame_offset, entry.frame_offset + entry.document.frames)
            words.append(snapshot.array(entry.file, "frames/words", *rows).tolist())
    names = [entry.document.name for entry in entries]
    mask = F39.select("F17,F18,F20,F21")
    example = [word for word, _, _ in naive.segments(words[0], mask)]
    steps = [[(mask, value)] for value in example]
    for mismatches in (0, 1, 3):
        expected = naive.mismatch_hits(steps, mask, words, mismatches, [True] * len(steps))
        answer = query_store(
            store, names[0], select="F17,F18,F20,F21", mode="mismatch", mismatches=mismatches
        )
        assert sorted(found(answer)) == sorted((names[d], b[0], b[-1]) for d, *b in expected)
    knee = 1 << KNEE
    singles = [naive.adaptive_hits([[(knee, v)] for v in (0, knee, 0)], words)] * 2
    expected = naive.pattern_hits(singles, [(0, 30)])
    answer = query_store(store, steps_of=("F20", "0 1 0 *@0:1 0 1 0"))
    assert sorted(found(answer)) == sorted((names[d], b[0], b[-1]) for d, *b in expected)
