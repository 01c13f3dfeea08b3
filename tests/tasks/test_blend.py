import json
import os
import shutil

import numpy as np
import pytest
from PIL import Image

from mocapidx.errors import FormatError, ParameterError, StoreError
from mocapidx.graphs.graph_text import graph_to_json
from mocapidx.graphs.match_graph import MatchEdge, MatchGraph, MatchNode
from mocapidx.store.space import read_space, write_space
from mocapidx.synthesis.file import load_space, save_space
from mocapidx.tasks.blend import FitOptions, fit_blend_space, make_motion
from mocapidx.tasks.blend_examples import ExampleOptions
from mocapidx.tasks.index import index_files
from mocapidx.tasks.read import read_motion

FOOT = """
[[parameter]]
joint = "rankle"
axes = "xy"
when = { max = "height", joint = "rankle" }
"""


def hit(document, end, start=0.0):
    return {"document": document, "start_time": start, "end_time": end, "label": "kick"}


@pytest.fixture(scope="module")
def place(fixtures_dir, tmp_path_factory):
    """A folder with hits, a parameter file, a store of kicks and a space made from them."""
    folder = tmp_path_factory.mktemp("blend")
    clips = sorted((fixtures_dir / "clips/kickFrontRight").glob("*.amc"))
    index_files([fixtures_dir / "clips"], folder / "s.store")
    hits = []
    for path in clips:
        frames = path.read_bytes().count(b"\nroot ")
        hits.append(hit(f"kickFrontRight/{path.name}", frames / 120))
    (folder / "hits.jsonl").write_text("".join(json.dumps(h) + "\n" for h in hits))
    (folder / "foot.toml").write_text(FOOT)
    fit_blend_space(
        folder / "hits.jsonl",
        str(folder / "foot.toml"),
        folder / "kicks.space",
        examples=ExampleOptions(store=folder / "s.store"),
        options=FitOptions(draws=200),
    )
    return folder


def hits_of(place):
    return [json.loads(line) for line in (place / "hits.jsonl").read_text().splitlines()]


def write_hits(path, hits):
    path.write_text("".join(json.dumps(h) + "\n" for h in hits))
    return path


def fit(place, hits, **options):
    examples = ExampleOptions(store=place / "s.store", **options)
    return fit_blend_space(
        hits, str(place / "foot.toml"), examples=examples, options=FitOptions(draws=20)
    )


@pytest.mark.parametrize("suffix", [".bvh", ".amc"])
def test_a_foot_goes_where_it_is_asked_to_and_the_file_says_so(place, tmp_path, suffix):
    space = load_space(place / "kicks.space")
    target = space.parameters[:4].mean(axis=0)
    made = make_motion(space, target, output=tmp_path / f"new{suffix}")
    assert not made.is_out_of_reach
    assert made.aim.miss < 1e-3
    read = read_motion(tmp_path / f"new{suffix}", source_rate=120)
    np.testing.assert_allclose(read.positions, made.motion.positions, atol=1e-4)
    foot = read.positions[:, 7]
    np.testing.assert_allclose(foot[foot[:, 1].argmax(), :2], target, atol=0.02)
    np.testing.assert_allclose(read.positions[0, 0, [0, 2]], 0, atol=0.1)


def test_twenty_targets_are_hit_within_two_centimetres(place):
    space = load_space(place / "kicks.space")
    random = np.random.default_rng(3)
    count = len(space.origins)
    for sample in random.integers(count, len(space.weights), 20):
        made = make_motion(space, space.parameters[sample])
        assert made.aim.miss < 0.02
        assert made.aim.weights.min() >= -space.extrapolation - 1e-9
        assert made.aim.weights.max() <= 1 + space.extrapolation + 1e-9
        assert made.aim.weights.sum() == pytest.approx(1)


def test_what_is_out_of_reach_ends_on_the_border_and_is_said_to(place):
    space = load_space(place / "kicks.space")
    for target in ((5.0, 1.0), (-5.0, 1.0), (0.0, 9.0)):
        made = make_motion(space, target)
        assert made.is_out_of_reach
        nearest = np.linalg.norm(space.parameters - np.array(target), axis=1).min()
        assert made.aim.miss <= nearest + 1e-6


