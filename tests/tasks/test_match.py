import json

import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError, StoreError
from mocapidx.graphs.refine import best_path
from mocapidx.store.read import open_store
from mocapidx.tasks.match import MatchOptions, match_records, match_store, sweep_records
from mocapidx.tasks.match_graphs import read_graph, save_graph
from mocapidx.tasks.web import build_web as build_in_processes
from tests.made_webs import add_motions, gesture, gestures
from tests.naive_warping import warp


def build_web(store, web):
    """Build in this process: others would take longer to start than to finish."""
    return build_in_processes(store, web, map_fn=map)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A store of gestures and its web."""
    folder = tmp_path_factory.mktemp("matches")
    store = add_motions(folder / "arms.store", gestures(5))
    build_web(store, folder / "arms.web")
    return store, folder / "arms.web"


QUERY = "arm0.bvh@0.3:1.6"


def test_hits_are_the_nodes_of_the_graph_by_their_distances(built):
    matches = match_store(*built, QUERY, MatchOptions(epsilon=0.12))
    records = match_records(matches)
    assert {record["document"] for record in records} >= {"arm1.bvh", "arm2.bvh", "arm3.bvh"}
    costs = [record["cost"] for record in records]
    assert costs == sorted(costs)
    for record in records:
        assert record["direct"] is None or record["cost"] <= record["direct"]
        assert record["label"] == "arm0.bvh"
        assert record["edges"] >= 1
        assert abs((record["end_time"] - record["start_time"]) - 1.3) < 0.6


def test_a_single_step_stops_at_the_first_tier(built):
    matches = match_store(*built, QUERY, MatchOptions(epsilon=0.12, single_step=True))
    assert {record["tier"] for record in match_records(matches)} == {1}


def test_epsilon_is_chosen_where_none_is_given(built):
    matches = match_store(*built, QUERY)
    assert any("epsilon" in remark for remark in matches.remarks)
    records = sweep_records(matches.steps)
    chosen = [record for record in records if record["chosen"]]
    assert [record["epsilon"] for record in chosen] == [matches.graph.epsilon]
    assert chosen[0]["matches"] == len(matches.hits)


@pytest.mark.parametrize("suffix", ["json", "graphml"])
def test_graphs_are_written_and_read(built, tmp_path, suffix):
    path = tmp_path / f"arms.{suffix}"
    matches = match_store(*built, QUERY, MatchOptions(epsilon=0.12), graph=path)
    again = read_graph(path)
    assert again.nodes == matches.graph.nodes
    assert [edge.cost for edge in again.edges] == [edge.cost for edge in matches.graph.edges]


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_graphs_are_drawn(built, tmp_path, suffix):
    paths = [tmp_path / f"{n}.{suffix}" for n in range(2)]
    for path in paths:
        match_store(*built, QUERY, MatchOptions(epsilon=0.12), graph=path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert paths[0].read_bytes()[:5] in (b"\x89PNG\r", b"<?xml")


def test_a_graph_of_the_query_alone_is_drawn_too(built, tmp_path):
    match_store(*built, QUERY, MatchOptions(epsilon=0.001), graph=tmp_path / "one.png")
    assert (tmp_path / "one.png").stat().st_size > 1000


def test_no_match_says_what_the_nearest_would_cost(built):
    matches = match_store(*built, QUERY, MatchOptions(epsilon=0.001))
    assert not matches.hits
    assert "the nearest costs" in matches.warnings[0]


def test_no_path_says_so(tmp_path):
    store = add_motions(tmp_path / "one.store", {"arm.bvh": gesture(frames=40)})
    build_web(store, tmp_path / "one.web")
    matches = match_store(store, tmp_path / "one.web", "arm.bvh")
    assert not matches.hits
    assert "no path of the web leads through the whole query" in matches.warnings[0]


def test_too_many_matches_are_cut_off_with_a_word(built):
    matches = match_store(*built, QUERY, MatchOptions(epsilon=0.5, most=2))
    assert len(matches.hits) == 2
    assert "more than 2 matches" in matches.warnings[0]


@pytest.mark.parametrize(
    ("query", "error", "message"),
    [
        ("arm0.bvh@0.3:0.4", ParameterError, "lasts 0.10 s; a match web answers from 0.25 s"),
        ("nobody.bvh", FormatError, "no document of"),
        ("arm0.bvh@5:6", ParameterError, "lasts 2.00 s"),
        ("arm0.bvh@a:b", ParameterError, "a part of it is @START:END"),
    ],
)
def test_bad_queries_are_one_line(built, query, error, message):
    with pytest.raises(error, match=message):
        match_store(*built, query)


def test_a_document_that_the_web_lacks(built, tmp_path):
    store = add_motions(tmp_path / "arms.store", gestures(5))
    add_motions(store, {"leg.bvh": gesture(seed=8)})
    with pytest.raises(ParameterError, match="not in the web"):
        match_store(store, built[1], "leg.bvh")
    matches = match_store(store, built[1], QUERY, MatchOptions(epsilon=0.12))
    assert any("1 document of the store not in the web" in remark for remark in matches.remarks)


def test_a_graph_file_of_unknown_kind_is_refused_before_the_search(tmp_path):
    with pytest.raises(ParameterError, match=r"match graphs are \.json"):
        match_store(tmp_path, tmp_path, QUERY, graph=tmp_path / "a.pdf")


def test_what_is_no_graph_file_is_refused(tmp_path):
    (tmp_path / "a.json").write_text("{}")
    with pytest.raises(FormatError, match=r"a\.json: not a match graph"):
        read_graph(tmp_path / "a.json")
    with pytest.raises(FormatError, match="no such file"):
        read_graph(tmp_path / "b.json")


def test_a_store_of_a_higher_rate_is_searched_at_thirty_and_aligned_at_its_own(tmp_path):
    store = add_motions(tmp_path / "fast.store", gestures(4, rate=60.0), rate=60.0)
    build_web(store, tmp_path / "fast.web")
    slow = add_motions(tmp_path / "slow.store", gestures(4))
    build_web(slow, tmp_path / "slow.web")
    fast = match_store(store, tmp_path / "fast.web", QUERY, MatchOptions(epsilon=0.12))
    assert fast.graph.rate == 60.0
    assert (fast.graph.nodes[0].start_frame, fast.graph.nodes[0].end_frame) == (18, 96)
    with open_store(store) as snapshot:
        save_graph(tmp_path / "fast.json", fast.graph, snapshot)
    assert json.loads((tmp_path / "fast.json").read_text())["rate"] == 60.0
    others = match_store(slow, tmp_path / "slow.web", QUERY, MatchOptions(epsilon=0.12))
    assert {hit.document for hit in fast.hits} == {hit.document for hit in others.hits}


def test_the_best_path_in_a_wide_band_is_that_of_the_whole_grid():
    random = np.random.default_rng(4)
    grid = random.random((14, 11))
    line = np.array([(i, round(i * 10 / 13)) for i in range(14)], dtype=np.int64)
    path = best_path(grid, line, 14)
    assert grid[*path.T].sum() == pytest.approx(warp(grid, lambda row, column: True)[0])
    narrow = best_path(grid, line, 1)
    assert grid[*narrow.T].sum() >= grid[*path.T].sum()


def test_a_damaged_web_is_refused(built, tmp_path):
    data = bytearray(built[1].read_bytes())
    data[len(data) // 2] ^= 4
    (tmp_path / "bad.web").write_bytes(data)
    with pytest.raises(StoreError, match="damaged"):
        match_store(built[0], tmp_path / "bad.web", QUERY)
