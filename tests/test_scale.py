"""The recipes of docs/scale.md do what the page says, as far as that can be done on one machine."""

import fcntl
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

PAGE = (Path(__file__).parent.parent / "docs" / "scale.md").read_text(encoding="utf-8")
PROGRAMS = Path(sys.executable).parent


def block(kind, beginning):
    """The only block of a kind that begins like this."""
    blocks = re.findall(rf"^ *```{kind}\n(.*?)^ *```$", PAGE, re.M | re.S)
    (found,) = (text for text in blocks if text.lstrip().startswith(beginning))
    return found


def run(folder, *command, **variables):
    done = ended(folder, *command, **variables)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def ended(folder, *command, **variables):
    return subprocess.run(
        command,
        cwd=folder,
        env=with_programs(folder, variables),
        capture_output=True,
        text=True,
        timeout=240,
    )


def with_programs(folder, variables=()):
    path = f"{PROGRAMS}{os.pathsep}{os.environ['PATH']}"
    return os.environ | {"PATH": path, "HOME": str(folder)} | dict(variables)


@pytest.fixture
def place(fixtures_dir, tmp_path):
    """An archive of two folders, and above them the skeletons of both."""
    for part in ("squat", "walk"):
        shutil.copytree(fixtures_dir / "clips" / part, tmp_path / "archive" / part)
    for skeleton in fixtures_dir.glob("clips/*.asf"):
        shutil.copy(skeleton, tmp_path / "archive")
    return tmp_path


def documents(folder, store):
    return run(folder, "mocapidx", "info", store, "--documents", "--format", "jsonl").splitlines()


def assert_is_whole(folder, joined):
    """Compare with a store of the archive that was indexed at once."""
    run(folder, "mocapidx", "index", "archive", "--store", "whole.store", "--prune", "--quiet")
    assert sorted(documents(folder, joined)) == sorted(documents(folder, "whole.store"))
    query = ("query", "--steps-of", "F20", "0 1 0", "--format", "jsonl")
    found, expected = (
        run(folder, "mocapidx", query[0], store, *query[1:]) for store in (joined, "whole.store")
    )
    assert found == expected


@pytest.fixture
def array(place):
    """The array's script and its parts, and a job of it, which is what Slurm would start."""
    script = place / "index.sbatch"
    script.write_text(block("bash", "#!/bin/bash"))
    (place / "parts.txt").write_text("squat\nwalk\n")
    (place / "stores").mkdir()

    def job(number):
        disk = place / f"disk{number}"
        disk.mkdir(exist_ok=True)
        variables = {"SLURM_ARRAY_TASK_ID": str(number), "SLURM_CPUS_PER_TASK": "1"}
        return ended(place, "bash", script, TMPDIR=str(disk), **variables)

    return job


def take_of(place, part):
    return min((place / "archive" / part).glob("*.amc"))


def join(place):
    run(place, "bash", "-e", "-c", block("bash", "sbatch").partition("&&")[2])


def test_an_array_of_jobs_builds_what_one_command_does(place, array):
    (place / "archive/walk/bad.bvh").write_text("nonsense")
    assert [array(number).returncode for number in range(2)] == [0, 0]
    (place / "archive/walk/bad.bvh").unlink()
    join(place)
    assert_is_whole(place, "archive.store")


def test_an_array_that_runs_again_takes_in_what_came_and_went(place, array):
    assert [array(number).returncode for number in range(2)] == [0, 0]
    join(place)
    take_of(place, "squat").unlink()
    shutil.copy(take_of(place, "walk"), place / "archive/squat/ann_new_120.amc")
    (place / "stores/squat.new/half").mkdir(parents=True)  # a job was killed while it copied
    assert [array(number).returncode for number in range(2)] == [0, 0]
    assert sorted(path.name for path in place.glob("stores/*")) == ["squat.store", "walk.store"]
    assert {path.name for path in place.glob("stores/*/*")} == {"LOCK", "MANIFEST", "segments"}
    join(place)
    assert any("squat/ann_new_120.amc" in line for line in documents(place, "archive.store"))
    assert_is_whole(place, "archive.store")


