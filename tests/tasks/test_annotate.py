import csv
import json
import shutil
from collections import defaultdict
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner

from mocapidx.errors import FormatError, ParameterError, StoreError
from mocapidx.features.extract import extract_features
from mocapidx.features.featureset import load_feature_set
from mocapidx.features.words import pack_words
from mocapidx.tasks.annotate import (
    AnnotateOptions,
    annotate_motion,
    annotation_record,
)
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.read import read_motion
from mocapidx.templates.file import save_templates
from mocapidx.templates.learn import learn_template
from mocapidx.templates.match import distance_function
from mocapidx.templates.path import annotate_words, loop_bank
from mocapidx.templates.template import MotionTemplate, TemplateSet
from mocapidx_cli.annotate import annotate as command

CLASSES = ("cartwheelLeft", "jumpingJack", "lieDownFloor", "squat", "walk")
ANNOTATION_KEYS = [
    "document",
    "start_frame",
    "end_frame",
    "start_time",
    "end_time",
    "source_start_frame",
    "source_end_frame",
    "cost",
    "label",
]


@pytest.fixture(scope="module")
def templates(fixtures_dir):
    """Class templates from the generated clips."""
    features = load_feature_set("f39")
    learned = [
        MotionTemplate(
            label,
            learn_template(
                [
                    extract_features(read_motion(clip))
                    for clip in sorted((fixtures_dir / "clips" / label).glob("*.amc"))
                ]
            ).matrix,
            features.digest,
            30.0,
        )
        for label in CLASSES
    ]
    return TemplateSet(tuple(learned), "f39", features.digest, features.text, 30.0)


@pytest.fixture(scope="module")
def template_file(templates, tmp_path_factory):
    path = tmp_path_factory.mktemp("templates") / "t.h5"
    save_templates(path, templates)
    return path


@pytest.fixture(scope="module")
def takes(fixtures_dir):
    return fixtures_dir / "takes"


@pytest.fixture(scope="module")
def store(takes, tmp_path_factory):
    path = tmp_path_factory.mktemp("stores") / "takes.store"
    index_files([takes], path)
    return path


def rows(annotated):
    return [annotation_record(annotation) for annotation in annotated.annotations]


def truth(fixtures_dir):
    """Document name and the true times of its labels."""
    found = defaultdict(list)
    with (fixtures_dir / "labels.csv").open() as lines:
        for row in csv.DictReader(lines):
            if row["document"].startswith("takes/") and row["label"] in CLASSES:
                span = row["label"], float(row["start_time"]), float(row["end_time"])
                found[row["document"].removeprefix("takes/")].append(span)
    return found


@pytest.mark.parametrize("method", ["path", "hits"])
def test_what_goes_on_in_the_takes_is_found(fixtures_dir, takes, template_file, method):
    found = rows(annotate_motion([takes], template_file, AnnotateOptions(method=method)))
    right = total = 0
    for document, spans in truth(fixtures_dir).items():
        for label, start, end in spans:
            for time in np.arange(start + 0.2, end - 0.2, 0.1):
                total += 1
                right += any(
                    row["document"] == document
                    and row["label"] == label
                    and row["start_time"] <= time < row["end_time"]
                    for row in found
                )
    assert total > 100
    assert right / total > 0.9


def test_a_path_is_the_one_through_the_templates(takes, templates):
    take = min(takes.glob("*.amc"))
    (*found,) = rows(annotate_motion([take], templates))
    words = pack_words(extract_features(read_motion(take)))
    bank = loop_bank(
        [t.matrix for t in templates.templates], [t.label for t in templates.templates]
    )
    expected = annotate_words(words, bank)
    assert [(r["label"], r["start_frame"], r["end_frame"]) for r in found] == [
        (o.label, o.start, o.end) for o in expected
    ]
    assert [r["cost"] for r in found] == pytest.approx([o.cost for o in expected])
    assert [r["repetitions"] for r in found] == [round(o.repetitions, 2) for o in expected]


def test_records_have_the_keys_of_the_contract_and_times_agree(takes, template_file):
    for row in rows(annotate_motion([takes], template_file)):
        assert list(row) == [*ANNOTATION_KEYS, "repetitions"]
        assert row["start_time"] == pytest.approx(row["start_frame"] / 30, abs=1e-6)
        assert row["end_time"] == pytest.approx(row["end_frame"] / 30, abs=1e-6)
        assert row["source_start_frame"] == row["start_frame"] * 4
        assert 0 <= row["source_end_frame"] - 4 * (row["end_frame"] - 1) <= 4


