import io
import json
from pathlib import Path

import pytest

from mocapidx.errors import FormatError
from mocapidx.model import Hit
from mocapidx.tasks.found import Found, read_found
from mocapidx.tasks.records import hit_record, render_records

HITS = (
    Hit("a/walk.amc", 3, 9, 0.1, 0.3, 12, 36, 0.04, "walk"),
    Hit("=b,\n\x1b.bvh", 0, 30, 0.0, 1.0, 0, 120, 0.05, "walk"),
)


def written(path, row_format, hits=HITS):
    records = [hit_record(hit, rank) for rank, hit in enumerate(hits, start=1)]
    lines = render_records(records, row_format, list(records[0]) if records else ["document"])
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def test_json_lines_come_back_as_they_were(tmp_path):
    found = read_found(written(tmp_path / "hits", "jsonl"))
    assert found == (
        Found("a/walk.amc", "walk", 0.1, 0.3, 0.04, True, 1, (12, 36)),
        Found("=b,\n\x1b.bvh", "walk", 0.0, 1.0, 0.05, True, 2, (0, 120)),
    )


def test_csv_comes_back_with_names_as_they_were_shown(tmp_path):
    found = read_found(written(tmp_path / "hits", "csv"))
    assert found[0] == Found("a/walk.amc", "walk", 0.1, 0.3, 0.04, True, 1, (12, 36))
    assert found[1].document == "=b,\\n\\x1b.bvh"


def test_records_without_rank_are_annotations_and_may_have_no_cost(tmp_path):
    path = tmp_path / "a.jsonl"
    path.write_text('{"document": "a", "start_time": 0, "end_time": 1, "label": "x"}\n\n')
    assert read_found(path) == (Found("a", "x", 0.0, 1.0, 0.0, False),)


def test_standard_input(monkeypatch, tmp_path):
    data = written(tmp_path / "hits", "jsonl").read_bytes()
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data)))
    assert len(read_found(Path("-"))) == 2


def test_no_records_are_no_hits(tmp_path):
    (tmp_path / "none").write_text("")
    assert read_found(tmp_path / "none") == ()


GOOD = {"document": "a", "start_time": 0, "end_time": 1, "label": "x"}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{\n", ":1: not a JSON object on one line"),
        ("{}\n", ":1: 'document' is missing"),
        (f"{json.dumps(GOOD)}\n[1]\n", ":2: not a JSON object"),
        (json.dumps(GOOD | {"document": 3}), "'document' is no text"),
        (json.dumps(GOOD | {"start_time": True}), "'start_time' is no number: True"),
        (json.dumps(GOOD | {"start_time": ""}), "'start_time' is empty, expected a number"),
        (json.dumps(GOOD | {"end_time": None}), "'end_time' is no number"),
        (json.dumps(GOOD | {"cost": float("nan")}), "'cost' is no number"),
        (json.dumps(GOOD | {"end_time": 0}), "goes from 0 s to 0 s"),
        (json.dumps(GOOD | {"end_time": 1e306}), r"goes from 0 s to 1e\+306 s"),
        (json.dumps(GOOD | {"start_time": 10**400}), "'start_time' is no number"),
        ('{"a":' * 100_000, "not a JSON object"),
        ("rank  document\n1     a\n", ":1: neither JSON lines nor CSV of hits"),
        ("document,label,start_time,end_time\na,x,0\n", ":2: 3 values, the header names 4"),
        ('document,label,start_time,end_time\n"a', "not CSV"),
    ],
)
def test_what_is_no_record_is_told_by_line(tmp_path, text, complaint):
    path = tmp_path / "bad"
    path.write_text(text)
    with pytest.raises(FormatError, match=complaint):
        read_found(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(FormatError, match="no such file; expected hits"):
        read_found(tmp_path / "none")
    with pytest.raises(FormatError, match="is no regular file; expected hits"):
        read_found(tmp_path)
