import json
import math

import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError
from mocapidx.tasks.annotate import annotate_motion, annotation_record
from mocapidx.tasks.evaluate import EvaluationOptions, evaluate_records
from mocapidx.tasks.evaluation_table import evaluation_table
from mocapidx.tasks.labels import read_labels
from mocapidx.tasks.learn import find_labels, learn_classes, save_learning
from mocapidx.tasks.records import hit_record
from mocapidx.tasks.retrieve import RetrieveOptions, retrieve
from tests.made_words import GESTURES, gesture, make_word_store, rest
from tests.tasks.test_learn import clips


def hit(document, label, start, end, cost, rank=1):
    return {
        "rank": rank,
        "document": document,
        "start_time": start,
        "end_time": end,
        "cost": cost,
        "label": label,
    }


def annotation(document, label, start, end):
    record = hit(document, label, start, end, 0.1)
    del record["rank"]
    return record


def written(path, records):
    path.write_text("".join(f"{json.dumps(record)}\n" for record in records))
    return path


def labels(tmp_path, *rows):
    path = tmp_path / "labels.csv"
    path.write_text("document,label,start_time,end_time\n" + "".join(f"{row}\n" for row in rows))
    return read_labels(path)


def by_class(evaluation):
    return {record["class"]: record for record in evaluation.classes}


SQUATS = (
    hit("a", "squat", 0, 1, 0.005),
    hit("a", "squat", 2, 3, 0.03),
    hit("b", "squat", 5, 6, 0.015),
    hit("b", "squat", 7, 8, 0.09),
)


def test_hits_are_counted_by_class_and_together(tmp_path):
    truth = labels(tmp_path, "a,squat,0,1", "b,squat,7,8", "b,squat,9,10", "b,jump,5,6")
    hits = written(tmp_path / "h", [*SQUATS, hit("b", "jump", 5, 6, 0.05)])
    records = by_class(evaluate_records(hits, truth))
    squat = records["squat"]
    assert (squat["labels"], squat["hits"], squat["relevant"]) == (3, 4, 2)
    assert (squat["precision"], squat["recall"]) == (0.5, 0.666667)
    assert [squat[f"hits_{tau}"] for tau in ("0.01", "0.02", "0.04", "0.06", "0.08", "0.1")] == [
        1, 2, 3, 3, 3, 4,
    ]  # fmt: skip
    assert [squat[f"relevant_{tau}"] for tau in ("0.01", "0.04", "0.1")] == [1, 1, 2]
    assert squat["average_precision"] == pytest.approx((1 + 2 / 4) / 3, abs=1e-6)
    assert squat["recall_top_5"] == pytest.approx(2 / 3, abs=1e-6)
    assert records["jump"]["f1"] == 1.0
    pooled = records["all"]
    assert (pooled["labels"], pooled["hits"], pooled["relevant"]) == (4, 5, 3)
    assert pooled["average_precision"] == pytest.approx((0.5 + 1) / 2)


def test_the_order_of_the_records_does_not_matter(tmp_path):
    truth = labels(tmp_path, "a,squat,0,1", "b,squat,7,8")
    one = evaluate_records(written(tmp_path / "one", SQUATS), truth)
    other = evaluate_records(written(tmp_path / "other", SQUATS[::-1]), truth)
    assert one == other


def test_labels_that_cover_repetitions(tmp_path):
    truth = labels(tmp_path, "a,squat,0,4", "b,squat,4,9")
    hits = written(tmp_path / "h", SQUATS)
    assert by_class(evaluate_records(hits, truth))["squat"]["precision"] == 0.5
    repeated = evaluate_records(hits, truth, EvaluationOptions(repeated=True))
    assert by_class(repeated)["squat"]["precision"] == 1.0
    assert by_class(repeated)["squat"]["recall"] == 1.0