def test_paths_do_not_overlap_and_filled_ones_leave_nothing_out(takes, template_file):
    free = rows(annotate_motion([takes], template_file))
    filled = rows(annotate_motion([takes], template_file, AnnotateOptions(fill=True)))
    for found in (free, filled):
        for before, after in pairwise(found):
            if before["document"] == after["document"]:
                assert before["end_frame"] <= after["start_frame"]
    annotated = annotate_motion([takes], template_file, AnnotateOptions(fill=True))
    assert sum(row["end_frame"] - row["start_frame"] for row in filled) == annotated.frames


@pytest.mark.parametrize("method", ["path", "hits"])
def test_files_and_their_store_are_annotated_alike(takes, store, template_file, method):
    options = AnnotateOptions(method=method)
    from_files, from_store = (
        annotate_motion([place], template_file, options) for place in (takes, store)
    )
    assert rows(from_files) == rows(from_store)
    assert from_files.documents == from_store.documents == 2
    assert from_files.frames == from_store.frames


def test_the_number_of_workers_changes_nothing(fixtures_dir, store, template_file):
    inputs = [fixtures_dir / "clips" / "squat", fixtures_dir / "clips" / "walk", store]
    root = AnnotateOptions(root=fixtures_dir)
    inputs = [*inputs[:2], fixtures_dir / "clips" / "jog", inputs[2]]
    calls = []
    one = annotate_motion(
        inputs, template_file, root, progress=lambda done, total: calls.append((done, total))
    )
    two = annotate_motion(inputs, template_file, replace(root, jobs=2))
    assert one == two
    assert calls[-1] == (one.documents, one.documents)
    names = [(row["document"], row["start_frame"]) for row in rows(one)]
    assert names == sorted(names)


def test_only_the_chosen_classes_are_looked_for(takes, template_file):
    options = AnnotateOptions(classes=("squat", "walk"), fill=True)
    assert {row["label"] for row in rows(annotate_motion([takes], template_file, options))} == {
        "squat",
        "walk",
    }
    with pytest.raises(ParameterError, match="no template of a class 'yoga'"):
        annotate_motion([takes], template_file, AnnotateOptions(classes=("yoga",)))


def test_hits_cost_what_the_distance_function_says(takes, templates):
    take = min(takes.glob("*.amc"))
    options = AnnotateOptions(method="hits", overlap="keep", tau=0.1)
    words = pack_words(extract_features(read_motion(take)))
    found = rows(annotate_motion([take], templates, options))
    assert found
    for row in found:
        costs = distance_function(templates.of(row["label"])[0], words)
        assert row["cost"] == pytest.approx(costs[row["end_frame"] - 1], abs=1e-8)
        assert row["cost"] < 0.1


def test_rivals_only_take_hits_away_and_leave_no_class_beside_a_better_one(takes, template_file):
    keep, rivals = (
        rows(
            annotate_motion(
                [takes], template_file, AnnotateOptions(method="hits", overlap=o, tau=0.2)
            )
        )
        for o in ("keep", "rivals")
    )
    assert len(rivals) < len(keep)
    assert all(row in keep for row in rivals)
    lost = [row for row in keep if row not in rivals]
    for row in lost:
        assert any(
            other["document"] == row["document"]
            and other["label"] != row["label"]
            and other["cost"] < row["cost"]
            and other["start_frame"] < row["end_frame"]
            and row["start_frame"] < other["end_frame"]
            for other in keep
        )


def test_each_class_has_its_own_threshold(takes, templates):
    strict = replace(
        templates,
        templates=tuple(replace(template, tau=1e-6) for template in templates.templates),
    )
    options = AnnotateOptions(method="hits")
    assert len(annotate_motion([takes], strict, options).annotations) < len(
        annotate_motion([takes], templates, options).annotations
    )


def test_stretch_templates_are_for_paths_only(takes, templates):
    stretches = replace(
        templates,
        templates=tuple(replace(template, kind="stretch") for template in templates.templates),
    )
    assert annotate_motion([takes], stretches).annotations
    with pytest.raises(ParameterError, match="no template to annotate with"):
        annotate_motion([takes], stretches, AnnotateOptions(method="hits"))


