"""Records as files of other programs, and labels read from these."""

import json

import pytest

from mocapidx.errors import FormatError, ParameterError
from mocapidx.tasks.found import read_found
from mocapidx.tasks.labels import named_labels, read_labels
from mocapidx.tasks.transcribe import TRANSCRIPTS, export_transcripts, transcribe
from mocapidx.transcripts.kinds import KINDS

NAMES = (
    "a/walk.amc",
    "b/walk.bvh",
    "<script>\n\x1b\udcff.bvh",
    "../../etc/x",
    "=cmd",
    "A/Walk.amc",
)
EACH = [name for name, kind in KINDS.items() if kind.write is not None]


def records_file(path, names=NAMES):
    rows = [
        {"document": name, "start_time": n + start, "end_time": n + start + 0.5, "label": label}
        for n, name in enumerate(names)
        for start, label in ((0.0, "kick"), (1.0, "<b>&\n\x1b"), (2.0, "kick"))
    ]
    path.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    return path


def stretches(labels):
    return sorted((each.document, each.start_time, each.end_time) for each in labels.labels)


@pytest.fixture
def records(tmp_path):
    return records_file(tmp_path / "found.jsonl")


@pytest.mark.parametrize("to", TRANSCRIPTS)
def test_labels_are_read_from_what_was_written(tmp_path, records, to):
    files = export_transcripts(records, tmp_path / "out", to)
    assert len(files) == (len(NAMES) if to in EACH else 1)
    named = named_labels(read_labels(tmp_path / "out"), NAMES)
    expected = sorted((f.document, f.start, f.end) for f in read_found(records))
    assert stretches(named) == expected
    assert {each.label for each in named.labels} >= {"kick"}


@pytest.mark.parametrize("to", EACH)
def test_files_are_named_so_that_they_stay_where_they_belong(tmp_path, records, to):
    files = export_transcripts(records, tmp_path / "out", to)
    assert {path.parent for path in files} == {tmp_path / "out"}
    assert len({path.name.lower() for path in files}) == len(NAMES)
    assert all(path.name.isascii() and path.name.isprintable() for path in files)


@pytest.mark.parametrize("to", EACH)
def test_one_document_may_be_one_file(tmp_path, to):
    records = records_file(tmp_path / "found.jsonl", NAMES[:1])
    path = tmp_path / f"walk{KINDS[to].suffix.upper()}"
    assert export_transcripts(records, path, to) == (path,)
    assert stretches(named_labels(read_labels(path), NAMES[:1]))[0] == (NAMES[0], 0.0, 0.5)
    both = records_file(tmp_path / "both.jsonl", NAMES[:2])
    with pytest.raises(ParameterError, match="speak of 2 documents, the file holds one"):
        export_transcripts(both, tmp_path / f"two{KINDS[to].suffix}", to)


@pytest.mark.parametrize("to", TRANSCRIPTS)
def test_no_records_are_a_file_that_says_nothing(tmp_path, to):
    (tmp_path / "none.jsonl").write_text("")
    suffix = KINDS[to].suffix if to in KINDS else ".x"
    (path,) = export_transcripts(tmp_path / "none.jsonl", tmp_path / f"none{suffix}", to)
    if to == "babel":
        assert path.read_text() == "{}\n"
        return
    assert read_found(path) == ()
    if to in EACH:
        assert export_transcripts(tmp_path / "none.jsonl", tmp_path / "folder", to) == ()


@pytest.mark.parametrize("to", TRANSCRIPTS)
def test_nothing_is_replaced_without_force(tmp_path, records, to):
    files = export_transcripts(records, tmp_path / "out", to)
    before = files[0].read_bytes()
    files[0].write_text("mine")
    with pytest.raises(ParameterError, match="--force"):
        export_transcripts(records, tmp_path / "out", to)
    assert files[0].read_text() == "mine"
    export_transcripts(records, tmp_path / "out", to, force=True)
    assert files[0].read_bytes() == before


def test_a_store_tells_names_and_lengths(tmp_path, fixtures_store):
    rows = {"document": "ann_take", "start_time": 1, "end_time": 2, "label": "kick"}
    (tmp_path / "found.jsonl").write_text(json.dumps(rows))
    written = transcribe(tmp_path / "found.jsonl", "babel", [fixtures_store])
    (sequence,) = json.loads(written[""]).values()
    assert sequence["feat_p"] == "bvh/ann_take.bvh"
    assert sequence["dur"] > 10


