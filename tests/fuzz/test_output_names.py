"""Names that would steer a terminal, a browser or a spreadsheet, in what is written of them."""

import csv
import io
import json
import shutil
from xml.etree import ElementTree

import numpy as np
import pytest

from mocapidx.graphs.graph_text import graph_to_graphml, graph_to_json
from mocapidx.graphs.match_graph import MatchEdge, MatchGraph, MatchNode
from mocapidx.reports.match_graphs import match_graph_picture
from mocapidx.tasks.records import pair_records, render_records
from mocapidx.tasks.template_records import draw_text, template_facts
from mocapidx.templates.template import MotionTemplate
from tests.fuzz.text_readers import F39

ODD = "=1+1\x1b[2J\n\u202e<img src=x onerror=alert(1)>\udcff&\"'\x9b .amc"
"""No NUL and no slash: a file can be called so."""

WORST = f"../{ODD}\0\ud800\ufffe"


def graph():
    nodes = (
        MatchNode(WORST, 0, 12, 0, None, 0.0),
        MatchNode("b", 0, 12, 1, 0.1, 0.1),
    )
    pairs = np.array([[n, n] for n in range(12)])
    return MatchGraph(10.0, 0.2, nodes, (MatchEdge(0, 1, 0.1, pairs),))


def is_safe(text):
    """Whether nothing in it steers a terminal or reorders what stands beside it."""
    return all(character.isprintable() or character in "\n\t" for character in text)


def test_graphml_is_inert_text():
    text = graph_to_graphml(graph())
    text.encode("utf-8")
    assert is_safe(text)
    tree = ElementTree.fromstring(text)
    assert {element.tag.rpartition("}")[2] for element in tree.iter()} == {
        "graphml", "key", "graph", "node", "edge", "data"
    }  # fmt: skip


def test_a_match_graph_as_json_is_ascii():
    text = graph_to_json(graph())
    assert text.isascii()
    assert is_safe(text)
    assert json.loads(text)["nodes"][0]["document"] == WORST


def test_a_picture_of_a_match_graph_holds_no_markup_of_names():
    pose = np.random.default_rng(0).normal(size=(24, 3))
    picture = match_graph_picture(graph(), [pose, pose], suffix="svg").decode("utf-8")
    assert is_safe(picture)
    tree = ElementTree.fromstring(picture)
    for element in tree.iter():
        assert element.tag.rpartition("}")[2] not in ("script", "a", "foreignObject", "img")
        assert not any(
            "onerror" in value or ("href" in key and value[:1] not in "#d")
            for key, value in element.attrib.items()
        )
    assert match_graph_picture(graph(), [pose, pose], suffix="png").startswith(b"\x89PNG")


def test_a_template_in_letters_is_safe():
    matrix = np.zeros((6, 39))
    template = MotionTemplate(WORST, matrix, F39.digest, 30.0, documents=(WORST,), passes=1)
    for line in draw_text(template, F39):
        assert line.isprintable()
    rows = render_records(pair_records(template_facts(template)), "table", ("what", "value"))
    assert all(row.isprintable() for row in rows)


@pytest.fixture(scope="module")
def odd_store(seeds, tmp_path_factory, mocapidx):
    """A store of a take with an odd name, and the folder of the take."""
    folder = tmp_path_factory.mktemp("odd")
    takes = folder / "takes"
    shutil.copytree(seeds / "sources", takes)
    (takes / "second.amc").rename(takes / ODD)
    done = mocapidx("index", takes, "--store", folder / "odd.store", errors="surrogateescape")
    assert done.returncode == 0, done.stderr
    assert is_safe(done.stdout + done.stderr)
    return folder / "odd.store", takes


COMMANDS = {
    "info": lambda store, takes: ["info", store, "--documents"],
    "query": lambda store, takes: ["query", store, "--steps-of", "F20", "0"],
    "doctor": lambda store, takes: ["doctor", takes],
    "skeleton": lambda store, takes: ["skeleton", takes / ODD],
    "no such": lambda store, takes: ["query", store, "--example", ODD + "x"],
    "align": lambda store, takes: ["align", takes / ODD, takes / "clip.bvh"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_what_a_terminal_sees_of_odd_names_is_escaped(command, odd_store, mocapidx):
    arguments = COMMANDS[command](*odd_store)
    done = mocapidx(*arguments, errors="surrogateescape")
    assert done.returncode in (0, 2, 3), done.stderr
    assert is_safe(done.stdout + done.stderr)
    assert command == "align" or "\\x1b" in done.stdout + done.stderr


@pytest.mark.parametrize("row_format", ["csv", "jsonl"])
def test_records_of_odd_names_are_a_line_each(row_format, odd_store, mocapidx):
    done = mocapidx("info", odd_store[0], "--documents", "--format", row_format)
    assert done.returncode == 0, done.stderr
    assert is_safe(done.stdout)
    lines = done.stdout.splitlines()
    if row_format == "csv":
        rows = list(csv.reader(io.StringIO(done.stdout)))
        assert len(rows) == len(lines)
        assert not any(cell[:1] in "=+-@" for row in rows[1:] for cell in row if not number(cell))
    else:
        assert ODD in [json.loads(line)["document"] for line in lines]


def number(cell):
    return not cell or cell.lstrip("-").replace(".", "").isdigit()