def test_a_job_that_fails_publishes_nothing(place, array):
    assert array(0).returncode == 0
    before = (place / "stores/squat.store/MANIFEST").read_bytes()
    shutil.copy(take_of(place, "walk"), place / "archive/squat")
    with (place / "disk0/squat.store/LOCK").open("r+") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = array(0)
    assert done.returncode != 0
    assert "being written" in done.stderr
    assert array(2).returncode != 0  # more jobs than parts
    assert [path.name for path in place.glob("stores/*")] == ["squat.store"]
    assert (place / "stores/squat.store/MANIFEST").read_bytes() == before


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_builds_what_one_command_does_and_only_what_is_new(place):
    (place / "Makefile").write_text(block("make", "PARTS"))
    run(place, "make", "-j", "2")
    assert_is_whole(place, "archive.store")
    assert "up to date" in run(place, "make", "-j", "2")
    before = (place / "parts/walk.store/MANIFEST").stat().st_mtime_ns
    time.sleep(0.01)
    shutil.copy(take_of(place, "walk"), place / "archive/squat")
    run(place, "make", "-j", "2")
    assert_is_whole(place, "archive.store")
    assert (place / "parts/walk.store/MANIFEST").stat().st_mtime_ns == before
    time.sleep(0.01)
    gone = take_of(place, "squat")
    gone.unlink()
    run(place, "make", "-j", "2")
    assert not any(gone.name in line for line in documents(place, "archive.store"))
    assert_is_whole(place, "archive.store")
    time.sleep(0.01)
    shutil.rmtree(place / "archive/walk")
    run(place, "make", "-j", "2")
    assert all("squat/" in line for line in documents(place, "archive.store"))


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_does_again_what_failed(place):
    (place / "Makefile").write_text(block("make", "PARTS"))
    run(place, "make")
    time.sleep(0.01)
    shutil.copy(take_of(place, "walk"), place / "archive/squat/ann_new_120.amc")
    with (place / "parts/squat.store/LOCK").open("r+") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert ended(place, "make").returncode != 0
    run(place, "make")
    assert_is_whole(place, "archive.store")


@contextmanager
def in_background(folder, command):
    """Run a command until the end, then stop all that it started."""
    process = subprocess.Popen(
        ["bash", "-c", f"exec {command}"],
        cwd=folder,
        env=with_programs(folder),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_a_cluster_is_started_and_asked_as_shown(place):
    distributed = pytest.importorskip("distributed")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = str(free.getsockname()[1])

    def here(text):
        named = text.replace("head", "127.0.0.1").replace("8786", port)
        named = named.replace("/archive", str(place / "archive")).replace(
            "--nworkers 16", "--nworkers 2"
        )
        return named.replace("sports.h5", str(place / "sports.h5"))

    settings = place / ".config/dask/mocapidx.yaml"
    settings.parent.mkdir(parents=True)
    settings.write_text(block("yaml", "distributed"))
    scheduler, worker = (
        here(line.partition("#")[0]) for line in block("bash", "dask scheduler").splitlines()
    )
    run(place, "mocapidx", "index", "archive", "--store", "own.store", "--quiet")
    learn = ("learn-mt", "own.store", "--labels-from", "folder", "--output", "sports.h5")
    run(place, "mocapidx", *learn, "--quiet")
    with in_background(place, scheduler), in_background(place, worker):
        with distributed.Client(f"tcp://127.0.0.1:{port}", timeout=60) as client:
            client.wait_for_workers(2, timeout=120)
            kept = client.run(os.getenv, "MALLOC_TRIM_THRESHOLD_")
        assert list(kept.values()) == ["134217728"] * 2
        run(place, "bash", "-e", "-c", here(block("bash", "mocapidx index /archive")))
    assert_is_whole(place, "archive.store")
    assert (place / "labels.csv").read_text().startswith("document,")
