import csv
import io
import json
import os
import subprocess
from pathlib import Path

import pytest

from mocapidx.errors import WriteError
from mocapidx.model import Hit
from mocapidx.printable import shown
from mocapidx.tasks.records import HIT_COLUMNS, hit_record, render_records, save_text

HIT = Hit("kick/ann.amc", 10, 25, 1 / 3, 5 / 6, 40, 100, 0.12345, "kick")


def lines(records, row_format):
    return list(render_records(records, row_format, HIT_COLUMNS))


def test_a_table_of_hits_has_what_people_need_and_fits_a_narrow_terminal():
    head, row = lines([hit_record(HIT, 1)], "table")
    assert head == "rank  document      start s  end s  from frame  to frame   cost"
    assert row == "   1  kick/ann.amc    0.333  0.833          40       100  0.123"


def test_an_empty_table_is_its_head():
    assert lines([], "table") == ["rank  document  start s  end s  from frame  to frame  cost"]


def test_csv_without_hits_has_the_header_of_csv_with_hits():
    (empty,) = lines([], "csv")
    header, row = lines([hit_record(HIT, 1)], "csv")
    assert empty == header == ",".join(HIT_COLUMNS)
    values = next(csv.DictReader(io.StringIO(f"{header}\n{row}")))
    assert (values["start_frame"], values["end_frame"], values["label"]) == ("10", "25", "kick")


def test_json_lines_have_every_key_in_its_order():
    (line,) = lines([hit_record(HIT, 1)], "jsonl")
    assert list(json.loads(line)) == list(HIT_COLUMNS)
    assert json.loads(line)["start_time"] == 0.333333


def test_a_label_is_shown_where_rows_are_not_ranked():
    record = {"document": "a", "start_time": 0.5, "label": "walk", "cost": None}
    assert list(render_records([record], "table", list(record))) == [
        "document  start s  label  cost",
        "a           0.500  walk      -",
    ]


def test_yes_and_no_are_words_for_people_and_true_and_false_for_programs():
    records = [{"sure": True}, {"sure": False}]
    assert list(render_records(records, "table", ["sure"])) == ["sure", " yes", "  no"]
    assert list(render_records(records, "jsonl", ["sure"])) == ['{"sure": true}', '{"sure": false}']


@pytest.mark.parametrize("row_format", ["table", "csv"])
def test_names_can_not_break_a_line(row_format):
    record = {"document": "a\nb\x1b[2J", "label": "=1+1"}
    assert len(list(render_records([record], row_format, list(record)))) == 2


NASTY = (
    "<script>alert(1)</script>",
    "a\nb\r\nc",
    "a\tb",
    "nul\0",
    "\ud800 \udcff",
    "\u202eevil\u2066",
    "\x1b[2J\x9b\u2028",
    "=cmd|' /C calc'!A0",
    "+1",
    "-1",
    "@x",
    "../../etc/x",
    "/abs",
    "CON",
    "é" * 150,
    'a,"b",c',
)


@pytest.mark.parametrize("name", NASTY, ids=ascii)
def test_whatever_a_document_is_called_records_stay_one_line_each_and_tell_it(name, tmp_path):
    record = {"document": name, "label": name, "start_time": 0.5}
    for row_format in ("table", "csv", "jsonl"):
        save_text(render_records([record], row_format, list(record)), tmp_path / row_format)
        text = (tmp_path / row_format).read_bytes().decode("utf-8")
        assert text.replace("\n", "").isprintable()
        assert text.count("\n") == (1 if row_format == "jsonl" else 2)
    assert json.loads((tmp_path / "jsonl").read_text()) == record
    with (tmp_path / "csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert row["document"][:1] not in {*"=+-@"}
    assert row["document"].lstrip("'") == shown(name, None)


def test_a_file_is_written_whole_and_a_pipe_or_a_device_as_it_comes(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE) as reader:
        save_text(["one", "two"], pipe)
        assert reader.stdout.read() == b"one\ntwo\n"
    save_text(["one"], Path(os.devnull))
    save_text(["one"], tmp_path / "file")
    assert (tmp_path / "file").read_text() == "one\n"
    assert sorted(os.listdir(tmp_path)) == ["file", "pipe"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
def test_a_full_device_is_an_error_of_writing():
    with pytest.raises(WriteError, match=r"/dev/full: could not be written .no space left"):
        save_text(["one"], Path("/dev/full"))
