"""The pipelines in examples/ run as they stand, and their second run does nothing."""

import csv
import fcntl
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent.parent / "examples"
BIN = Path(sys.executable).parent
CLASSES = ("squat", "walk", "kickFrontRight")


@pytest.fixture(scope="module")
def project(fixtures_dir, tmp_path_factory):
    """A folder with some takes, and labels that say what is in them."""
    folder = tmp_path_factory.mktemp("project")
    with (fixtures_dir / "labels.csv").open(newline="") as file:
        labels = [row for row in csv.DictReader(file) if row["label"] in CLASSES]
    labels = [row for row in labels if row["document"].startswith("clips/")]
    for row in labels:
        target = folder / "takes" / row["document"]
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(fixtures_dir / row["document"], target)
    for skeleton in fixtures_dir.glob("clips/**/*.asf"):
        shutil.copy(skeleton, folder / "takes" / skeleton.relative_to(fixtures_dir))
    with (folder / "labels.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, labels[0])
        writer.writeheader()
        writer.writerows(labels)
    return folder


def run(*words, cwd, **environment):
    done = subprocess.run(
        list(map(str, words)),
        cwd=cwd,
        env={**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", **environment},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def copied(project, tmp_path, name):
    folder = tmp_path / "project"
    shutil.copytree(project, folder)
    shutil.copy(EXAMPLES / name, folder)
    return folder


def check_annotations(path):
    """Most of what was said of the clips of a class is that class."""
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    right = [row["document"].split("/")[1] == row["label"] for row in rows]
    assert len({row["document"] for row in rows}) > 10
    assert sum(right) > 0.9 * len(right)


def test_the_makefile(project, tmp_path):
    folder = copied(project, tmp_path, "Makefile")
    said = run("make", cwd=folder)
    assert "mocapidx annotate" in said
    check_annotations(folder / "work/annotations.jsonl")
    assert (folder / "work/report.html").read_text().lower().startswith("<!doctype html>")
    assert "is up to date" in run("make", cwd=folder)
    touched = next(folder.glob("takes/clips/squat/*.amc"))
    os.utime(touched)
    assert "nothing to read" in run("make", cwd=folder)


def test_the_snakefile(project, tmp_path):
    pytest.importorskip("snakemake")
    folder = copied(project, tmp_path, "Snakefile")
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    run(BIN / "snakemake", "--cores", "2", "--quiet", "all", cwd=folder, **cache)
    check_annotations(folder / "work/annotations.jsonl")
    again = run(BIN / "snakemake", "--cores", "2", cwd=folder, **cache)
    assert "Nothing to be done" in again


def test_the_nightly_script_and_the_line_for_cron(project, tmp_path):
    folder = copied(project, tmp_path, "nightly.sh")
    run("mocapidx", "index", "takes", "--store", "takes.store", "--quiet", cwd=folder)
    run(
        "mocapidx",
        "learn-mt",
        "takes.store",
        "--labels",
        "labels.csv",
        "--output",
        "classes.h5",
        cwd=folder,
    )
    (line,) = [
        line for line in (EXAMPLES / "crontab").read_text().splitlines() if line.startswith("0 3")
    ]
    command = line.split("*", 3)[3].strip().replace("/archive", str(folder))
    assert run("sh", "-c", command, cwd="/") == ""
    log = (folder / "nightly.log").read_text()
    assert "0 added, 0 changed" in log
    assert "done" in log
    assert (folder / "annotations.csv").read_text().startswith("document,")
    with (folder / "nightly.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert run("sh", "-c", command, cwd="/") == ""
    assert "another run is at work" in (folder / "nightly.log").read_text()


def test_the_notebook(project, tmp_path):
    pytest.importorskip("nbclient")
    folder = copied(project, tmp_path, "first_look.ipynb")
    run(
        BIN / "jupyter-execute", "--output=done.ipynb", "first_look.ipynb",
        cwd=folder, HOME=str(tmp_path), JUPYTER_PATH=str(BIN.parent / "share/jupyter"),
    )  # fmt: skip
    cells = json.loads((folder / "done.ipynb").read_text())["cells"]
    shown = [
        "".join(output["data"]["text/html"])
        for cell in cells
        for output in cell.get("outputs", ())
        if "text/html" in output.get("data", {})
    ]
    assert len(shown) == 5
    assert all("<table>" in each for each in shown)