def test_found_are_read_from_other_programs_files(tmp_path, records):
    expected = [(f.document, f.start, f.end) for f in read_found(records)]
    for to in ("babel", "labels", "jsonl"):
        (path,) = export_transcripts(records, tmp_path / to, to)
        found = [(f.document, f.start, f.end) for f in read_found(path)]
        if to == "labels":  # CSV has odd names as they are shown
            assert [row[1:] for row in sorted(found)] != []
            continue
        assert sorted(found) == sorted(expected)


def test_a_label_without_times_is_no_annotation(tmp_path):
    sequence = {"feat_p": "a", "seq_ann": {"labels": [{"raw_label": "kick"}]}}
    (tmp_path / "b.json").write_text(json.dumps({"1": sequence}))
    assert read_labels(tmp_path / "b.json").labels[0].start_time is None
    with pytest.raises(FormatError, match="'kick' has no times"):
        read_found(tmp_path / "b.json")


def test_json_lines_are_labels_too(tmp_path):
    rows = [
        {"document": "a", "label": "kick"},
        {"document": "b", "label": "hop", "start_time": 1, "end_time": 2.5, "group": "ann"},
    ]
    path = tmp_path / "labels.jsonl"
    path.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    kick, hop = read_labels(path).labels
    assert (kick.document, kick.label, kick.start_time, kick.end_time) == ("a", "kick", None, None)
    assert (hop.start_time, hop.end_time, hop.group) == (1.0, 2.5, "ann")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('{"document": 7, "label": "x"}', "labels:1: 'document' is missing or no text"),
        ('{"document": "a"}', "'label' is missing"),
        ('{"document": "a", "label": "x", "start_time": NaN}', "must be seconds from 0"),
        ('{"document": "a", "label": "x", "end_time": [1]}', "must be seconds from 0"),
        ('{"document": "a", "label": "x"}\n{', "labels:2: not a JSON object"),
        ('{"document": "a", "label": "x"}\n' * 2, "overlaps 'x' of line 1"),
        ("WEBVTT\n\n00:01.000 --> 00:03.000\nx\n\n00:02.000 --> 00:04.000\ny", "overlaps"),
        ("<!DOCTYPE x><x/>", "has a document type"),
    ],
)
def test_odd_labels_files_are_one_line(tmp_path, text, complaint):
    path = tmp_path / "labels"
    path.write_text(text)
    with pytest.raises(FormatError, match=complaint) as caught:
        read_labels(path)
    assert str(caught.value).isprintable()


def test_a_name_that_two_documents_have_is_refused(tmp_path):
    path = tmp_path / "walk.srt"
    path.write_text("1\n00:00:01,000 --> 00:00:02,000\nhop\n")
    assert named_labels(read_labels(path), NAMES[:1]).labels[0].document == NAMES[0]
    with pytest.raises(FormatError, match=r"'walk' could be a/walk.amc or b/walk.bvh"):
        named_labels(read_labels(path), NAMES)


def test_learning_takes_labels_of_other_programs(tmp_path, fixtures_dir, fixtures_store, mocapidx):
    labels = [
        row.split(",")
        for row in (fixtures_dir / "labels.csv").read_text().splitlines()[1:]
        if row.startswith("takes/")
    ]
    rows = [
        {
            "document": row[0],
            "label": row[1],
            "start_time": float(row[2]),
            "end_time": float(row[3]),
        }
        for row in labels
        if row[1] in ("squat", "kickFrontRight")
    ]
    (tmp_path / "found.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    printed = {}
    for to in ("labels", "eaf", "srt", "textgrid"):
        done = mocapidx("export", tmp_path / "found.jsonl", "--to", to, "--output", tmp_path / to)
        assert done.returncode == 0, done.stderr
        done = mocapidx(
            *("learn-mt", fixtures_store, "--labels", tmp_path / to, "--repetitions", "auto"),
            *("--output", tmp_path / "t.h5", "--quiet"),
        )
        assert done.returncode == 0, done.stderr
        printed[to] = done.stdout
    assert len(set(printed.values())) == 1


def test_one_file_goes_to_standard_output(tmp_path, mocapidx):
    records = records_file(tmp_path / "found.jsonl", NAMES[:1])
    done = mocapidx("export", records, "--to", "srt", "--output", "-")
    assert done.returncode == 0
    assert done.stdout.startswith("1\n00:00:00,000 --> 00:00:00,500\nkick\n")
    both = records_file(tmp_path / "both.jsonl")
    assert mocapidx("export", both, "--to", "srt", "--output", "-").returncode == 2
    assert mocapidx("export", both, "--to", "bvh", "--output", "-").returncode == 2
