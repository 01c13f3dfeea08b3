"""What README.md shows is what the program does; what the pages name exists."""

import importlib
import re
import shlex
import subprocess
import sys

import click
import pytest

from fixtures.pictures import LARGEST, PICTURES
from fixtures.session import README, commands, generate_place, renewed, run
from mocapidx_cli.main import COMMANDS

PAGES = [README, *sorted((README.parent / "docs").glob("*.md"))]


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def test_the_first_session_of_the_readme(tmp_path):
    """One test, so that the motion is made and indexed once, however tests are spread."""
    text = README.read_text(encoding="utf-8")
    generate_place(tmp_path)
    printed = list(commands(renewed(text, tmp_path)))
    assert len(printed) > 5
    for (command, shown), (_, now) in zip(commands(text), printed, strict=True):
        assert now == shown, f"{command}\n'python -m fixtures.session' renews what is shown"
    check_the_kicks(text, tmp_path)
    (code,) = blocks(text, "python")
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 3


def check_the_kicks(text, place):
    """They are as many as the README says, and each of them is a right kick by the labels."""
    command = next(command for command, _ in commands(text) if "F17,F20" in command)
    rows = run(command.replace("--top 5", "--format csv"), place).splitlines()[1:]
    labels = (place / "build/fixtures/labels.csv").read_text().splitlines()[1:]
    kicks = [label for label in map(split, labels) if label[1] == "kickFrontRight"]
    words = " ".join(text.split())
    assert f"there are {len(rows)} rows" in words
    assert f"one of the {len(kicks)} right kicks" in words
    for cells in map(split, rows):
        middle = (float(cells[4]) + float(cells[5])) / 2
        assert any(
            cells[1] == document and float(start or 0) < middle < float(end or "inf")
            for document, _, start, end, *_ in kicks
        ), cells


def split(line):
    return line.split(",")


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


def test_the_pictures_are_small_and_shown():
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    pictures = sorted(PICTURES.iterdir())
    assert pictures
    for picture in pictures:
        assert picture.stat().st_size < LARGEST
        assert f"pictures/{picture.name})" in text


@pytest.mark.parametrize("page", PAGES[1:], ids=lambda page: page.name)
def test_the_readme_leads_to_every_page(page):
    assert f"(docs/{page.name})" in README.read_text(encoding="utf-8")


def test_the_changelog_tells_of_every_command():
    text = (README.parent / "CHANGELOG.md").read_text(encoding="utf-8")
    assert [name for name in COMMANDS if f"`{name}" not in text] == []
