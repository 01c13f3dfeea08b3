import json

import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError, StoreError
from mocapidx.features.featureset import load_feature_set
from mocapidx.tasks.learn import find_labels, learn_classes, save_learning
from mocapidx.tasks.plot import draw_annotations, draw_distances, draw_templates
from mocapidx.templates.file import load_templates
from mocapidx.templates.template import TemplateSet
from tests.made_words import GESTURES, gesture, make_word_store, rest
from tests.tasks.test_learn import clips

F39 = load_feature_set("f39")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plot")
    train = make_word_store(folder / "train.store", clips())
    save_learning(learn_classes(train, find_labels(train, labels_from="folder")), folder / "t.h5")
    rng = np.random.default_rng(4)
    take = np.vstack([part for n in GESTURES for part in (rest(20), gesture(n, rng))])
    make_word_store(folder / "takes.store", {"a": take, "b": take[::-1].copy()})
    (folder / "labels.csv").write_text(
        "document,label,start_time,end_time\na,raise,0.7,2\na,kick,2.7,\nb,bow,0,1\nc,bow,0,1\n"
    )
    return folder


def test_templates_are_drawn_into_one_file_each(folder, tmp_path):
    templates = load_templates(folder / "t.h5").of("kick")
    paths = draw_templates([*templates, *templates], F39, tmp_path / "kick.png")
    assert [path.name for path in paths] == ["kick.png", "kick-2.png"]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert paths[0].read_bytes().startswith(b"\x89PNG")


def test_distances_over_documents_of_a_store(folder, tmp_path):
    some = {"documents": ["b", "a"], "labels": folder / "labels.csv", "classes": ["kick"]}
    for name in ("one.svg", "two.svg"):
        draw_distances(folder / "takes.store", folder / "t.h5", tmp_path / name, **some)
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()
    other = some | {"documents": ["a", "b"]}
    draw_distances(folder / "takes.store", folder / "t.h5", tmp_path / "two.svg", **other)
    assert (tmp_path / "one.svg").read_bytes() != (tmp_path / "two.svg").read_bytes()


def test_distances_over_a_motion_file(folder, fixtures_dir, tmp_path):
    clip = next(fixtures_dir.glob("clips/walk/*.amc"))
    draw_distances(clip, folder / "t.h5", tmp_path / "walk.png", tau=0.2, steps="printed")
    assert (tmp_path / "walk.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("changes", "error", "complaint"),
    [
        ({}, ParameterError, "holds 2 documents; choose with --document"),
        ({"documents": ["x"]}, ParameterError, "no document 'x'"),
        ({"documents": ["a"], "classes": ["jump"]}, ParameterError, "'jump'"),
        ({"documents": ["a"], "labels": "none"}, FormatError, "no such labels file"),
    ],
)
def test_what_can_not_be_drawn_leaves_no_picture(folder, tmp_path, changes, error, complaint):
    if "labels" in changes:
        changes = changes | {"labels": tmp_path / "none"}
    with pytest.raises(error, match=complaint):
        draw_distances(folder / "takes.store", folder / "t.h5", tmp_path / "x.png", **changes)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_neither_motion_file_nor_store(folder, fixtures_dir, tmp_path):
    with pytest.raises(ParameterError, match="give a motion file or a store"):
        draw_distances(fixtures_dir / "clips", folder / "t.h5", tmp_path / "x.png")


def test_templates_of_another_rate_are_refused(folder, tmp_path):
    known = load_templates(folder / "t.h5")
    empty = TemplateSet((), F39.name, F39.digest, F39.text, 60.0)
    with pytest.raises(StoreError, match="frames/s"):
        draw_distances(folder / "takes.store", empty, tmp_path / "x.png", documents=["a"])
    many = TemplateSet(known.templates * 20, F39.name, F39.digest, F39.text, known.rate)
    with pytest.raises(ParameterError, match="60 classes are too many"):
        draw_distances(folder / "takes.store", many, tmp_path / "x.png", classes=["kick"] * 3)


def annotations(path, documents=("a", "b")):
    rows = [
        {"document": name, "start_time": 0, "end_time": 2, "label": "kick"} for name in documents
    ]
    path.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    return path


def test_annotations_with_their_labels(folder, tmp_path):
    records = annotations(tmp_path / "a.jsonl")
    draw_annotations(records, tmp_path / "plain.png")
    draw_annotations(records, tmp_path / "labels.png", labels=folder / "labels.csv")
    draw_annotations(records, tmp_path / "one.png", labels=folder / "labels.csv", documents=["c"])
    sizes = {path.name: path.stat().st_size for path in tmp_path.glob("*.png")}
    assert sizes["labels.png"] > sizes["plain.png"] > 1000
    assert sizes["one.png"] > 1000


def test_what_there_is_nothing_to_draw_of(tmp_path):
    records = annotations(tmp_path / "a.jsonl")
    with pytest.raises(ParameterError, match="nothing is said of a document 'x'"):
        draw_annotations(records, tmp_path / "x.png", documents=["x"])
    with pytest.raises(ParameterError, match=r"pictures are \.png or \.svg files"):
        draw_annotations(records, tmp_path / "x.gif")
    many = annotations(tmp_path / "many", [str(n) for n in range(101)])
    with pytest.raises(ParameterError, match="101 documents are too many"):
        draw_annotations(many, tmp_path / "x.png")
    (tmp_path / "none").write_text("")
    with pytest.raises(ParameterError, match="nothing to draw"):
        draw_annotations(tmp_path / "none", tmp_path / "x.png")


def test_the_program_draws(folder, mocapidx, tmp_path):
    done = mocapidx(
        "plot", "distance", folder / "takes.store", "--templates", folder / "t.h5",
        "--document", "a", "--output", tmp_path / "d.svg",
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    done = mocapidx("plot", "annotation", "-", "--output", tmp_path / "x.png", input="{}")
    assert done.returncode == 3
    done = mocapidx(
        "template", "show", folder / "t.h5", "--class", "kick", "--picture", tmp_path / "k.PNG"
    )
    assert done.returncode == 0
    assert "F15 right foot behind left leg" in done.stdout
    assert (tmp_path / "k.PNG").read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_has_no_folder_is_one_line(mocapidx, tmp_path):
    records = annotations(tmp_path / "a.jsonl")
    done = mocapidx("plot", "annotation", records, "--output", tmp_path / "no" / "x.png")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
