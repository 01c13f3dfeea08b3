"""Every command that the pages in docs/ show is run, a page at a time, in a folder of its own.

The folder holds what the pages talk about: ``takes`` and ``incoming`` with motion, ``takes.store``,
``labels.csv``, templates, records, single clips. README.md and docs/queries.md, which show output
too, are run by other tests.
"""

import csv
import os
import re
import shutil
import subprocess
import sys
from itertools import groupby
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
SETS = ROOT / "mocapidx" / "features" / "sets"
PAGES = sorted(path for path in DOCS.glob("*.md") if path.name != "queries.md")
BEGINS = ("mocapidx ", "for ", "python ")
CALLED = {
    "kickFrontRight": "kick",
    "punchLeft": "throw",
    "clapAboveHead": "grab",
    "rotateArmRightForward": "armForwards",
    "rotateArmRightBackward": "armBackwards",
}
"""What the pages call the classes of the generated motion."""


def scripts(text):
    """The blocks of a page that begin with a command, as lines for a shell."""
    for indented, block in groupby(text.splitlines(), lambda line: line.startswith("    ")):
        lines = [line[4:] for line in block]
        if indented and lines[0].startswith(BEGINS):
            yield "\n".join(lines)
    for block in re.findall(r"^```(?:sh)?\n(.*?)^```$", text, re.M | re.S):
        if block.startswith(BEGINS):
            yield block
    for block in re.findall(r"^```console\n(.*?)^```$", text, re.M | re.S):
        yield from (line[2:] for line in block.splitlines() if line.startswith("$ "))


def files(text):
    """The files that a page shows: blocks that begin with their name in a comment."""
    for indented, block in groupby(text.splitlines(), lambda line: line.startswith("    ")):
        lines = [line[4:] for line in block]
        if indented and re.fullmatch(r"# \w+\.toml.*", lines[0]):
            yield lines[0].split()[1], "\n".join(lines)
    yield from re.findall(r"^```toml\n# (\w+\.toml)(.*?)^```$", text, re.M | re.S)


@pytest.fixture(scope="session")
def world(fixtures_dir, mocapidx, tmp_path_factory):
    """What the pages talk about."""
    folder = tmp_path_factory.mktemp("docs") / "world"
    shutil.copytree(fixtures_dir / "clips", folder / "takes")
    clips = {"a": "squat", "b": "walk", "squat/a": "squat", "walk/a": "walk"}
    add_clips(folder / "takes", clips | {"kick": "kickFrontRight"}, folder / "takes")
    with (fixtures_dir / "labels.csv").open(newline="") as file:
        labels = [row for row in csv.DictReader(file) if row["document"].startswith("clips/")]
    for row in labels:
        row["document"] = row["document"].removeprefix("clips/")
        row["label"] = CALLED.get(row["label"], row["label"])
    with (folder / "labels.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, labels[0])
        writer.writeheader()
        writer.writerows(labels)
    for name, label in {"leg-up.csv": "kickFrontLeft", "leg-down.csv": "squat"}.items():
        with (folder / name).open("w", newline="") as file:
            writer = csv.DictWriter(file, labels[0])
            writer.writeheader()
            writer.writerows(row for row in labels if row["label"] == label)
    shutil.copy(SETS / "f39.toml", folder / "hands.toml")
    (folder / "night.toml").write_text('[all]\nstore = "takes.store"\n')
    (folder / "incoming").mkdir()
    take = sorted(fixtures_dir.glob("takes/*.amc"))[0]
    for skeleton in fixtures_dir.glob("takes/*.asf"):
        shutil.copy(skeleton, folder / "incoming")
    shutil.copy(take, folder / "incoming")

    def run(*words):
        done = mocapidx(*words, cwd=folder)
        assert done.returncode == 0, done.stderr

    run("index", "takes", "--store", "takes.store", "--quiet")
    run("learn-mt", "takes.store", "--labels", "labels.csv", "--output", "sports.h5", "--quiet")
    shutil.copy(folder / "sports.h5", folder / "t.h5")
    records = ("--format", "jsonl", "--output")
    run("annotate", "takes.store", "--templates", "t.h5", *records, "annotations.jsonl")
    run("retrieve", "takes.store", "--templates", "t.h5", "--class", "kick", *records, "hits.jsonl")
    return folder


def add_clips(folder, clips, source):
    """Copy clips of some classes, each with its skeleton, to where the pages have them."""
    skeleton = sorted(source.glob("ann*.asf"))[0]
    for number, (name, label) in enumerate(clips.items()):
        found = sorted((source / label).glob("ann*.amc"))
        shutil.copy(found[number % len(found)], folder / f"{name}.amc")
        shutil.copy(skeleton, folder / f"{name}.asf")


@pytest.fixture
def place(world, fixtures_dir, tmp_path):
    """A copy of the world, with single clips beside the takes."""
    folder = tmp_path / "here"
    shutil.copytree(world, folder)
    kick = "kickFrontRight"
    clips = {"kick": kick, "kick1": kick, "kick2": kick, "squat": "squat"}
    add_clips(folder, clips, folder / "takes")
    shutil.copy(sorted((folder / "incoming").glob("*.amc"))[0], folder / "take.amc")
    shutil.copy(folder / "kick.asf", folder / "take.asf")
    shutil.copy(sorted(fixtures_dir.glob("bvh/**/*.bvh"))[0], folder / "take.bvh")
    return folder


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_commands_of_a_page_do_what_it_says(page, place):
    text = page.read_text(encoding="utf-8")
    for name, content in files(text):
        (place / name).write_text(content)
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "HOME": str(place),
    }
    for script in scripts(text):
        done = subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", script],
            cwd=place,
            env=environment,
            capture_output=True,
            text=True,
            timeout=240,
        )
        assert done.returncode == 0, f"{script}\n{done.stdout}{done.stderr}"
