"""What a command writes takes the place of nothing that it reads, of no store and of no motion."""

import os
from importlib import import_module

import click
import pytest
from click.testing import CliRunner

from mocapidx.errors import MocapidxError
from mocapidx.tasks.outputs import check_output
from mocapidx_cli.group import mocapidx as program
from mocapidx_cli.main import COMMANDS
from mocapidx_cli.options import is_output

FILES = (
    *("take.npz", "other.npz", "t.h5", "hits.jsonl", "labels.csv", "w.web", "k.space", "set.toml"),
    *("pattern.toml", "map.toml", "foot.py", "graph.json", "body.npz", "mocapidx.toml"),
)
READING = "--joint-map map.toml --skeleton body.npz"
READ = ("map.toml", "body.npz")
# What must not be written over is told before anything is read: nonsense will do for input.
TABLE = {
    "skeleton": (f"take.npz {READING}", ("take.npz", *READ)),
    "doctor": (f"take.npz other.npz --feature-set set.toml {READING}", ("other.npz", "set.toml")),
    "query": (
        f"st --example take.npz --example other.npz@1:2 --pattern pattern.toml {READING}",
        ("take.npz", "other.npz", "pattern.toml", *READ),
    ),
    "match": ("st --web w.web --query a.amc", ("w.web",)),
    "web build": ("st", ()),
    "web info": ("w.web", ("w.web",)),
    "learn-mt": ("st --labels labels.csv", ("labels.csv",)),
    "retrieve": ("st --templates t.h5 --class squat", ("t.h5",)),
    "annotate": (f"take.npz other.npz --templates t.h5 {READING}", ("take.npz", "t.h5", *READ)),
    "evaluate": (
        "hits.jsonl --truth labels.csv --templates t.h5",
        ("hits.jsonl", "labels.csv", "t.h5"),
    ),
    "template list": ("t.h5", ("t.h5",)),
    "template show": ("t.h5 --class squat", ("t.h5",)),
    "template mirror": ("t.h5 --class squat --as other", ()),
    "template combine": ("t.h5 --class squat --class hop --as other", ()),
    "template mask": ("t.h5 --class squat", ()),
    "template subtract": ("t.h5 --class squat --from hop", ()),
    "template keyframes": ("t.h5 --class squat 4", ()),
    "template edit": ("t.h5 set.toml", ("set.toml",)),
    "template new": ("set.toml", ("set.toml",)),
    "features list": ("f39 set.toml", ("set.toml",)),
    "features show": ("set.toml", ("set.toml",)),
    "features check": (f"set.toml take.npz {READING}", ("set.toml", "take.npz", *READ)),
    "features plot": (
        f"take.npz --feature F17 --feature-set set.toml {READING}",
        ("take.npz", "set.toml", *READ),
    ),
    "features learn-threshold": (
        "take.npz --feature F17 --positive labels.csv --negative hits.jsonl",
        ("take.npz", "labels.csv", "hits.jsonl"),
    ),
    "report": (
        f"st hits.jsonl --example take.npz@1:2 --templates t.h5 {READING}",
        ("hits.jsonl", "take.npz", "t.h5", *READ),
    ),
    "plot distance": (
        "take.npz --templates t.h5 --labels labels.csv",
        ("take.npz", "t.h5", "labels.csv"),
    ),
    "plot annotation": ("hits.jsonl --labels labels.csv", ("hits.jsonl", "labels.csv")),
    "plot matrix": ("take.npz --feature-set set.toml", ("take.npz", "set.toml")),
    "plot lists": ("st", ()),
    "plot template": ("t.h5 --class squat", ("t.h5",)),
    "plot confusion": ("hits.jsonl --labels labels.csv", ("hits.jsonl", "labels.csv")),
    "align": ("take.npz@1:2 other.npz --feature-set set.toml", ("take.npz", "other.npz")),
    "info": ("st", ()),
    "export": ("hits.jsonl --to jsonl --force", ("hits.jsonl",)),
    "blend fit": (
        "hits.jsonl --parameter foot.py:height --graph graph.json",
        ("hits.jsonl", "foot.py", "graph.json"),
    ),
    "blend make": ("k.space --at 1 --parameter foot.py:height", ("k.space", "foot.py")),
    "blend info": ("k.space", ("k.space",)),
    "blend plot": ("k.space --parameter foot.py:height", ("k.space", "foot.py")),
    "merge": ("one.store", ()),
    "config show": ("", ("mocapidx.toml",)),
    "man": ("", ()),
}
FOLDERS = ("merge", "man")  # what they write is a store, or folders
IN_PLACE = {
    **{
        words: "t.h5"
        for words, (arguments, _) in TABLE.items()
        if words.startswith("template ") and words.split()[1] not in ("list", "show", "new")
    },
    "web build": "w.web",
    "learn-mt": "t.h5",
}