def test_classes_without_hits_are_left_out_unless_asked_for(tmp_path):
    truth = labels(tmp_path, "a,squat,0,1", "c,jump,0,1")
    hits = written(tmp_path / "h", SQUATS)
    found = evaluate_records(hits, truth)
    assert set(by_class(found)) == {"squat", "all"}
    assert any("no hits of jump" in remark for remark in found.remarks)
    everything = by_class(evaluate_records(hits, truth, EvaluationOptions(all_classes=True)))
    assert everything["jump"]["recall"] == 0.0
    assert everything["jump"]["precision"] is None
    one = evaluate_records(hits, truth, EvaluationOptions(classes=("jump",)))
    assert set(by_class(one)) == {"jump", "all"}
    with pytest.raises(ParameterError, match="says 'kick'"):
        evaluate_records(hits, truth, EvaluationOptions(classes=("kick",)))


def test_documents_without_labels_can_be_left_out(tmp_path):
    truth = labels(tmp_path, "a,squat,0,1")
    hits = written(tmp_path / "h", SQUATS)
    assert by_class(evaluate_records(hits, truth))["squat"]["hits"] == 4
    some = evaluate_records(hits, truth, EvaluationOptions(labelled_documents=True))
    assert by_class(some)["squat"]["hits"] == 2


def test_annotated_seconds_and_confusions(tmp_path):
    truth = labels(tmp_path, "a,squat,0,4", "a,jump,4,6")
    found = evaluate_records(
        written(tmp_path / "a", [annotation("a", "squat", 1, 5), annotation("a", "kick", 5, 7)]),
        truth,
    )
    records = by_class(found)
    assert records["squat"]["right_seconds"] == 3.0
    assert records["jump"]["recall"] == 0.0
    assert records["all"]["recall"] == 0.5
    assert records["all"]["annotated_seconds"] == 6.0
    pairs = {(pair["label"], pair["annotated_as"]): pair["seconds"] for pair in found.confusion}
    assert pairs == {
        ("squat", "squat"): 3.0,
        ("squat", "(none)"): 1.0,
        ("jump", "squat"): 1.0,
        ("jump", "kick"): 1.0,
        ("(no label)", "kick"): 1.0,
    }
    lines = list(evaluation_table(found))
    assert lines[-1] == "frame accuracy: 0.5000 of 6.0 labelled seconds"


def test_time_of_other_classes_is_left_out_where_classes_are_chosen(tmp_path):
    truth = labels(tmp_path, "a,squat,0,4", "a,jump,4,6")
    records = written(tmp_path / "a", [annotation("a", "squat", 0, 6)])
    chosen = evaluate_records(records, truth, EvaluationOptions(classes=("squat",)))
    assert by_class(chosen)["all"]["recall"] == 1.0
    assert by_class(chosen)["squat"]["precision"] == 1.0


def test_hits_and_annotations_together_are_refused(tmp_path):
    both = written(tmp_path / "x", [SQUATS[0], annotation("a", "squat", 0, 1)])
    with pytest.raises(FormatError, match="both hits and annotations"):
        evaluate_records(both, labels(tmp_path, "a,squat,0,1"))


def test_no_records_at_all(tmp_path):
    truth = labels(tmp_path, "a,squat,0,1")
    none = written(tmp_path / "none", [])
    assert by_class(evaluate_records(none, truth))["all"]["hits"] == 0
    found = evaluate_records(none, truth, EvaluationOptions(all_classes=True))
    assert by_class(found)["squat"]["recall"] == 0.0
    assert all(isinstance(line, str) for line in evaluation_table(found))


def test_every_record_is_json_and_has_the_same_keys(tmp_path):
    truth = labels(tmp_path, "a,squat,0,1")
    found = evaluate_records(written(tmp_path / "h", SQUATS), truth)
    text = [json.dumps(record, allow_nan=False) for record in found.classes]
    assert len({tuple(json.loads(line)) for line in text}) == 1


