import csv
import itertools
from dataclasses import replace

import numpy as np
import pytest

from mocapidx.errors import ParameterError, StoreError
from mocapidx.tasks import retrieve as module
from mocapidx.tasks import store_words, threads
from mocapidx.tasks.learn import find_labels, learn_classes, save_learning
from mocapidx.tasks.preselection import preselection_remarks
from mocapidx.tasks.retrieve import RetrieveOptions, parse_keyframes, retrieve
from mocapidx.templates.keyframes import Keyframes
from tests.made_words import GESTURES, gesture, make_word_store, rest
from tests.tasks.test_learn import clips


@pytest.fixture(scope="module")
def templates(tmp_path_factory):
    folder = tmp_path_factory.mktemp("templates")
    store = make_word_store(folder / "train.store", clips() | {"stand/a.amc": rest(90)})
    learning = learn_classes(store, find_labels(store, labels_from="folder"))
    save_learning(learning, folder / "t.h5")
    return folder / "t.h5"


@pytest.fixture(scope="module")
def takes():
    """Long takes of known gestures with rest between; where each lies."""
    rng = np.random.default_rng(9)
    documents, truth = {}, []
    for take in range(4):
        parts, frames = [rest(20)], 20
        for name in rng.choice(list(GESTURES), 5):
            bits = gesture(name, rng)
            truth.append((f"take{take}.amc", str(name), frames, frames + len(bits)))
            parts += [bits, rest(25)]
            frames += len(bits) + 25
        documents[f"take{take}.amc"] = np.vstack(parts)
    return documents, truth


@pytest.fixture(scope="module")
def store(tmp_path_factory, takes):
    return make_word_store(tmp_path_factory.mktemp("takes") / "s.store", takes[0], batches=2)


def overlaps(hit, place):
    return (
        hit.document == place[0]
        and min(hit.end_frame, place[3]) - max(hit.start_frame, place[2]) > 4
    )


@pytest.mark.parametrize("label", GESTURES)
def test_every_occurrence_is_found_and_nothing_else(store, templates, takes, label):
    hits = retrieve(store, templates, label).hits
    places = [place for place in takes[1] if place[1] == label]
    assert len(hits) == len(places)
    assert all(any(overlaps(hit, place) for hit in hits) for place in places)
    assert {hit.label for hit in hits} <= {label}
    order = [(hit.cost, hit.document, hit.start_frame) for hit in hits]
    assert order == sorted(order)


def test_frames_seconds_and_source_frames_agree(store, templates):
    for hit in retrieve(store, templates, "kick").hits:
        assert hit.start_time == hit.start_frame / 30
        assert hit.source_start_frame == 4 * hit.start_frame
        assert hit.source_end_frame == 4 * hit.end_frame


def test_the_best_few_are_the_first_of_all(store, templates):
    options = RetrieveOptions(tau=0.5)
    everything = retrieve(store, templates, "kick", options).hits
    for top in (1, 3, 10):
        few = retrieve(store, templates, "kick", RetrieveOptions(tau=0.5, top=top)).hits
        assert few == everything[:top]


def test_hits_share_no_more_than_allowed(store, templates):
    counts = []
    for share in (0.0, 0.5, 0.9):
        options = RetrieveOptions(tau=0.5, min_overlap=share)
        hits = retrieve(store, templates, "kick", options).hits
        counts.append(len(hits))
        for one, other in itertools.combinations(hits, 2):
            if one.document == other.document:
                common = min(one.end_frame, other.end_frame) - max(
                    one.start_frame, other.start_frame
                )
                shorter = min(h.end_frame - h.start_frame for h in (one, other))
                assert common <= share * shorter
    assert counts[0] < counts[1] < counts[2]


@pytest.mark.parametrize("steps", ["weighted", "printed"])
def test_a_higher_tau_finds_more(store, templates, steps):
    counts = [
        len(retrieve(store, templates, "bow", RetrieveOptions(tau=tau, steps=steps)).hits)
        for tau in (0.01, 0.05, 0.2, 1.0)
    ]
    assert counts == sorted(counts)


def test_rivals_drop_what_another_class_explains_better(tmp_path):
    rng = np.random.default_rng(4)
    # A bow that begins with half a kick: the template of the kick finds it too.
    documents = {}
    for n in range(4):
        kick = gesture("kick", rng)
        half = kick.copy()
        half[:, GESTURES["kick"][5:]] = False
        half[:, GESTURES["bow"][3]] = True
        documents[f"kick/{n}.amc"] = kick
        documents[f"half/{n}.amc"] = half
    store = make_word_store(tmp_path / "s.store", documents)
    learning = learn_classes(store, find_labels(store, labels_from="folder"))
    known = learning.templates
    loose = replace(known, templates=tuple(replace(t, tau=0.4) for t in known.templates))
    with_rivals = retrieve(store, loose, "kick")
    without = retrieve(store, loose, "kick", RetrieveOptions(rivals=False))
    assert {hit.document.split("/")[0] for hit in with_rivals.hits} == {"kick"}
    assert {hit.document.split("/")[0] for hit in without.hits} == {"kick", "half"}
    given = retrieve(store, loose, "kick", RetrieveOptions(tau=0.4))
    assert given.hits == without.hits


def test_untrusted_features_are_left_open(tmp_path, templates):
    kick = gesture("kick", np.random.default_rng(7))
    lost = kick.copy()
    lost[:, GESTURES["kick"][3]] = False
    mask = 1 << GESTURES["kick"][3]
    store = make_word_store(
        tmp_path / "s.store",
        {"good.amc": kick, "lost.amc": lost, "bad.amc": lost},
        untrusted={"lost.amc": mask},
    )
    costs = {
        hit.document: hit.cost
        for hit in retrieve(store, templates, "kick", RetrieveOptions(tau=0.9)).hits
    }
    assert costs["lost.amc"] < costs["bad.amc"]


