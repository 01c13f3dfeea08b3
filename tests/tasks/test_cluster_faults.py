"""Clusters on which workers die, or the scheduler does: one line, and a store as before."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from mocapidx.errors import MocapidxError, ParameterError
from mocapidx.tasks import cluster as adapter
from mocapidx.tasks.cluster import cluster_mapping
from mocapidx.tasks.index import IndexOptions, index_files
from tests.made_cluster import made_cluster
from tests.made_store import store_bytes

distributed = pytest.importorskip("distributed")

PROGRAM = Path(sys.executable).parent / "mocapidx"


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Three worker processes of at most 400 MB."""
    with made_cluster(tmp_path_factory.mktemp("cluster"), 3, "400MB") as cluster:
        yield cluster


@pytest.fixture(scope="module")
def map_fn(cluster):
    with cluster_mapping(cluster.address) as apply:
        yield apply


@pytest.fixture(scope="module")
def takes(fixtures_dir):
    return fixtures_dir / "clips"


@pytest.fixture(scope="module")
def store(takes, tmp_path_factory):
    store = tmp_path_factory.mktemp("store") / "serial.store"
    index_files([takes], store, IndexOptions(jobs=1))
    return store


@pytest.fixture(scope="module")
def templates(store, tmp_path_factory, mocapidx):
    path = tmp_path_factory.mktemp("templates") / "learned.h5"
    classes = ("--class", "squat", "--class", "walk")
    done = mocapidx("learn-mt", store, "--labels-from", "folder", *classes, "--output", path)
    assert done.returncode == 0, done.stderr
    return path