def outputs():
    """Every option of every command that names what is written."""
    for name, (place, _) in COMMANDS.items():
        module, _, attribute = place.partition(":")
        command = getattr(import_module(f"mocapidx_cli.{module}"), attribute)
        inner = command.commands if isinstance(command, click.Group) else {}
        below = {f"{name} {word}": each for word, each in inner.items()}
        for words, each in ({name: command} | below).items():
            for param in each.params:
                if is_output(param):
                    others = [p for p in each.params if is_output(p) and p.required]
                    more = [f"{p.opts[0]} new-{p.name}.bvh" for p in others if p is not param]
                    yield words, param.opts[0], " ".join(more)


OUTPUTS = sorted(outputs())
EACH = pytest.mark.parametrize(("words", "option", "more"), OUTPUTS)


@pytest.fixture
def world(tmp_path, monkeypatch):
    """Files that hold nothing of use, two takes, and what looks like a store."""
    monkeypatch.chdir(tmp_path)
    for name in FILES:
        (tmp_path / name).write_text("" if name == "mocapidx.toml" else f"# {name}\n")
    for name in ("take.bvh", "take.amc", "ann.asf"):
        (tmp_path / name).write_text("motion\n")
    for store in ("st", "one.store"):
        (tmp_path / store / "segments").mkdir(parents=True)
        (tmp_path / store / "MANIFEST").write_text("manifest\n")
        (tmp_path / store / "segments" / "000001.h5").write_text("segment\n")
    return tmp_path


