import json

import pytest

from tests.made_webs import add_motions, gestures

QUERY = "arm0.bvh@0.3:1.6"


@pytest.fixture(scope="module")
def built(tmp_path_factory, mocapidx):
    """A store of gestures and its web, built by the program."""
    folder = tmp_path_factory.mktemp("match")
    store = add_motions(folder / "arms.store", gestures(4))
    done = mocapidx("web", "build", store, "--output", folder / "arms.web", "--jobs", 1)
    assert done.returncode == 0, done.stderr
    assert "4 documents, 10 pairs (10 new)" in done.stderr
    return store, folder / "arms.web"


def test_records_are_hits_with_what_the_graph_knows(built, mocapidx):
    done = mocapidx("match", built[0], "--web", built[1], "--query", QUERY, "--format", "jsonl")
    records = [json.loads(line) for line in done.stdout.splitlines()]
    assert list(records[0])[:10] == [
        *("rank", "document", "start_frame", "end_frame", "start_time", "end_time"),
        *("source_start_frame", "source_end_frame", "cost", "label"),
    ]
    assert {"tier", "direct", "edges"} <= set(records[0])
    assert "Note: epsilon" in done.stderr


def test_options_reach_the_search(built, mocapidx):
    plain = ("match", built[0], "--web", built[1], "--query", QUERY)
    options = (
        *("--single-step", "--most", 9, "--same-overlap", 0.7, "--new-overlap", 0.3),
        *("--slack", 0, "--printed-overlap", "--printed-averaging", "--top", 1, "--quiet"),
    )
    done = mocapidx(*plain, "--epsilon", 0.2, *options, "--format", "csv")
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) <= 2
    assert done.stderr == ""


def test_the_sweep_marks_what_is_chosen(built, mocapidx):
    done = mocapidx("match", built[0], "--web", built[1], "--query", QUERY, "--sweep")
    lines = done.stdout.splitlines()
    assert lines[0].split() == ["epsilon", "matches", "tiers", "edges", "chosen", "plot"]
    assert sum(" < " in line for line in lines) == 1


def test_web_options_reach_the_build(built, mocapidx, tmp_path):
    web = tmp_path / "b.web"
    options = (
        *("--alpha", 0.05, "--slope", 2, "--chain", 0.2, "--bridge", 1, "--where", "seconds > 1"),
        *("--printed-region", "--printed-chains", "--printed-bridges", "--group-by", "n"),
        *("--name-pattern", "(?P<n>arm)", "--jobs", 1, "--quiet"),
    )
    done = mocapidx("web", "build", built[0], "--output", web, *options)
    assert (done.returncode, done.stderr) == (0, "")
    info = json.loads(mocapidx("web", "info", web, "--format", "jsonl").stdout)
    assert (info["alpha"], info["slope"], info["chain_seconds"]) == (0.05, 2, 0.2)
    assert (info["stop_below"], info["restart"], info["stop_at_chains"]) == (False, False, False)


@pytest.mark.parametrize(
    ("change", "code", "message"),
    [
        ({"--query": "arm0.bvh@0.3:0.4"}, 2, "from 0.25 s on"),
        ({"--query": "nobody.bvh"}, 3, "no document of"),
        ({"--web": "missing.web"}, 4, "no match web here; make one with 'mocapidx web build'"),
        ({"--web": "text.web"}, 4, "not a match web of mocapidx"),
        ({"--web": "other.web"}, 4, "a web of another store"),
        ({"--graph": "a.pdf"}, 2, "drawn ones .png or .svg"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(built, mocapidx, tmp_path, change, code, message):
    (tmp_path / "text.web").write_text("not a web, but long enough to be read as one" * 3)
    other = add_motions(tmp_path / "other.store", {"leg.bvh": gestures(1)["arm0.bvh"]})
    mocapidx("web", "build", other, "--output", tmp_path / "other.web", "--jobs", 1)
    options = {"--web": built[1], "--query": QUERY} | change
    words = [word for pair in options.items() for word in pair]
    done = mocapidx("match", built[0], *words, cwd=tmp_path)
    assert done.returncode == code
    assert len(done.stderr.splitlines()) == 1
    assert message in done.stderr
    assert done.stdout == ""


def test_a_store_without_poses_has_no_web(mocapidx, tmp_path):
    store = add_motions(tmp_path / "bare.store", gestures(2), poses=False)
    done = mocapidx("web", "build", store, "--output", tmp_path / "bare.web")
    assert done.returncode == 4
    assert "keeps no poses" in done.stderr
    assert len(done.stderr.splitlines()) == 1