@pytest.fixture(scope="module")
def gestures(tmp_path_factory):
    """Templates of three gestures, takes of them, and labels of the takes."""
    folder = tmp_path_factory.mktemp("evaluate")
    train = make_word_store(folder / "train.store", clips() | {"stand/a.amc": rest(90)})
    learning = learn_classes(train, find_labels(train, labels_from="folder"))
    save_learning(learning, folder / "t.h5")
    rng = np.random.default_rng(4)
    documents, rows = {}, ["document,label,start_time,end_time"]
    for take in range(3):
        parts, frames = [rest(20)], 20
        for name in rng.permutation(list(GESTURES)):
            bits = gesture(str(name), rng)
            rows.append(f"take{take},{name},{frames / 30:.4f},{(frames + len(bits)) / 30:.4f}")
            parts += [bits, rest(25)]
            frames += len(bits) + 25
        documents[f"take{take}"] = np.vstack(parts)
    make_word_store(folder / "takes.store", documents)
    (folder / "labels.csv").write_text("\n".join(rows) + "\n")
    return folder


def test_what_retrieval_finds_can_be_measured(gestures, tmp_path):
    hits = []
    for label in GESTURES:
        found = retrieve(
            gestures / "takes.store", gestures / "t.h5", label, RetrieveOptions(tau=1.0)
        )
        hits += [dict(hit_record(each, rank)) for rank, each in enumerate(found.hits, 1)]
    options = EvaluationOptions(store=gestures / "takes.store", templates=gestures / "t.h5")
    found = evaluate_records(
        written(tmp_path / "h", hits), read_labels(gestures / "labels.csv"), options
    )
    pooled = by_class(found)["all"]
    assert pooled["average_precision"] == 1.0
    assert pooled["recall_0.06"] == 1.0
    assert pooled["precision_0.06"] == 1.0
    assert pooled["separation"] == "inf" or pooled["separation"] > 5


def test_what_annotation_finds_can_be_measured(gestures, tmp_path):
    annotated = annotate_motion([gestures / "takes.store"], gestures / "t.h5")
    records = [dict(annotation_record(each)) for each in annotated.annotations]
    found = evaluate_records(written(tmp_path / "a", records), read_labels(gestures / "labels.csv"))
    assert by_class(found)["all"]["recall"] > 0.8


def test_labels_without_an_end_need_a_store_to_know_it(gestures, tmp_path):
    truth = labels(tmp_path, "take0,kick,,")
    records = written(tmp_path / "a", [annotation("take0", "kick", 0, 1)])
    found = evaluate_records(records, truth)
    assert by_class(found)["kick"]["labelled_seconds"] == 1.0
    assert any("--store" in remark for remark in found.remarks)
    options = EvaluationOptions(store=gestures / "takes.store")
    known = by_class(evaluate_records(records, truth, options))["kick"]["labelled_seconds"]
    assert known > 3.0
    assert math.isfinite(known)


def test_the_program_reads_hits_from_a_pipe(gestures, mocapidx):
    hits = mocapidx(
        "retrieve", gestures / "takes.store", "--templates", gestures / "t.h5", "--class", "kick",
        "--tau", "1", "--format", "jsonl",
    )  # fmt: skip
    arguments = ("evaluate", "-", "--truth", gestures / "labels.csv")
    done = mocapidx(*arguments, input=hits.stdout)
    assert done.returncode == 0, done.stderr
    assert "right / all hits below tau" in done.stdout
    assert "no hits of bow, raise: left out" in done.stderr
    lines = mocapidx(*arguments, "--format", "csv", "--quiet", input=hits.stdout)
    assert lines.stdout.startswith("class,labels,hits,relevant,precision,recall,f1,average_prec")
    assert lines.stderr == ""
    records = mocapidx(*arguments, "--format", "jsonl", "--quiet", input=hits.stdout)
    assert [json.loads(line)["class"] for line in records.stdout.splitlines()] == ["kick", "all"]