def test_a_space_outlives_its_sources(place, tmp_path, fixtures_dir):
    moved = tmp_path / "clips"
    shutil.copytree(fixtures_dir / "clips/kickFrontRight", moved / "kickFrontRight")
    for skeleton in (fixtures_dir / "clips").glob("*.asf"):
        shutil.copy(skeleton, moved)
    index_files([moved], tmp_path / "s.store")
    examples = ExampleOptions(store=tmp_path / "s.store")
    options = FitOptions(draws=20)
    arguments = (place / "hits.jsonl", str(place / "foot.toml"))
    fit_blend_space(*arguments, tmp_path / "k.space", examples=examples, options=options)
    shutil.rmtree(moved)
    assert len(make_motion(tmp_path / "k.space", (0.0, 0.8)).motion.positions) > 50
    with pytest.raises(FormatError, match="is not there"):
        fit_blend_space(*arguments, examples=examples, options=options)


def test_what_is_kept_is_read_back(place, tmp_path):
    space = load_space(place / "kicks.space")
    save_space(space, tmp_path / "again.space")
    assert (tmp_path / "again.space").read_bytes() == (place / "kicks.space").read_bytes()


def test_equal_inputs_give_equal_files(place, tmp_path):
    fit_blend_space(
        place / "hits.jsonl",
        str(place / "foot.toml"),
        tmp_path / "again.space",
        examples=ExampleOptions(store=place / "s.store"),
        options=FitOptions(draws=200),
    )
    assert (tmp_path / "again.space").read_bytes() == (place / "kicks.space").read_bytes()


def test_every_changed_byte_of_a_space_is_noticed(place, tmp_path):
    data = (place / "kicks.space").read_bytes()
    random = np.random.default_rng(1)
    for at in [*random.integers(0, len(data), 30), len(data) - 1, len(data) - 60]:
        damaged = bytearray(data)
        damaged[at] ^= 1 << int(random.integers(8))
        (tmp_path / "bad.space").write_bytes(damaged)
        with pytest.raises(StoreError, match=r"bad\.space"):
            load_space(tmp_path / "bad.space")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("scales", [1.0]),
        ("scales", [0.0, 1.0]),
        ("names", ["x"]),
        ("units", ["\x1b[2J", "m"]),
        ("units", ["m", "m\0"]),
        ("extrapolation", 5),
        ("rates", [120.0]),
        ("rates", ["a"] * 4),
        ("parents", [0] * 31),
        ("parents", "x"),
        ("nodes", ["a"]),
        ("turned_by", "none"),
        ("examples", [["a", 0, 1]]),
        ("examples", 3),
        ("parameters", "not toml"),
        ("joint_map", {"name": "x", "joints": [99] * 24, "made": []}),
        ("joint_map", None),
    ],
)
def test_a_space_that_lies_with_a_right_digest_is_refused(place, tmp_path, key, value):
    meta, arrays = read_space(place / "kicks.space")
    write_space(tmp_path / "bad.space", {**meta, key: value}, arrays)
    with pytest.raises(StoreError, match="damaged") as caught:
        load_space(tmp_path / "bad.space")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("group", ["turns", "places", "curves", "samples", "offsets"])
def test_arrays_that_do_not_fit_are_refused(place, tmp_path, group):
    meta, arrays = read_space(place / "kicks.space")
    first, *rest = arrays[group]
    for members in (rest, [first[:-1], *rest], [first * np.nan, *rest], [first * 1e7, *rest]):
        write_space(tmp_path / "bad.space", meta, {**arrays, group: members})
        with pytest.raises(StoreError, match="damaged"):
            load_space(tmp_path / "bad.space")


def test_with_a_match_graph_motions_are_aligned_along_its_edges(place):
    hits = hits_of(place)
    nodes = tuple(
        MatchNode(h["document"], 0, round(h["end_time"] * 30), tier=0, direct=0.0, distance=0.0)
        for h in hits
    )
    edges = []
    for one, other in ((0, 1), (1, 2), (2, 3)):
        a, b = nodes[one].frames, nodes[other].frames
        steps = np.arange(max(a, b))
        path = np.stack((np.minimum(steps, a - 1), np.minimum(steps, b - 1)), axis=1)
        edges.append(MatchEdge(one, other, 0.1, path))
    graph = MatchGraph(30.0, 0.2, nodes, tuple(edges))
    (place / "graph.json").write_text(graph_to_json(graph))
    # the query comes first, and is an example even where it is no hit
    space = fit(place, write_hits(place / "few.jsonl", hits[:0:-1]), graph=place / "graph.json")
    assert [o.document for o in space.origins] == [h["document"] for h in (hits[0], *hits[:0:-1])]
    lonely = write_hits(place / "other.jsonl", [hit(hits[0]["document"], 0.3), *hits])
    with pytest.raises(FormatError, match="no node of the match graph"):
        fit(place, lonely, graph=place / "graph.json")
    (place / "bad.json").write_text("{}")
    with pytest.raises(FormatError, match=r"bad\.json: not a match graph"):
        fit(place, place / "few.jsonl", graph=place / "bad.json")


