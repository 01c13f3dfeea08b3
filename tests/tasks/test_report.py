import json
import re
import shutil

import numpy as np
import pytest

from mocapidx.tasks.report_plan import plan_pieces

RATE = 30.0


def data_of(path):
    page = path.read_text()
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(found[1])


@pytest.fixture(scope="module")
def clip(fixtures_dir):
    return sorted((fixtures_dir / "clips/kickFrontRight").glob("*.amc"))[0]


@pytest.fixture(scope="module")
def hits(fixtures_store, clip, mocapidx, tmp_path_factory):
    path = tmp_path_factory.mktemp("hits") / "hits.jsonl"
    query = ("query", fixtures_store, "--example", clip, "--select", "F17,F20")
    done = mocapidx(*query, "--format", "jsonl", "--output", path)
    assert done.returncode == 0, done.stderr
    assert len(path.read_text().splitlines()) > 3
    return path


def test_hits_become_a_page(fixtures_store, hits, mocapidx, tmp_path):
    page = tmp_path / "hits.html"
    done = mocapidx("report", fixtures_store, hits, "--output", page)
    assert (done.returncode, done.stdout) == (0, "")
    records = [json.loads(line) for line in hits.read_text().splitlines()]
    assert done.stderr.startswith(f"{page}: {len(records)} hits of ")
    data = data_of(page)
    names = [each["name"] for each in data["documents"]]
    assert [
        (names[hit["document"]], hit["start"], hit["end"], hit["rank"], hit["cost"])
        for hit in data["hits"]
    ] == [
        tuple(record[key] for key in ("document", "start_frame", "end_frame", "rank", "cost"))
        for record in records
    ]
    assert names == sorted({record["document"] for record in records})


def test_a_page_is_the_same_each_time_and_from_any_form_of_records(
    fixtures_store, hits, clip, mocapidx, tmp_path
):
    query = ("query", fixtures_store, "--example", clip, "--select", "F17,F20", "--format", "csv")
    rows = mocapidx(*query).stdout
    (tmp_path / "hits.csv").write_text(rows)
    pages = []
    for records, options in ((hits, {}), (tmp_path / "hits.csv", {}), ("-", {"input": rows})):
        page = tmp_path / "page.html"
        done = mocapidx("report", fixtures_store, records, "--output", page, **options)
        assert done.returncode == 0, done.stderr
        pages.append(page.read_bytes())
    assert pages[0] == pages[1] == pages[2]
    done = mocapidx("report", fixtures_store, hits, "--output", "-", text=False)
    assert done.stdout == pages[0]


def test_hits_go_in_step_with_the_query(fixtures_store, hits, clip, mocapidx, tmp_path):
    page = tmp_path / "page.html"
    done = mocapidx("report", fixtures_store, hits, "--example", clip, "--output", page)
    assert done.returncode == 0, done.stderr
    data = data_of(page)
    (reference,) = data["references"]
    assert reference["name"] == f"query {clip.name}"
    for hit in data["hits"]:
        assert hit["reference"] == 0
        assert len(hit["steps"]) == hit["end"] - hit["start"]
        assert hit["steps"] == sorted(hit["steps"])
        assert (hit["steps"][0], hit["steps"][-1]) <= (reference["piece"]["frames"],) * 2


def test_without_a_query_the_best_hit_stands_for_it(fixtures_store, hits, mocapidx, tmp_path):
    page = tmp_path / "page.html"
    mocapidx("report", fixtures_store, hits, "--output", page)
    data = data_of(page)
    costs = [hit["cost"] for hit in data["hits"]]
    best = int(np.argmin(costs))
    assert [each["hit"] for each in data["references"]] == [best]
    assert [hit["reference"] for hit in data["hits"]] == [
        None if number == best else 0 for number in range(len(costs))
    ]


def test_only_the_best_are_shown_where_so_asked(fixtures_store, hits, mocapidx, tmp_path):
    page = tmp_path / "page.html"
    done = mocapidx("report", fixtures_store, hits, "--top", "2", "--output", page)
    assert "the best 2 are shown" in done.stderr
    assert [hit["rank"] for hit in data_of(page)["hits"]] == [1, 2]
    assert "the best 2 are shown" in page.read_text()


def test_the_motion_files_may_be_gone(clip, mocapidx, tmp_path):
    copy, store = tmp_path / "clip", tmp_path / "clip.store"
    copy.mkdir()
    for file in (clip, *clip.parent.parent.glob("*.asf"), *clip.parent.glob("*.asf")):
        shutil.copy(file, copy)
    mocapidx("index", copy, "--store", store, "--jobs", "1")
    shutil.rmtree(copy)
    row = {"document": clip.name, "start_time": 0.1, "end_time": 0.9, "label": "kick"}
    page = tmp_path / "page.html"
    done = mocapidx("report", store, "-", "--output", page, input=json.dumps(row))
    assert done.returncode == 0, done.stderr
    (hit,) = data_of(page)["hits"]
    assert (hit["start"], hit["end"], hit["rank"], hit["reference"]) == (3, 27, None, None)


