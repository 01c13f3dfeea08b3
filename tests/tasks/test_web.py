import os

import numpy as np
import pytest

from mocapidx.errors import Interrupted, ParameterError, StoreError, WriteError
from mocapidx.graphs import pair_paths
from mocapidx.graphs.paths import PathRules
from mocapidx.store.read import open_store
from mocapidx.store.web import read_web
from mocapidx.tasks.open_web import open_web
from mocapidx.tasks.web import WebOptions, path_rules, web_info
from mocapidx.tasks.web import build_web as build_in_processes
from tests.made_webs import add_motions, gesture, gestures


def build_web(*arguments, **options):
    """Build in this process: others would take longer to start than to finish."""
    return build_in_processes(*arguments, map_fn=map, **options)


@pytest.fixture
def store(tmp_path):
    return add_motions(tmp_path / "arms.store", gestures(4))


def test_a_web_holds_every_pair(store, tmp_path):
    summary = build_web(store, tmp_path / "arms.web")
    assert (summary.documents, summary.pairs, summary.new_pairs) == (4, 10, 10)
    info = web_info(tmp_path / "arms.web")
    assert (info["documents"], info["pairs"], info["frames"]) == (4, 10, 240)
    assert info["path_cells"] == summary.path_cells > 0
    assert info["grid_cells"] == 6 * 3600 + 4 * 1800


def test_one_run_and_several_give_the_same_bytes(store, tmp_path):
    whole = tmp_path / "whole.web"
    grown = tmp_path / "grown.web"
    part = tmp_path / "part.store"
    motions = gestures(4)
    add_motions(part, {name: motions[name] for name in list(motions)[:2]})
    build_web(part, grown)
    add_motions(part, {name: motions[name] for name in list(motions)[2:]})
    summary = build_web(part, grown)
    assert summary.new_pairs == 7
    build_web(store, whole)
    assert grown.read_bytes() == whole.read_bytes()
    assert build_web(part, grown).new_pairs == 0


def test_any_number_of_processes_gives_the_same_bytes(store, tmp_path, monkeypatch):
    two, three = tmp_path / "two.web", tmp_path / "three.web"
    build_in_processes(store, two)  # this process has threads, so it leaves the work to others
    monkeypatch.setattr("mocapidx.tasks.web.JOB_CELLS", 1)
    monkeypatch.setattr("mocapidx.tasks.web_building.BLOCK_FRAMES", 60)
    before = dict(os.environ)
    build_in_processes(store, three, WebOptions(jobs=3))
    assert two.read_bytes() == three.read_bytes()
    assert dict(os.environ) == before


def test_one_process_and_two_give_the_same_bytes(store, tmp_path, mocapidx):
    for jobs in (1, 2):
        web = tmp_path / f"{jobs}.web"
        done = mocapidx("web", "build", store, "--output", web, "--jobs", jobs)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "1.web").read_bytes() == (tmp_path / "2.web").read_bytes()


def test_what_is_gone_from_the_store_leaves_the_web(store, tmp_path):
    web = tmp_path / "arms.web"
    build_web(store, web)
    build_web(store, web, WebOptions(where="document = arm1*"))
    assert web_info(web)["documents"] == 1
    build_web(store, tmp_path / "one.web", WebOptions(where="document = arm1*"))
    assert web.read_bytes() == (tmp_path / "one.web").read_bytes()


def test_only_documents_of_one_group_are_compared(store, tmp_path):
    options = WebOptions(group_by="half", name_pattern="arm(?P<half>[01])")
    summary = build_web(store, tmp_path / "arms.web", options)
    assert (summary.documents, summary.pairs) == (4, 2)
    with pytest.raises(ParameterError, match="no document has 'actor'"):
        build_web(store, tmp_path / "b.web", WebOptions(group_by="actor"))
    with pytest.raises(ParameterError, match="give that too"):
        build_web(store, tmp_path / "b.web", WebOptions(name_pattern="(?P<a>.)"))


def test_other_rules_make_another_web(store, tmp_path):
    web = tmp_path / "arms.web"
    build_web(store, web)
    before = web_info(web)
    rules = path_rules(alpha=0.05, stop_below=False)
    summary = build_web(store, web, WebOptions(rules=rules))
    assert summary.changed_rules
    assert summary.new_pairs == 10
    assert web_info(web)["alpha"] == 0.05
    assert web_info(web)["path_cells"] != before["path_cells"]


