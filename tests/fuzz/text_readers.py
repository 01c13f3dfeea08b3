"""What is done to each kind of text that a person or another program writes; gives an answer."""

import contextlib
import re
from functools import lru_cache

import numpy as np

from mocapidx.errors import MocapidxError
from mocapidx.features.featureset import load_feature_set, parse_feature_set
from mocapidx.graphs.graph_text import (
    graph_from_graphml,
    graph_from_json,
    graph_to_graphml,
    graph_to_json,
)
from mocapidx.queries.files import parse_pattern, parse_scene, read_query_text
from mocapidx.skeleton.jointmap import load_joint_map
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.skeleton.markermap import load_marker_map
from mocapidx.skeleton.markers import choose_marker_map
from mocapidx.synthesis.parameters import measure, parse_parameters
from mocapidx.tasks.found import read_found
from mocapidx.tasks.label_files import read_labels
from mocapidx.tasks.match_graphs import read_graph
from mocapidx.tasks.settings import read_settings
from mocapidx.tasks.transcribe import TRANSCRIPTS, transcribe
from mocapidx.templates.designs import apply_design, parse_designs
from mocapidx.templates.template import MotionTemplate, TemplateSet
from mocapidx.toml_files import read_toml_text
from mocapidx.transcripts.spans import LATEST

# What no format writes in another way.
PLAIN = re.compile('[a-z<>&"0-9-]+( [a-z<>&"0-9-]+)*')
F39 = load_feature_set("f39")


def feature_set(path):
    parse_feature_set(read_toml_text(path), "x.toml")
    return load_feature_set(path).digest


def joint_map(path):
    return str(load_joint_map(path))


def marker_map(path):
    found = load_marker_map(path)
    mapping = choose_marker_map([*CANONICAL_JOINTS, *(f"M{n}" for n in range(40))], found)
    return f"{found}{mapping}"


def pattern(path):
    return str(parse_pattern(read_query_text(path), F39, 30.0, "p.toml"))


def scene(path):
    return str(parse_scene(read_query_text(path), F39, 30.0, "p.toml"))


@lru_cache
def squats():
    squat = MotionTemplate("squat", np.ones((60, 39)), F39.digest, 30.0, tau=0.04)
    return TemplateSet((squat,), F39.name, F39.digest, F39.text, 30.0)


def design(path):
    for each in parse_designs(read_toml_text(path), "d.toml").designs:
        apply_design(each, squats(), F39)
    return ""


@lru_cache
def swing():
    times = np.linspace(0, 2, 21)
    points = np.random.default_rng(0).normal(size=(1, 24, 3)) + 0.1 * times[:, None, None]
    return points, times


def parameters(path):
    found = parse_parameters(read_toml_text(path), "p.toml")
    points, times = swing()
    return str(measure(found, points, times, times * 1.5))


def records(path):
    return str(read_found(path))


def told_again(path):
    """What was found, written for each other program, is found again in what was written."""
    found = read_found(path)
    # The others have whole milliseconds, or a little more.
    if any(each.end - each.start < 0.001 or each.end > LATEST - 1 for each in found):
        return
    for to in TRANSCRIPTS:
        again = []
        for number, data in enumerate(transcribe(path, to).values()):
            written = path.with_name(f"{to}-{number}")
            written.write_bytes(data)
            again += read_found(written)
        if all(PLAIN.fullmatch(each.label) for each in found):
            assert sorted(e.label for e in again) == sorted(e.label for e in found), to
        times, expected = (sorted((e.start, e.end) for e in each) for each in (again, found))
        assert np.abs(np.subtract(times, expected)).max(initial=0) < 0.0011, to


def labels(path):
    return str(read_labels(path))


def spoken(path):
    with contextlib.suppress(MocapidxError):
        read_labels(path)
    return records(path)


def graph(path):
    return str(read_graph(path))


def settings(path):
    return str(read_settings(path))


def graph_again(path):
    """A match graph, written, says what was read."""
    found = read_graph(path)
    for read, write in ((graph_from_json, graph_to_json), (graph_from_graphml, graph_to_graphml)):
        text = write(found)
        assert write(read(text)) == text