def tree(folder):
    return {
        path.relative_to(folder): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


def ending(words, option, output, more=""):
    """Run a command in this process; give its exit code and what it says."""
    arguments = [*words.split(), *TABLE[words][0].split(), *more.split(), option, str(output)]
    result = CliRunner().invoke(program, arguments)
    if isinstance(result.exception, MocapidxError):
        return result.exception.exit_code, str(result.exception)
    return result.exit_code, result.output


def refused(world, words, option, output, more):
    before = tree(world)
    code, said = ending(words, option, output, more)
    assert code == 2, said
    assert tree(world) == before
    return said


def test_the_table_has_every_command_that_writes_a_file():
    assert {words for words, _, _ in OUTPUTS} == set(TABLE)


@pytest.mark.parametrize(
    ("words", "option", "more", "read"),
    [(*output, read) for output in OUTPUTS for read in TABLE[output[0]][1]],
)
def test_no_input_is_written_over(world, words, option, more, read):
    said = refused(world, words, option, read, more)
    assert said.startswith(f"{read}: is a file of ")
    assert f", which {option} would take the place of; give another name" in said
    assert "\n" not in said


@pytest.mark.parametrize("link", [os.symlink, os.link])
@EACH
def test_nor_through_a_link_to_it(world, words, option, more, link):
    for read in TABLE[words][1]:
        link(world / read, world / f"{read}-2")
        assert "would take the place of" in refused(world, words, option, f"{read}-2", more)


@pytest.mark.parametrize("place", ["st/MANIFEST", "st/segments/000001.h5", "st/new.csv", "in"])
@EACH
def test_nothing_is_written_into_a_store(world, words, option, more, place):
    os.symlink(world / "st" / "segments" / "000001.h5", world / "in")
    if words in FOLDERS:
        place = "st/new"
    assert "lies in the store" in refused(world, words, option, place, more)


@pytest.mark.parametrize("place", ["take.bvh", "take.amc", "ann.asf"])
@EACH
def test_no_motion_is_written_over_by_something_else(world, words, option, more, place):
    if (words, option) == ("blend make", "--output"):
        if place == "ann.asf":
            pytest.skip("is no suffix of new motion")
        assert ending(words, option, place)[0] == 4  # what the space holds
        return
    said = refused(world, words, option, place, more)
    assert words in FOLDERS or "holds motion, which would be lost" in said


@pytest.mark.parametrize(("words", "place"), IN_PLACE.items())
def test_what_may_be_changed_in_place_is_read(world, words, place):
    code, said = ending(words, "--output", place)
    assert code != 2, said  # the nonsense in it, or in the store, is found


def test_two_outputs_are_two_files(world):
    os.symlink(world / "p.csv", world / "q.csv")
    for place in ("p.csv", "./p.csv", "q.csv"):
        code, said = ending("retrieve", "--profile", place, "--output p.csv")
        assert (code, "is the file of both" in said) == (2, True)


def test_settings_that_are_read_are_an_input_wherever_they_are(world):
    (world / "below").mkdir()
    os.chdir(world / "below")
    assert ending("config show", "--output", "../mocapidx.toml")[0] == 2
    code, said = ending("features list", "--output", "../mocapidx.toml")
    assert (code, "a file of the settings" in said) == (2, True)
    assert (world / "mocapidx.toml").read_text() == ""


def test_an_annotation_file_of_a_folder_of_labels_is_an_input(world):
    (world / "elan").mkdir()
    (world / "elan" / "a.vtt").write_text("WEBVTT\n")
    with pytest.raises(MocapidxError, match="is a file of --labels"):
        check_output("--output", world / "elan/a.vtt", [("--labels", str(world / "elan"))], [])
    (world / "elan" / "hits.csv").write_text("rank,document\n")
    check_output("--output", world / "elan/hits.csv", [("--labels", str(world / "elan"))], [])


def test_the_list_of_joints_beside_a_take_is_an_input(world):
    for name in ("list.npy", "list.joints.txt"):
        (world / name).touch()
    with pytest.raises(MocapidxError, match=r"list\.joints\.txt: is a file of FILE"):
        check_output("--output", world / "list.joints.txt", [("FILE", str(world / "list.npy"))], [])


def test_pipes_and_devices_may_be_read_and_written(world):
    os.mkfifo("pipe")
    for place in ("pipe", os.devnull):
        check_output("--output", type(world)(place), [("RECORDS", place)], [("--graph", place)])


def test_a_class_or_a_title_is_no_file(world):
    for arguments in (
        "plot template t.h5 --class labels.csv",
        "report st hits.jsonl --title k.csv",
    ):
        name = arguments.split()[-1]
        result = CliRunner().invoke(program, [*arguments.split(), "--output", name])
        assert getattr(result.exception, "exit_code", 0) != 2 or "suffix" in str(result.exception)


def test_the_program_says_it_in_one_line(mocapidx, world, fixtures_dir, fixtures_store):
    take = world / "dov.amc"
    take.write_bytes((fixtures_dir / "takes" / "dov_take_120.amc").read_bytes())
    for suffix in ("amc", "asf"):
        (world / f"dov.{suffix}").write_bytes(take.read_bytes())
    before = tree(world), tree(fixtures_store)
    for arguments in (
        ("query", fixtures_store, "--example", take, "--select", "F20", "--output", take),
        ("doctor", take, "--output", take),
        ("skeleton", take, "--output", world / "dov.asf"),
        ("report", fixtures_store, "hits.jsonl", "--output", "hits.jsonl"),
        ("info", fixtures_store, "--output", fixtures_store / "MANIFEST"),
        ("info", fixtures_store, "--output", fixtures_store / "segments" / "000001.h5"),
    ):
        done = mocapidx(*arguments)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert done.stderr.startswith(f"Error: {arguments[-1]}: ")
    assert (tree(world), tree(fixtures_store)) == before


def test_results_are_replaced_as_ever(mocapidx, tmp_path, fixtures_store):
    for name in ("out.csv", "out.json", "out.txt"):
        for _ in range(2):
            arguments = ("info", fixtures_store, "--documents", "--format", "jsonl")
            done = mocapidx(*arguments, "--output", tmp_path / name)
            assert done.returncode == 0, done.stderr