def test_too_few_motions_are_said_to_be_too_few(place, tmp_path):
    hits = hits_of(place)
    with pytest.raises(FormatError, match=r"0 motions to blend, at least two"):
        fit(place, write_hits(tmp_path / "none.jsonl", []))
    with pytest.raises(FormatError, match=r"1 motion to blend, at least two"):
        fit(place, write_hits(tmp_path / "one.jsonl", hits[:1] * 3))
    with pytest.raises(ParameterError, match="2 examples are too few for 2 parameters"):
        fit(place, write_hits(tmp_path / "two.jsonl", hits[:2]))
    with pytest.raises(FormatError, match="too short a motion"):
        fit(place, write_hits(tmp_path / "short.jsonl", [*hits, hit(hits[0]["document"], 0.05)]))


def test_motions_of_different_skeletons_are_refused(place, tmp_path, fixtures_dir):
    index_files([fixtures_dir], tmp_path / "all.store")
    hits = [{**h, "document": f"clips/{h['document']}"} for h in hits_of(place)]
    bvh = next((fixtures_dir / "bvh/kickFrontRight").glob("*.bvh"))
    hits.append(hit(f"bvh/kickFrontRight/{bvh.name}", 1.0))
    with pytest.raises(FormatError, match=r"another skeleton than .*BVH"):
        fit_blend_space(
            write_hits(tmp_path / "mixed.jsonl", hits),
            str(place / "foot.toml"),
            examples=ExampleOptions(store=tmp_path / "all.store"),
        )


def test_a_function_of_ones_own_steers_too(place, tmp_path):
    code = tmp_path / "own.py"
    code.write_text(
        "def highest(motion):\n    return motion.positions[:, 7, 1].max()\n"
        "def wrong(motion):\n    return 1 / 0\n"
        "def odd(motion):\n    return [[1.0]]\n"
        "number = 3\n"
    )
    examples = ExampleOptions(store=place / "s.store")
    options = FitOptions(draws=20)
    space = fit_blend_space(
        place / "hits.jsonl", f"{code}:highest", tmp_path / "own.space",
        examples=examples, options=options,
    )  # fmt: skip
    middle = [float(space.parameters[:4].mean())]
    made = make_motion(tmp_path / "own.space", middle, parameter=f"{code}:highest")
    assert made.aim.miss < 1e-3
    assert made.motion.positions[:, 7, 1].max() == pytest.approx(middle[0], abs=0.01)
    # a space file alone runs nobody's code
    assert np.isnan(make_motion(tmp_path / "own.space", middle).aim.miss)
    for name, complaint in (
        ("wrong", "ZeroDivisionError"),
        ("odd", "finite numbers"),
        ("number", "no function 'number'"),
        ("none", "no function 'none'"),
    ):
        with pytest.raises((FormatError, ParameterError), match=complaint):
            fit_blend_space(place / "hits.jsonl", f"{code}:{name}", examples=examples)
    for spec, complaint in ((str(code), "name a function"), ("no.py:f", "no such file")):
        with pytest.raises(FormatError, match=complaint):
            fit_blend_space(place / "hits.jsonl", spec, examples=examples)
    code.write_text("import nothing_of_that_name")
    with pytest.raises(FormatError, match="ModuleNotFoundError"):
        fit_blend_space(place / "hits.jsonl", f"{code}:f", examples=examples)


def test_redundant_examples_are_left_out(place):
    space = fit_blend_space(
        place / "hits.jsonl",
        str(place / "foot.toml"),
        examples=ExampleOptions(store=place / "s.store"),
        options=FitOptions(draws=10, redundant=5.0),
    )
    assert len(space.origins) == 3


