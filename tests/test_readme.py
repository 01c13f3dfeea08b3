"""What README.md shows is what the program does; what the pages name exists."""

import importlib
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

from mocapidx_cli.main import COMMANDS

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SECONDS = re.compile(r"(?<= in )\d+\.\d s$", re.MULTILINE)


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def session():
    """List the commands of README's first session, each with what it is said to print."""
    shown = "".join(blocks(README, "console"))
    return re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", shown, re.MULTILINE)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the motion that `make demo` leaves in build/fixtures."""
    from fixtures.generate import generate

    folder = tmp_path_factory.mktemp("session")
    generate(folder / "build" / "fixtures")
    (folder / "build" / "fixtures" / ".done").touch()  # the Makefile's
    return folder


def run(command, place):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", command],
        cwd=place,
        env=os.environ | {"PATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=120,
    )


def test_the_first_session_prints_what_the_readme_shows(place):
    commands = session()
    assert len(commands) > 5
    for command, expected in commands:
        done = run(command, place)
        assert done.returncode == 0, f"{command}\n{done.stdout}"
        assert SECONDS.sub("", done.stdout) == SECONDS.sub("", expected), command

    kicks, found = found_kicks(place, commands)
    assert f"there are {len(found)} rows" in README
    assert f"one of the {kicks} right" in " ".join(README.split())
    (code,) = blocks(README, "python")
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=place, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 3


def found_kicks(place, commands):
    """Count the right kicks in the files; list the hits of README's query, all of them right."""
    command = next(text for text, _ in commands if "F17,F20" in text)
    rows = run(command.replace("--top 5", "--format csv"), place).stdout.splitlines()[1:]
    labels = (place / "build/fixtures/labels.csv").read_text().splitlines()[1:]
    truth = [label.split(",") for label in labels]
    kicks = [label for label in truth if label[1] == "kickFrontRight"]
    for row in rows:
        cells = row.split(",")
        middle = (float(cells[4]) + float(cells[5])) / 2
        assert any(
            cells[1] == document and float(start or 0) < middle < float(end or "inf")
            for document, _, start, end, *_ in kicks
        ), row
    return len(kicks), rows


def shown_commands():
    for page in PAGES:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        fenced = "".join(blocks(text, "[a-z]*"))
        indented = re.findall(r"^    .*$", text, re.MULTILINE)
        for line in [*fenced.splitlines(), *indented]:
            for part in re.split(r"\s[|>]\s?|&&|\|\|", line):
                words = re.match(r"^\s*(?:[$]\s+)?mocapidx\s+([a-z].*)$", part)
                if words:
                    yield pytest.param(words[1], id=f"{page.name}: {words[1][:60]}")


@pytest.mark.parametrize("text", list(shown_commands()))
def test_commands_in_the_pages_exist_with_their_options(text):
    words = shlex.split(text, comments=True)
    module, _, attribute = COMMANDS[words[0]][0].partition(":")
    command = getattr(importlib.import_module(f"mocapidx_cli.{module}"), attribute)
    for word in words[1:]:
        if isinstance(command, click.Group) and word in command.commands:
            command = command.commands[word]
    known = {name for parameter in command.params for name in parameter.opts}
    assert {word.split("=")[0] for word in words if word.startswith("--")} <= known | {"--help"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target