def test_a_store_of_another_feature_set_or_rate_is_refused(takes, store, templates, tmp_path):
    other = tmp_path / "other.store"
    index_files([takes], other, IndexOptions(rate=15.0))
    with pytest.raises(StoreError, match="15 frames/s, the templates 30"):
        annotate_motion([other], templates)
    foreign = replace(
        templates,
        templates=tuple(
            replace(template, feature_set_digest="0" * 64) for template in templates.templates
        ),
        feature_set_digest="0" * 64,
    )
    with pytest.raises(StoreError, match="made with feature set 'f39'"):
        annotate_motion([store], foreign)


def test_two_documents_of_one_name_are_refused(takes, store, template_file):
    with pytest.raises(ParameterError, match="both hold a document"):
        annotate_motion([takes, store], template_file)


def test_a_bad_file_stops_the_run_or_is_passed_over(takes, template_file, tmp_path):
    for path in takes.iterdir():
        shutil.copy2(path, tmp_path)
    (tmp_path / "bad.bvh").write_text("no motion")
    with pytest.raises(FormatError, match="--skip-bad passes over such files"):
        annotate_motion([tmp_path], template_file)
    annotated = annotate_motion([tmp_path], template_file, AnnotateOptions(skip_bad=True))
    assert [refused.name for refused in annotated.refused] == ["bad.bvh"]
    assert rows(annotated) == rows(annotate_motion([takes], template_file))


@pytest.mark.parametrize(
    "wrong", [{"fill": True, "method": "hits"}, {"tau": 0.1}, {"overlap": "keep"}]
)
def test_options_that_do_not_go_with_the_method_are_refused(wrong):
    with pytest.raises(ParameterError, match="only"):
        AnnotateOptions(**wrong)


def test_the_command_prints_records_and_nothing_else(takes, template_file):
    done = CliRunner().invoke(
        command, [str(takes), "--templates", str(template_file), "--format", "jsonl"]
    )
    assert done.exit_code == 0
    assert [json.loads(line) for line in done.stdout.splitlines()] == [
        dict(row) for row in rows(annotate_motion([takes], template_file))
    ]
    assert done.stderr.startswith("2 documents, ")
    assert done.stderr.count("\n") == 1


def test_quiet_and_output_leave_only_the_file(takes, template_file, tmp_path):
    output = tmp_path / "labels.csv"
    arguments = [str(takes), "--templates", str(template_file), "--format", "csv", "--quiet"]
    done = CliRunner().invoke(command, [*arguments, "--output", str(output)])
    assert (done.exit_code, done.output) == (0, "")
    with output.open() as lines:
        found = list(csv.DictReader(lines))
    expected = rows(annotate_motion([takes], template_file))
    assert [row["label"] for row in found] == [row["label"] for row in expected]
    again = tmp_path / "again.csv"
    CliRunner().invoke(command, [*arguments, "--output", str(again)])
    assert again.read_bytes() == output.read_bytes()


def test_a_failed_run_writes_no_output(takes, template_file, tmp_path):
    output = tmp_path / "labels.csv"
    output.write_text("before")
    arguments = [str(takes), "--templates", str(tmp_path / "none.h5"), "--output", str(output)]
    done = CliRunner().invoke(command, arguments)
    assert isinstance(done.exception, StoreError)
    assert output.read_text() == "before"


def test_no_classes_found_is_an_empty_table(tmp_path, takes, template_file):
    arguments = [str(takes), "--templates", str(template_file), "--method", "hits"]
    done = CliRunner().invoke(command, [*arguments, "--tau", "1e-9", "--class", "walk"])
    assert done.exit_code == 0
    assert len(done.stdout.splitlines()) == 1
    assert done.stdout.startswith("document")


def test_csv_has_one_header_with_and_without_rows(takes, template_file):
    arguments = [str(takes), "--templates", str(template_file), "--format", "csv"]
    some = CliRunner().invoke(command, [*arguments, "--fill"]).stdout.splitlines()
    nothing = ["--method", "hits", "--tau", "1e-9", "--class", "walk"]
    none = CliRunner().invoke(command, [*arguments, *nothing])
    assert len(some) > 1
    assert none.stdout.splitlines() == [some[0]] == [",".join([*ANNOTATION_KEYS, "repetitions"])]
