"""Work on a cluster of processes here: the same bytes, whatever happens to the workers."""

import os
import signal
import time
from operator import neg

import pytest

from mocapidx.errors import FormatError, MocapidxError, ParameterError
from mocapidx.tasks.index import IndexOptions, index_files
from tests.made_store import store_bytes

pytest.importorskip("distributed")

from mocapidx.tasks.cluster import cluster_mapping


@pytest.fixture(scope="module")
def map_fn():
    with cluster_mapping("local:3") as apply:
        yield apply


def die_once(marker):
    if not marker.exists():
        marker.write_text("")
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def die(_):
    os.kill(os.getpid(), signal.SIGKILL)


def fail_at_seven(number):
    if number == 7:
        raise FormatError("seven.amc: wrong")
    return number


def slow_start(number):
    time.sleep(0.2 if number == 0 else 0)
    return number


def test_results_come_in_the_order_of_the_items(map_fn):
    assert list(map_fn(neg, range(300))) == [-number for number in range(300)]
    assert list(map_fn(slow_start, range(20))) == list(range(20))
    assert list(map_fn(neg, [])) == []


def test_what_runs_ahead_of_the_consumer_is_bounded(map_fn):
    taken = []
    results = map_fn(neg, (taken.append(number) or number for number in range(1000)))
    assert next(results) == 0
    assert len(taken) < 50


def test_what_a_task_raises_is_raised_here_in_its_turn(map_fn):
    results = map_fn(fail_at_seven, range(20))
    assert [next(results) for _ in range(7)] == list(range(7))
    with pytest.raises(FormatError, match="seven"):
        next(results)


def test_a_killed_worker_costs_nothing_but_time(map_fn, tmp_path):
    (found,) = map_fn(die_once, [tmp_path / "died"])
    assert found != os.getpid()
    assert list(map_fn(neg, range(5))) == [0, -1, -2, -3, -4]


def test_a_task_that_kills_every_worker_is_one_line(map_fn):
    with pytest.raises(MocapidxError, match="died again and again") as caught:
        list(map_fn(die, [1]))
    assert "\n" not in str(caught.value)


def test_a_store_has_the_same_bytes(map_fn, fixtures_dir, tmp_path):
    clips = [fixtures_dir / "clips"]
    index_files(clips, tmp_path / "serial.store", IndexOptions(jobs=1))
    index_files(clips, tmp_path / "cluster.store", map_fn=map_fn)
    assert store_bytes(tmp_path / "cluster.store") == store_bytes(tmp_path / "serial.store")


def test_a_bad_file_is_passed_over_or_ends_the_run(map_fn, fixtures_dir, tmp_path):
    (tmp_path / "takes").mkdir()
    (tmp_path / "takes" / "a.bvh").write_text("nonsense")
    good = sorted(fixtures_dir.glob("bvh/**/*.bvh"))[0]
    (tmp_path / "takes" / "b.bvh").write_bytes(good.read_bytes())
    store = tmp_path / "s.store"
    with pytest.raises(FormatError, match=r"a\.bvh"):
        index_files([tmp_path / "takes"], store, map_fn=map_fn)
    summary = index_files([tmp_path / "takes"], store, IndexOptions(skip_bad=True), map_fn=map_fn)
    assert (summary.added, len(summary.refused)) == (1, 1)


@pytest.mark.parametrize(
    ("scheduler", "says"),
    [
        ("local:0", "is no scheduler"),
        ("local:", "is no scheduler"),
        ("somewhere", "is no scheduler"),
        ("tcp://127.0.0.1:9", "no scheduler answers there"),
        ("foo://127.0.0.1:9", "Dask can't connect to that"),
        ("tls://127.0.0.1:9", "Dask can't connect to that"),
        ("tcp://[::1", "is no scheduler|Dask can't connect to that"),
    ],
)
def test_what_is_no_scheduler_is_told(scheduler, says, monkeypatch):
    monkeypatch.setattr("mocapidx.tasks.cluster.CONNECT_SECONDS", 0.5)
    with pytest.raises(ParameterError, match=says), cluster_mapping(scheduler):
        pass


def test_a_cluster_that_can_not_be_started_here_is_one_line(monkeypatch):
    def fail(**_settings):
        raise RuntimeError("Cluster failed to start: no usable\ntemporary directory")

    monkeypatch.setattr("distributed.LocalCluster", fail)
    with (
        pytest.raises(MocapidxError, match="local:2: no cluster could be started here") as caught,
        cluster_mapping("local:2"),
    ):
        pass
    assert "\n" not in str(caught.value)