def test_no_hits_give_a_page_that_says_so(fixtures_store, mocapidx, tmp_path):
    page = tmp_path / "page.html"
    done = mocapidx("report", fixtures_store, "-", "--output", page, input="")
    assert done.returncode == 0
    assert "There are no hits." in page.read_text()


def test_distance_functions_have_their_thresholds(fixtures_dir, fixtures_store, mocapidx, tmp_path):
    labels, templates = tmp_path / "labels.csv", tmp_path / "t.h5"
    rows = (fixtures_dir / "labels.csv").read_text().splitlines()
    chosen = [row for row in rows[1:] if row.startswith("clips/squat")]
    labels.write_text("\n".join([rows[0], *chosen, ""]))
    done = mocapidx("learn-mt", fixtures_store, "--labels", labels, "--output", templates)
    assert done.returncode == 0, done.stderr
    retrieve = ("retrieve", fixtures_store, "--templates", templates, "--class", "squat")
    rows = mocapidx(*retrieve, "--format", "jsonl").stdout
    page = tmp_path / "page.html"
    arguments = ("report", fixtures_store, "-", "--templates", templates, "--output", page)
    done = mocapidx(*arguments, input=rows)
    assert done.returncode == 0, done.stderr
    for document in data_of(page)["documents"]:
        (curve,) = document["curves"]
        assert 0 < curve["tau"] < 0.5


@pytest.mark.parametrize(
    ("record", "code", "says"),
    [
        ({"document": "none.amc"}, 3, "no document 'none.amc' in "),
        ({"document": "\x1b[2J"}, 3, r"no document '\x1b[2J' in "),
        ({"start_time": 5000.0, "end_time": 5001.0}, 3, "a record begins at 5000.00 s of "),
    ],
)
def test_records_of_another_store_are_one_line(
    record, code, says, fixtures_store, hits, mocapidx, tmp_path
):
    row = json.loads(hits.read_text().splitlines()[0]) | record
    page = tmp_path / "page.html"
    arguments = ("report", fixtures_store, "-", "--output", page)
    done = mocapidx(*arguments, input=json.dumps(row))
    assert (done.returncode, done.stderr.count("\n")) == (code, 1)
    assert done.stderr.startswith("Error: standard input: ")
    assert says in done.stderr
    assert "give the store that the records were made from" in done.stderr
    assert not page.exists()


def test_a_store_without_poses_is_one_line_that_says_what_to_do(clip, hits, mocapidx, tmp_path):
    store = tmp_path / "bare.store"
    mocapidx("index", clip, "--store", store, "--no-poses", "--jobs", "1")
    done = mocapidx("report", store, hits, "--output", tmp_path / "page.html")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert f"{store}: keeps no poses" in done.stderr
    assert "index the files into a new store without --no-poses" in done.stderr


def test_a_folder_that_is_not_there_is_one_line(fixtures_store, hits, mocapidx, tmp_path):
    page = tmp_path / "none" / "page.html"
    done = mocapidx("report", fixtures_store, hits, "--output", page)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_takes_are_kept_whole_where_they_are_small():
    wanted = [("a", 100, 200), ("b", 0, 50)]
    plan = plan_pieces(wanted, {"a": 1000, "b": 60}, RATE, 32_000_000)
    assert (plan.hits, plan.step, plan.whole) == (2, 1, True)
    assert plan.pieces == {"a": [(0, 1000)], "b": [(0, 60)]}


def test_of_long_takes_only_what_is_around_the_hits_is_kept():
    wanted = [("a", 5000, 5100), ("a", 1000, 1100), ("a", 1160, 1200), ("b", 5, 60)]
    plan = plan_pieces(wanted, {"a": 1_000_000, "b": 60}, RATE, 32_000_000)
    assert (plan.hits, plan.step, plan.whole) == (4, 1, False)
    assert plan.pieces == {"a": [(985, 1215), (4985, 5115)], "b": [(0, 60)]}


def test_every_other_pose_is_dropped_before_a_hit_is():
    wanted = [(f"{number}", 0, 900) for number in range(30)]
    frames = {name: 900 for name, _, _ in wanted}
    sizes = (5_000_000, 4_000_000, 2_000_000, 1_000_000)
    plans = [plan_pieces(wanted, frames, RATE, size) for size in sizes]
    assert [(plan.hits, plan.step) for plan in plans] == [(30, 2), (30, 2), (13, 2), (3, 2)]
    assert list(plans[2].pieces) == sorted(f"{number}" for number in range(13))


def test_a_hit_that_is_too_large_alone_is_kept_all_the_same():
    plan = plan_pieces([("a", 0, 90_000)], {"a": 90_000}, RATE, 1_000_000)
    assert (plan.hits, plan.step) == (1, 2)