def started(*arguments):
    """Run a command in a group of its own."""
    return subprocess.Popen(
        [PROGRAM, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def group_of(process):
    """The processes of its group that are not over."""
    found = []
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, group = place.read_text().rsplit(")", 1)[1].split()[:3]
        except OSError:
            continue
        if int(group) == process.pid and state != "Z":
            found.append(int(place.parent.name))
    return found


def until(holds, seconds=30):
    """Wait for something to be so."""
    end = time.monotonic() + seconds
    while not (found := holds()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return found


def worker_pids(cluster):
    with distributed.Client(cluster.address) as client:
        return list(client.run(os.getpid).values())


class DiesOnce:
    """A function whose first caller is killed."""

    def __init__(self, function, marker):
        self.function, self.marker = function, marker

    def __call__(self, item):
        if not self.marker.exists():
            self.marker.write_text("")
            os.kill(os.getpid(), signal.SIGKILL)
        return self.function(item)


def take_all_memory(_):
    kept = []
    while True:
        kept.append(b"x" * (20 << 20))
        time.sleep(0.01)


@dataclass
class SeenHere:
    """An item whose file only the process that made it can see."""

    place: Path
    process: int

    @property
    def path(self):
        return self.place if os.getpid() == self.process else Path("/nowhere/take.bvh")


def test_a_worker_killed_under_its_task_costs_nothing_but_time(map_fn, takes, store, tmp_path):
    marker = tmp_path / "died"

    def one_dies(function, items):
        return map_fn(DiesOnce(function, marker), items)

    index_files([takes], tmp_path / "s.store", map_fn=one_dies)
    assert marker.exists()
    assert store_bytes(tmp_path / "s.store") == store_bytes(store)


def test_workers_killed_under_commands_cost_nothing_but_time(
    cluster, takes, store, templates, mocapidx, tmp_path
):
    made = tmp_path / "s.store"
    running = started("index", takes, "--store", made, "--scheduler", cluster.address, "--quiet")
    until((made / "LOCK").exists)
    os.kill(worker_pids(cluster)[0], signal.SIGKILL)
    assert running.communicate(timeout=60) == ("", "")
    assert running.returncode == 0
    assert store_bytes(made) == store_bytes(store)
    rows = ("annotate", takes, "--templates", templates, "--format", "jsonl")
    running = started(*rows, "--scheduler", cluster.address)
    os.kill(worker_pids(cluster)[1], signal.SIGKILL)
    output, said = running.communicate(timeout=60)
    serial = mocapidx(*rows, "--jobs", 1)
    assert (output, said, running.returncode) == (serial.stdout, serial.stderr, 0)


def test_workers_out_of_memory_are_one_line_that_names_the_file(map_fn, tmp_path):
    take = tmp_path / "large.bvh"
    take.write_text("")
    with pytest.raises(
        MocapidxError, match=r"again over \S+large\.bvh, perhaps for want of memory"
    ):
        list(map_fn(take_all_memory, [SeenHere(take, os.getpid())]))
    assert list(map_fn(abs, [-1, -2])) == [1, 2]


def test_a_bad_file_ends_a_command_or_is_passed_over(cluster, mocapidx, fixtures_dir, tmp_path):
    folder = tmp_path / "takes"
    folder.mkdir()
    (folder / "bad.bvh").write_text("nonsense")
    (folder / "good.bvh").write_bytes(next(fixtures_dir.rglob("*.bvh")).read_bytes())
    command = ("index", folder, "--store", tmp_path / "s.store", "--scheduler", cluster.address)
    done = mocapidx(*command)
    assert done.returncode == 3
    assert "bad.bvh" in done.stderr
    assert done.stderr.count("\n") == 1
    assert mocapidx("verify", tmp_path / "s.store").returncode in (0, 4)
    done = mocapidx(*command, "--skip-bad")
    assert done.returncode == 5
    assert "1 added" in done.stderr


def test_a_lost_scheduler_is_one_line_and_the_store_as_it_was(takes, tmp_path):
    made = tmp_path / "s.store"
    index_files([takes / "squat"], made, IndexOptions(root=takes))
    before = store_bytes(made)
    (made / "LOCK").unlink(missing_ok=True)
    with made_cluster(tmp_path, 1) as cluster:
        pids = worker_pids(cluster)
        command = ("index", takes, "--store", made, "--scheduler", cluster.address)
        running = started(*command)
        until((made / "LOCK").exists)
        for pid in pids:  # so that it is in the middle
            os.kill(pid, signal.SIGSTOP)
        time.sleep(0.5)
        cluster.kill()
        output, said = running.communicate(timeout=60)
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
    assert (running.returncode, output) == (1, "")
    assert said == (
        f"Error: {cluster.address}: the scheduler was lost; what was committed stays, run again "
        "to continue\n"
    )
    assert store_bytes(made) == before
    with pytest.raises(ParameterError, match="no scheduler answers"), in_time(cluster.address):
        pass


@contextmanager
def in_time(address):
    """Connect, and don't wait as long as people do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(adapter, "CONNECT_SECONDS", 1)
        with cluster_mapping(address) as apply:
            yield apply


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_leaves_one_line_and_no_process(takes, tmp_path, number):
    made = tmp_path / "s.store"
    running = started("index", takes, "--store", made, "--scheduler", "local:2")
    until((made / "LOCK").exists)
    os.killpg(running.pid, number)
    output, said = running.communicate(timeout=60)
    assert (running.returncode, output) == (128 + number, "")
    assert said.startswith("Error: ")
    assert said.count("\n") == 1
    until(lambda: not group_of(running), 10)


def test_workers_of_another_version_are_told(cluster, monkeypatch):
    monkeypatch.setattr(adapter, "version", lambda name: "0.0.1")
    adapter._own_version.cache_clear()
    try:
        with (
            pytest.raises(ParameterError, match=r"needs mocapidx 0\.0\.1 as here, it has mocap"),
            cluster_mapping(cluster.address),
        ):
            pass
    finally:
        adapter._own_version.cache_clear()


def test_a_worker_of_another_version_that_joins_later_is_told():
    with pytest.raises(MocapidxError, match=r"needs mocapidx 9\.9 as here, it has mocapidx"):
        adapter._work("9.9", abs, [1])


def test_workers_without_mocapidx_are_told(tmp_path):
    hidden = "import sys; sys.modules['mocapidx'] = None"
    with (
        made_cluster(tmp_path, 1, preload=[hidden]) as cluster,
        pytest.raises(ParameterError, match="it has none; install the same version") as caught,
        cluster_mapping(cluster.address),
    ):
        pass
    assert "\n" not in str(caught.value)


def test_a_scheduler_without_workers_is_told(tmp_path):
    with (
        made_cluster(tmp_path, 0) as cluster,
        pytest.raises(ParameterError, match="no worker has joined"),
        in_time(cluster.address),
    ):
        pass


def test_a_file_that_only_the_client_sees_is_told(map_fn, tmp_path):
    take = tmp_path / "take.bvh"
    take.write_text("")
    with pytest.raises(ParameterError, match=r"take\.bvh: the worker on \S+ can't see it"):
        list(map_fn(repr, [SeenHere(take, os.getpid())]))
    take.unlink()  # gone for all: the reader has the last word
    assert len(list(map_fn(repr, [SeenHere(take, os.getpid())]))) == 1


def test_workers_that_join_later_get_work_too(monkeypatch):
    class Task:
        def __init__(self, group):
            self.group = group

        def result(self, timeout):
            under_way.remove(self)
            return [adapter._Answer(True, item) for item in self.group]

    class Client:
        threads = 1

        def nthreads(self):
            return {"tcp://one:1": self.threads}

        def submit(self, work, version, function, group, pure):
            under_way.append(Task(group))
            return under_way[-1]

        def cancel(self, tasks, force):
            pass

    monkeypatch.setattr(adapter, "LOOK_SECONDS", 0.0)
    client, under_way = Client(), []
    results = adapter._results(client, "tcp://head:8786", abs, range(1000))
    assert next(results) == 0
    assert len(under_way) == adapter.AHEAD - 1
    client.threads = 16
    assert next(results) == 1
    assert len(under_way) == 16 * adapter.AHEAD - 1
    client.threads = 1
    assert list(results) == list(range(2, 1000))


def test_waiting_for_workers_that_are_all_gone_ends():
    class Task:
        def result(self, timeout):
            raise TimeoutError

    class Client:
        def __init__(self, turns):
            self.turns = turns

        def nthreads(self):
            self.turns -= 1
            return {"tcp://one:1": 1} if self.turns else {}

    client = Client(3)
    with pytest.raises(MocapidxError, match="no worker is left; what was committed stays"):
        adapter._awaited(client, "tcp://head:8786", Task())
    assert client.turns == 0