def test_long_documents_are_compared_in_sections(tmp_path, monkeypatch):
    motions = {"a.bvh": np.concatenate([gesture(seed=n) for n in range(4)]), "b.bvh": gesture()}
    store = add_motions(tmp_path / "a.store", motions)
    build_web(store, tmp_path / "whole.web")
    monkeypatch.setattr(pair_paths, "SECTION", 100)
    monkeypatch.setattr(pair_paths, "OVERLAP", 70)
    build_web(store, tmp_path / "cut.web")
    found = []
    for name in ("whole.web", "cut.web"):
        with open_store(store) as snapshot:
            web, _ = open_web(tmp_path / name, snapshot)
        cells = [
            paths.paths.cells if role == 0 else paths.paths.cells[:, ::-1]
            for other, role, paths in web.pieces("b.bvh")
            if other == "a.bvh"
        ]
        found.append({tuple(cell) for cell in np.concatenate(cells).tolist()})
    assert len(read_web(tmp_path / "cut.web").pieces) > len(read_web(tmp_path / "whole.web").pieces)
    assert len(found[0] & found[1]) > 0.9 * len(found[0])


def test_an_interrupted_build_goes_on_where_it_was(store, tmp_path, monkeypatch):
    web, whole = tmp_path / "arms.web", tmp_path / "whole.web"
    monkeypatch.setattr("mocapidx.tasks.web_building.BLOCK_FRAMES", 60)
    done = []

    def stop(progress):
        done.append(progress.cells)
        if len(done) == 5:
            raise Interrupted(15)

    with pytest.raises(Interrupted) as stopped:
        build_web(store, web, WebOptions(batch_cells=5400), progress=stop)
    held = web_info(web)["pairs"]
    assert 0 < held < 10
    assert str(stopped.value) == f"stopped after {held} pairs; run again to continue"
    assert build_web(store, web).new_pairs == 10 - held
    build_web(store, whole)
    assert web.read_bytes() == whole.read_bytes()


def test_a_web_that_can_not_be_written_stays_as_it_was(store, tmp_path, monkeypatch):
    web = tmp_path / "arms.web"
    build_web(store, web, WebOptions(where="document = arm1*"))
    before = web.read_bytes()

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", refuse)
    with pytest.raises(WriteError, match="no space left"):
        build_web(store, web)
    assert web.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir() if path.suffix == ".tmp"] == []


def test_a_store_without_poses_is_refused(tmp_path):
    store = add_motions(tmp_path / "bare.store", gestures(2), poses=False)
    with pytest.raises(StoreError, match="keeps no poses"):
        build_web(store, tmp_path / "bare.web")


@pytest.mark.parametrize("place", [10, 200, -100, -40, -5])
def test_any_changed_byte_is_noticed(store, tmp_path, place):
    web = tmp_path / "arms.web"
    build_web(store, web)
    data = bytearray(web.read_bytes())
    data[place] ^= 1
    web.write_bytes(data)
    with pytest.raises(StoreError, match="web"):
        web_info(web)
    with pytest.raises(StoreError, match="web"):
        build_web(store, web)


def test_a_web_knows_its_store(store, tmp_path):
    web = tmp_path / "arms.web"
    build_web(store, web)
    other = add_motions(tmp_path / "other.store", {"leg.bvh": gesture(seed=7)})
    with open_store(other) as snapshot, pytest.raises(StoreError, match="web of another store"):
        open_web(web, snapshot)
    add_motions(store, {"leg.bvh": gesture(seed=7)})
    with open_store(store) as snapshot:
        assert open_web(web, snapshot)[1] == 1


def test_an_empty_choice_is_an_error(store, tmp_path):
    with pytest.raises(ParameterError, match="no document that meets"):
        build_web(store, tmp_path / "a.web", WebOptions(where="document = nobody"))


def test_the_rules_of_a_web_are_the_defaults_of_the_library(store, tmp_path):
    build_web(store, tmp_path / "arms.web")
    held = read_web(tmp_path / "arms.web")
    assert PathRules(**held.rules) == PathRules()
