import csv
import io
import json
import subprocess
import sys

import pytest


def records(done):
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_the_short_form_prints_records_in_the_order_of_the_contract(mocapidx, fixtures_store):
    done = mocapidx(
        "query", fixtures_store, "--steps-of", "F20", "0 1@0.5: 0", "--format", "jsonl", "--mirror"
    )
    found = records(done)
    assert found
    assert list(found[0]) == [
        *("rank", "document", "start_frame", "end_frame", "start_time", "end_time"),
        *("source_start_frame", "source_end_frame", "cost", "label", "mirrored"),
    ]
    assert {row["label"] for row in found} == {"F20 0 1@0.5: 0"}


def test_a_shipped_scene_by_its_name(mocapidx, fixtures_store):
    done = mocapidx("query", fixtures_store, "--scene", "kick-then-punch", "--format", "jsonl")
    assert [row["document"] for row in records(done)] == [
        "bvh/ann_take.bvh",
        "takes/ann_take_120.amc",
        "takes/dov_take_120.amc",
    ]


def test_explanations_go_beside_the_table_and_into_the_records(mocapidx, fixtures_store):
    query = ("query", fixtures_store, "--example", "takes/ann_take_120.amc@17:19")
    query += ("--select", "F17,F20", "--explain", "--top", "2")
    table = mocapidx(*query)
    assert table.stdout.count("\n") == 1 + table.stderr.count(" s\n")
    assert "step 1" in table.stderr
    rows = records(mocapidx(*query, "--format", "jsonl"))
    assert rows[0]["steps"][0]["frames"] > 0
    lines = mocapidx(*query, "--format", "csv").stdout
    cells = list(csv.DictReader(io.StringIO(lines)))
    assert json.loads(cells[0]["steps"]) == rows[0]["steps"]


def test_no_hit_is_exit_0_and_explained_on_stderr(mocapidx, fixtures_store):
    done = mocapidx(
        *("query", fixtures_store, "--steps-of", "F20,F37", "00 10 00 3x(11 00)", "--explain"),
        *("--format", "jsonl"),
    )
    assert (done.returncode, done.stdout) == (0, "")
    assert "loses the last candidates" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        ([], 2, "a query is one of"),
        (["--steps-of", "F20", "012"], 2, "is no step"),
        (["--steps-of", "F20", "0 1", "--where", "actor ="], 2, "must read like"),
        (
            ["--steps-of", "F20", "0 1", "--mode", "mismatch", "--mismatch-at", "x"],
            2,
            "such as 2,4",
        ),
        (["--scene", "kick"], 3, "shipped are kick-then-punch"),
        (["--pattern", "nowhere.toml"], 3, "no such file"),
        (["--example", "nowhere.amc"], 3, "no such file, and no document"),
        (["--example", "a", "--select", "auto", "--mirror"], 2, "--select auto takes one"),
    ],
)
def test_wrong_queries_are_one_line(mocapidx, fixtures_store, arguments, code, says):
    done = mocapidx("query", fixtures_store, *arguments)
    assert done.returncode == code
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert says in done.stderr


def test_facts_are_taken_from_names_and_listed(mocapidx, fixtures_dir, tmp_path):
    store, pattern = tmp_path / "s.store", "(?P<actor>ann|dov)_(?P<class>[A-Za-z]+)"
    clips = fixtures_dir / "clips" / "squat"
    assert mocapidx("index", clips, "--store", store, "--name-pattern", pattern).returncode == 0
    done = mocapidx("info", store, "--where", "actor = ann", "--format", "jsonl")
    rows = records(done)
    assert [(row["actor"], row["class"]) for row in rows] == [("ann", "squat")] * 2
    table = mocapidx("info", store, "--where", "class = squat and not actor = ann").stdout
    assert "actor" in table.splitlines()[0]
    assert table.count("dov") >= 2


def test_a_plain_query_imports_nothing_that_it_has_no_use_for(fixtures_store):
    code = (
        "import sys\nfrom mocapidx_cli.main import main\nsys.argv[0] = 'mocapidx'\n"
        "try:\n    main()\nfinally:\n    sys.stderr.write('\\n'.join(sys.modules))"
    )
    query = ("query", str(fixtures_store), "--example", "takes/ann_take_120.amc@17:19")
    done = subprocess.run(
        [sys.executable, "-c", code, *query, "--select", "F17,F18,F20"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0
    imported = done.stderr.split()
    heavy = ("templates", "alignment", "reports", "tasks.query_pattern", "queries.scene")
    unused = tuple(f"mocapidx.{name}" for name in (*heavy, "tasks.relax", "tasks.oneshot"))
    assert not [name for name in imported if name.startswith((*unused, "numpy.ma.", "scipy"))]
