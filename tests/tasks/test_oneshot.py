"""Ranking by one example: what it finds in generated motion, and what it says about it."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError
from mocapidx.store.sigma import read_sigma
from mocapidx.tasks import oneshot_scan, sigma
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.oneshot import auto_records, query_auto, weight_records
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.retrieve import retrieve
from mocapidx.templates.file import load_templates
from tests.made_words import F39, make_word_store
from tests.store.test_sigma import MEASURED

CLASSES = ("squat", "kickFrontLeft", "lieDownFloor", "clapAboveHead", "jumpingJack")


@pytest.fixture(scope="module")
def clips(fixtures_dir):
    return fixtures_dir / "clips"


@pytest.fixture(scope="module")
def folder(clips, tmp_path_factory):
    """The clips of one person."""
    place = tmp_path_factory.mktemp("ann") / "clips"
    for clip in sorted(clips.rglob("ann_*.amc")):
        target = place / clip.parent.name / clip.name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(clip, target)
    shutil.copyfile(clips / "ann.asf", place / "ann.asf")
    return place


@pytest.fixture(scope="module")
def store(folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("stores") / "ann.store"
    index_files([folder], path)
    return path


@pytest.fixture(scope="module")
def bare_store(folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("stores") / "bare.store"
    index_files([folder], path, IndexOptions(poses=False))
    return path


@pytest.fixture(scope="module")
def large_store(fixtures_store, tmp_path_factory):
    """Clips and takes of both; a copy, for it keeps its own deviations."""
    return shutil.copytree(fixtures_store, tmp_path_factory.mktemp("stores") / "large.store")


def example(clips, label):
    return sorted((clips / label).glob("dov_*.amc"))[0]


@pytest.mark.parametrize("label", CLASSES)
def test_one_persons_clip_finds_anothers_first(store, clips, label):
    found = query_auto(store, example(clips, label))
    assert [Path(hit.document).parent.name for hit in found.hits[:2]] == [label, label]
    assert found.hits[0].document != found.hits[1].document
    costs = [hit.cost for hit in found.hits]
    assert costs == sorted(costs)
    assert {hit.label for hit in found.hits} == {example(clips, label).stem}


@pytest.mark.parametrize("label", CLASSES)
def test_a_take_is_found_where_it_happens(large_store, fixtures_dir, clips, label):
    take = "takes/ann_take_120.amc"
    found = query_auto(large_store, example(clips, label))
    best = next(hit for hit in found.hits if hit.document == take)
    rows = (line.split(",") for line in _labels(fixtures_dir))
    spans = [(float(r[2]), float(r[3])) for r in rows if r[0] == take and r[1] == label]
    assert any(start < (best.start_time + best.end_time) / 2 < end for start, end in spans)


def _labels(fixtures_dir):
    return (fixtures_dir / "labels.csv").read_text().splitlines()[1:]


def test_the_example_itself_is_found_as_a_whole_for_nothing(store, folder):
    clip = sorted((folder / "squat").glob("*.amc"))[0]
    found = query_auto(store, clip, feedback=False)
    assert found.hits[0].cost == pytest.approx(0.0, abs=0.01)
    assert found.hits[0].document == f"squat/{clip.name}"
    assert found.hits[0].start_frame == 0
    assert found.sure[0]
    assert found.accepted == ()


def test_records_end_with_what_is_sure_and_how_many_were_accepted(store, clips):
    found = query_auto(store, example(clips, "squat"), top=3)
    records = auto_records(found)
    assert len(records) == len(found.hits) == len(found.sure) == 3
    assert [list(record)[-4:] for record in records] == [["cost", "label", "sure", "accepted"]] * 3
    assert {record["accepted"] for record in records} == {len(found.accepted)}
    assert records[0]["rank"] == 1


def test_what_carries_the_weight_is_told(store, clips):
    found = query_auto(store, example(clips, "squat"))
    assert sum(row.share for row in found.weights) == pytest.approx(1.0)
    shares = [row.share for row in found.weights]
    assert shares == sorted(shares, reverse=True)
    assert {"feature", "name", "share", "on"} == set(weight_records(found)[0])
    assert {row.feature for row in found.weights} <= set(F39.ids)


def test_top_is_the_beginning_of_everything(store, clips):
    everything = query_auto(store, example(clips, "squat"))
    some = query_auto(store, example(clips, "squat"), top=4)
    assert some.hits == everything.hits[:4]
    assert some.sure == everything.sure[:4]


def test_feedback_is_guarded_and_can_be_left_out(store, clips):
    with_feedback = query_auto(store, example(clips, "squat"))
    without = query_auto(store, example(clips, "squat"), feedback=False)
    assert 1 <= len(with_feedback.accepted) <= 5
    assert len({hit.document for hit in with_feedback.accepted}) == len(with_feedback.accepted)
    assert without.accepted == ()
    median = np.median([hit.cost for hit in without.hits])
    assert all(hit.cost <= 0.4 * median for hit in with_feedback.accepted)
    assert with_feedback.hits != without.hits


def test_only_words_are_used_where_there_are_no_poses(bare_store, clips):
    found = query_auto(bare_store, example(clips, "squat"))
    assert Path(found.hits[0].document).parent.name == "squat"
    assert found.accepted == ()
    assert any("keeps no poses" in remark for remark in found.remarks)


def test_a_part_of_a_file_is_an_example(store, clips):
    clip = example(clips, "squat")
    whole = query_auto(store, clip)
    part = query_auto(store, f"{clip}@0.2:1.0")
    assert part.hits[0].end_frame - part.hits[0].start_frame < 48 < 2 * 48
    assert whole.hits != part.hits


def test_an_indexed_document_is_an_example(store, folder):
    name = f"squat/{sorted((folder / 'squat').glob('*.amc'))[0].name}"
    found = query_auto(store, f"{name}@0:1.5")
    assert found.hits[0].document == name
    same = query_auto(store, f"{folder / name}@0:1.5")
    assert same.hits[0].document == name
    # A file has a zero pose to measure widths on, a store has not, so costs differ a little.
    assert same.hits[0].cost == pytest.approx(found.hits[0].cost, abs=0.02)


def test_what_is_no_example_is_refused(store, clips, tmp_path):
    with pytest.raises(FormatError):
        query_auto(store, tmp_path / "none.amc")
    with pytest.raises(ParameterError, match="lasts"):
        query_auto(store, f"{example(clips, 'squat')}@100:101")


def test_the_template_of_the_hits_is_an_ordinary_one(store, clips, tmp_path):
    clip = example(clips, "squat")
    found = query_auto(store, clip, learn=tmp_path / "squat.templates", top=1)
    (template,) = load_templates(tmp_path / "squat.templates").templates
    assert template.label == clip.stem
    assert len(template.documents) == 1 + len(found.accepted) > 1
    assert template.documents[1].startswith(found.accepted[0].document + "@")
    hits = retrieve(store, tmp_path / "squat.templates", clip.stem).hits
    assert {Path(hit.document).parent.name for hit in hits[:2]} == {"squat"}


def test_only_some_documents_can_be_asked(store, clips, monkeypatch):
    some = query_auto(
        store, example(clips, "squat"), where="document = squat/* or document = jog/*"
    )
    assert {Path(hit.document).parent.name for hit in some.hits} == {"squat", "jog"}
    monkeypatch.setattr(oneshot_scan, "MOST_CELLS", 1)
    coarse = query_auto(store, example(clips, "squat"), where="document = jog/*")
    assert {Path(hit.document).parent.name for hit in coarse.hits} == {"jog"}


def test_equal_queries_give_equal_answers(store, clips):
    assert query_auto(store, example(clips, "squat")) == query_auto(store, example(clips, "squat"))


@pytest.fixture
def own_store(store, tmp_path, monkeypatch):
    """A copy that counts as large enough to say how people differ."""
    monkeypatch.setattr(sigma, "FEWEST_DOCUMENTS", 10)
    monkeypatch.setattr(sigma, "SAMPLE_SECONDS", 20.0)
    return Path(shutil.copytree(store, tmp_path / "own.store"))


def test_a_store_keeps_its_own_deviations(own_store, clips):
    first = query_auto(own_store, example(clips, "squat"))
    kept = (own_store / "SIGMA").read_bytes()
    assert query_auto(own_store, example(clips, "squat")) == first
    assert (own_store / "SIGMA").read_bytes() == kept
    assert len(read_sigma(own_store).sigma) == 39


def test_damaged_or_outdated_deviations_are_measured_again(own_store, clips):
    first = query_auto(own_store, example(clips, "squat"))
    kept = (own_store / "SIGMA").read_bytes()
    for wrong in (b"nonsense", kept.replace(b"0", b"1")):
        (own_store / "SIGMA").write_bytes(wrong)
        assert query_auto(own_store, example(clips, "squat")) == first
        assert (own_store / "SIGMA").read_bytes() == kept
    sigma.save_sigma(own_store, MEASURED)  # of another feature set
    assert query_auto(own_store, example(clips, "squat")) == first


def test_a_store_that_may_not_be_written_answers_alike(own_store, clips, monkeypatch):
    first = query_auto(own_store, example(clips, "squat"))
    os.unlink(own_store / "SIGMA")
    monkeypatch.setattr(sigma, "save_sigma", lambda *_: False)
    assert query_auto(own_store, example(clips, "squat")) == first
    assert not (own_store / "SIGMA").exists()


def test_small_stores_use_what_is_usual(store, clips):
    query_auto(store, example(clips, "squat"))
    assert not (store / "SIGMA").exists()


@pytest.mark.parametrize("label", CLASSES)
def test_a_coarse_scan_keeps_the_best_hits(large_store, clips, monkeypatch, label):
    whole = query_auto(large_store, example(clips, label))
    monkeypatch.setattr(oneshot_scan, "MOST_CELLS", 1)
    coarse = query_auto(large_store, example(clips, label))
    assert any("coarse scan" in remark for remark in coarse.remarks)
    assert len(coarse.hits) < len(whole.hits)
    places = {(hit.document, hit.end_frame) for hit in coarse.hits}
    sure = [hit for hit, sure in zip(whole.hits, whole.sure, strict=True) if sure]
    found = [(hit.document, hit.end_frame) in places for hit in sure]
    assert sum(found) >= 0.9 * len(sure)


def test_copies_of_the_example_are_all_found_and_sharpen_nothing(clips, tmp_path):
    clip = clips / "squat" / "ann_squat_001_120.amc"
    for copy in "abc":
        shutil.copyfile(clip, tmp_path / f"{copy}_120.amc")
    shutil.copyfile(clips / "ann.asf", tmp_path / "ann.asf")
    options = IndexOptions(read=ReadOptions(skeleton=tmp_path / "ann.asf"))
    index_files([tmp_path], tmp_path / "s.store", options)
    found = query_auto(tmp_path / "s.store", clip)
    assert [hit.cost for hit in found.hits[:3]] == [0, 0, 0]
    assert found.accepted == ()
    assert any("half of all places agree" in remark for remark in found.remarks)


def test_features_that_documents_cannot_tell_have_no_weight(clips, tmp_path):
    rng = np.random.default_rng(1)
    documents = {f"d{n}.amc": rng.random((60, 39)) < 0.5 for n in range(4)}
    mask = 0b111
    for name in ("d2.amc", "d3.amc"):
        documents[name][:, :3] = False
    untrusted = {"d2.amc": mask, "d3.amc": mask}
    path = make_word_store(tmp_path / "s.store", documents, untrusted=untrusted)
    found = query_auto(path, example(clips, "squat"))
    assert any("in 2 documents F1 to F3 have no weight" in remark for remark in found.remarks)
    assert {hit.document for hit in found.hits} == set(documents)


def test_one_real_clip_finds_the_class_in_other_people(real_data, tmp_path):
    clips = sorted((real_data / "hdm05").glob("*/*.amc"))
    asked = {clip.parent.name: clip for clip in reversed(clips) if "_bd_" in clip.name}
    for clip in clips:
        if "_bd_" not in clip.name:
            target = tmp_path / "clips" / clip.parent.name / clip.name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(clip, target)
    for skeleton in (real_data / "hdm05").glob("*.asf"):
        shutil.copyfile(skeleton, tmp_path / "clips" / skeleton.name)
    index_files([tmp_path / "clips"], tmp_path / "s.store")
    precisions = []
    for label, clip in asked.items():
        wanted = {c.name for c in (tmp_path / "clips" / label).iterdir()}
        seen: set[str] = set()
        precision = 0.0
        for rank, hit in enumerate(query_auto(tmp_path / "s.store", clip).hits, start=1):
            name = Path(hit.document).name
            if name in wanted - seen:
                seen.add(name)
                precision += len(seen) / rank
        precisions.append(precision / len(wanted))
    assert np.mean(precisions) >= 0.975