def test_the_commands_lead_from_hits_to_new_motion(place, tmp_path, mocapidx):
    done = mocapidx(
        "blend", "fit", place / "hits.jsonl", "--store", place / "s.store",
        "--parameter", place / "foot.toml", "--output", tmp_path / "k.space", "--samples", 50,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "4 examples of" in done.stderr
    done = mocapidx(
        "blend", "make", tmp_path / "k.space", "--at", "-0.1,0.8", "--output",
        tmp_path / "new.bvh", "--picture", tmp_path / "new.png", "--format", "jsonl",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    records = [json.loads(line) for line in done.stdout.splitlines()]
    assert [r["parameter"] for r in records] == ["rankle x", "rankle y"]
    assert [r["asked"] for r in records] == [-0.1, 0.8]
    done = mocapidx("blend", "info", tmp_path / "k.space", "--format", "csv")
    assert done.stdout.splitlines()[0].startswith("example,document,start_time,end_time,rankle x")
    assert len(done.stdout.splitlines()) == 5
    done = mocapidx(
        "blend", "plot", tmp_path / "k.space", "--at", "9,9", "--output", tmp_path / "r.png"
    )
    assert done.returncode == 0, done.stderr
    for name in ("new.png", "r.png"):
        with Image.open(tmp_path / name) as picture:
            assert min(picture.size) > 300


@pytest.mark.parametrize(
    ("arguments", "code", "complaint"),
    [
        (["make", "none.space", "--at", "1", "--output", "x.bvh"], 4, "no space file here"),
        (["make", "{space}", "--at", "1,b", "--output", "x.bvh"], 2, "no list of numbers"),
        (["make", "{space}", "--at", "1", "--output", "x.bvh"], 2, "is 2 numbers: rankle x"),
        (["make", "{space}", "--at", "1,nan", "--output", "x.bvh"], 2, "is 2 numbers"),
        (["make", "{space}", "--at", "1,1", "--output", "x.c3d"], 2, ".bvh or .amc"),
        (["make", "{space}", "--at", "1,1", "--output", "no/x.bvh"], 2, "no/x.bvh"),
        (["plot", "{space}", "--output", "x.gif"], 2, ".png or .svg"),
        (["info", "{hits}"], 4, "not a space file"),
        (["fit", "{hits}", "--parameter", "none.toml", "--output", "x"], 3, "no such file"),
        (["fit", "none", "--parameter", "{toml}", "--output", "x"], 3, "no such file"),
        (["fit", "{hits}", "--parameter", "{toml}", "--output", "x"], 3, "no document"),
        (["fit", "{hits}", "--parameter", "{hits}", "--output", "x"], 3, "not TOML"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(place, tmp_path, mocapidx, arguments, code, complaint):
    names = {"space": "kicks.space", "hits": "hits.jsonl", "toml": "foot.toml"}
    filled = [a.format(**{key: place / name for key, name in names.items()}) for a in arguments]
    done = mocapidx("blend", *filled, cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert done.stderr.count("\n") == 1
    assert complaint in done.stderr
    assert not os.listdir(tmp_path)


def test_kicks_of_real_people_can_be_steered(real_data, tmp_path):
    clips = sorted((real_data / "hdm05/kickLFront1Reps").glob("*.amc"))
    hits = []
    for path in clips:
        frames = path.read_bytes().count(b"\nroot ")
        hits.append(hit(f"kickLFront1Reps/{path.name}", frames / 120))
    (tmp_path / "foot.toml").write_text(
        '[[parameter]]\njoint = "lankle"\nwhen = { max = "height", joint = "lankle" }\n'
    )
    space = fit_blend_space(
        write_hits(tmp_path / "hits.jsonl", hits),
        str(tmp_path / "foot.toml"),
        examples=ExampleOptions(roots=(real_data / "hdm05",)),
        options=FitOptions(draws=200),
    )
    random = np.random.default_rng(0)
    for number in range(5):
        target = space.parameters[random.integers(len(hits), len(space.weights))]
        made = make_motion(space, target, output=tmp_path / "new.bvh")
        assert made.aim.miss < 0.02, number
        positions = read_motion(tmp_path / "new.bvh").positions
        np.testing.assert_allclose(positions, made.motion.positions, atol=1e-4)
        steps = np.linalg.norm(np.diff(positions, axis=0), axis=2)
        assert steps.max() * 120 < 14  # m/s: the feet of these people reach 9 or so
    assert make_motion(space, space.parameters[0] + (0, 3, 0)).is_out_of_reach