def test_a_skeleton_that_tells_next_to_nothing_has_no_hits(tmp_path, templates):
    kick = gesture("kick", np.random.default_rng(7))
    all_but_one = (1 << kick.shape[1]) - 1 & ~(1 << GESTURES["kick"][3])
    store = make_word_store(
        tmp_path / "s.store",
        {"good.amc": kick, "leg.amc": kick},
        untrusted={"leg.amc": all_but_one},
    )
    found = retrieve(store, templates, "kick", RetrieveOptions(tau=0.9))
    assert {hit.document for hit in found.hits} == {"good.amc"}
    assert any("in 1 document, such as leg.amc, too little" in each for each in found.remarks)


def test_the_profile_has_every_frame_of_every_document(store, templates, takes, tmp_path):
    hits = retrieve(store, templates, "kick", profile=tmp_path / "p.csv").hits
    with (tmp_path / "p.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(map(len, takes[0].values()))
    assert [row["document"] for row in rows] == sorted(row["document"] for row in rows)
    best = {(row["document"], int(row["frame"])): row["cost"] for row in rows}
    for hit in hits:
        assert float(best[hit.document, hit.end_frame - 1]) == pytest.approx(hit.cost, abs=1e-8)
    assert rows[0]["cost"] == ""


def test_a_store_of_another_rate_is_refused(templates, tmp_path):
    store = make_word_store(tmp_path / "s.store", {"x.amc": rest(9)}, rate=60.0)
    with pytest.raises(StoreError, match="60 frames/s, the templates 30"):
        retrieve(store, templates, "kick")


def test_a_class_that_is_not_there_is_told(store, templates):
    with pytest.raises(ParameterError, match=r"'jump'.*bow, kick, raise, stand"):
        retrieve(store, templates, "jump")


@pytest.mark.parametrize(
    "values", [{"tau": 0.0}, {"tau": float("nan")}, {"top": 0}, {"min_overlap": 1.0}]
)
def test_options_out_of_range_are_refused(values):
    with pytest.raises(ParameterError):
        RetrieveOptions(**values)


@pytest.mark.parametrize("label", GESTURES)
def test_keyframes_look_at_less_and_say_so(store, templates, label):
    full = retrieve(store, templates, label)
    some = retrieve(store, templates, label, RetrieveOptions(keyframes="auto"))
    assert [(hit.document, hit.end_frame) for hit in some.hits] == [
        (hit.document, hit.end_frame) for hit in full.hits
    ]
    assert not full.remarks
    assert "% of the motion" in some.remarks[0]
    assert "can lose hits" in some.remarks[0]


def test_keyframes_can_be_chosen_by_hand(store, templates, tmp_path):
    options = RetrieveOptions(keyframes=(0, 20), keyframe_tolerance=1)
    found = retrieve(store, templates, "kick", options, profile=tmp_path / "p.csv")
    assert "keyframes 0, 20 with up to 1 disagreeing" in found.remarks[0]
    whole = retrieve(store, templates, "kick", profile=tmp_path / "q.csv")
    assert {hit.document for hit in found.hits} <= {hit.document for hit in whole.hits}
    lines = set((tmp_path / "p.csv").read_text().splitlines())
    assert 1 < len(lines) < len((tmp_path / "q.csv").read_text().splitlines())
    with pytest.raises(ParameterError, match="keyframes must be"):
        retrieve(store, templates, "kick", RetrieveOptions(keyframes=(4000,)))


@pytest.mark.parametrize(
    ("text", "choice"), [("none", "none"), ("auto", "auto"), ("8", (8,)), ("44,8,8", (8, 44))]
)
def test_keyframes_are_understood(text, choice):
    assert parse_keyframes(text) == choice


@pytest.mark.parametrize("text", ["", "8,", "-1", "1.5", "some", "٣"])
def test_other_words_for_keyframes_are_refused(text):
    with pytest.raises(ParameterError, match="expected none, auto or columns"):
        parse_keyframes(text)


def test_keyframes_that_leave_everything_do_not_pay_and_it_says_so():
    keyframes = Keyframes((3, 9), 12)
    told = list(preselection_remarks(keyframes, np.array([1000, 1000]), np.array([0.1, 2.0])))
    assert len(told) == 2
    assert "left 100.0 % of the motion in 0.10 s" in told[0]
    assert "didn't pay" in told[1]
    for kept, spent in ((50, 0.1), (0, 3.0)):
        seconds = np.array([spent, 0.1])
        assert len(list(preselection_remarks(keyframes, np.array([1000, kept]), seconds))) == 1


@pytest.mark.parametrize("tau", [0.05, 0.3])
def test_rivals_are_as_good_as_matched_everywhere(templates, store, monkeypatch, tau):
    monkeypatch.setattr(module, "own_threshold", lambda template, rivals: tau)
    near = [retrieve(store, templates, name).hits for name in GESTURES]
    monkeypatch.setattr(
        module, "_lowest_near", lambda _, hits, *rest: np.zeros(len(hits.costs)) - 1
    )
    assert [retrieve(store, templates, name).hits for name in GESTURES] == near


@pytest.mark.parametrize("keyframes", ["none", "auto"])
@pytest.mark.parametrize("count", [1, 3])
def test_batches_and_threads_change_nothing(templates, store, monkeypatch, keyframes, count):
    options = RetrieveOptions(keyframes=keyframes)
    whole = [retrieve(store, templates, name, options).hits for name in GESTURES]
    monkeypatch.setattr(store_words, "BATCH_FRAMES", 1)
    monkeypatch.setattr(threads, "thread_count", lambda: count)
    assert [retrieve(store, templates, name, options).hits for name in GESTURES] == whole
