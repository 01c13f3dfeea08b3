import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mocapidx.errors import FeatureSetError, FormatError, ParameterError
from mocapidx.features.extract import extract_features
from mocapidx.features.featureset import load_feature_set
from mocapidx.tasks.features import (
    check_features,
    draw_features,
    feature_records,
    named_set,
    set_records,
)
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.learn_thresholds import learn_feature, separation_facts
from mocapidx.tasks.read import read_motion

F39 = load_feature_set("f39")
ODD = """
name = "odd"
source = "made up for a test"
[[feature]]
id = "HIGH"
part = "mix"
kind = "extent_y"
unit = "m"
on = 50.0
off = 49.0
[[feature]]
id = "LOW"
part = "mix"
kind = "extent_y"
unit = "m"
on = 0.2
off = 0.1
[[feature]]
id = "FAST"
part = "mix"
kind = "fast"
joints = ["root"]
unit = "m/s"
on = 0.3
off = 0.29
"""


@pytest.fixture(scope="module")
def clips(fixtures_dir):
    return fixtures_dir / "clips"


@pytest.fixture
def odd(tmp_path):
    path = tmp_path / "odd.toml"
    path.write_text(ODD)
    return path


def labels(path, rows):
    path.write_text("document,label,start_time,end_time\n" + "".join(f"{row}\n" for row in rows))
    return path


def test_shipped_sets_are_listed_with_their_digests():
    found = {record["name"]: record for record in set_records()}
    assert found.keys() == {"f31", "f39"}
    assert found["f39"]["digest"] == F39.digest[:12]
    assert (found["f31"]["features"], found["f31"]["lower"]) == (31, 11)


def test_a_store_names_the_set_that_it_was_made_with(clips, odd, tmp_path):
    index_files([clips / "squat"], tmp_path / "s.store", IndexOptions(feature_set=str(odd)))
    assert named_set(tmp_path / "s.store").digest == load_feature_set(odd).digest
    (record,) = set_records([tmp_path / "s.store"])
    assert record["name"] == "odd"


def test_features_are_shown_with_formula_and_thresholds():
    (record,) = feature_records(F39, "F33")
    assert record == {
        "id": "F33",
        "part": "mix",
        "name": "right hand lowered",
        "value": "height(rwrist)",
        "on": "< 1.2",
        "off": "< 1.4",
        "unit": "hl",
        "mirror": "F34",
    }


def test_a_trial_counts_what_extraction_gives(clips):
    records = {record["id"]: record for record in check_features(F39, [clips / "squat"])}
    bits = [extract_features(read_motion(path)) for path in (clips / "squat").glob("*.amc")]
    on = np.concatenate(bits).mean(axis=0)
    changes = sum((one[1:] != one[:-1]).sum(axis=0) for one in bits)
    minutes = sum(map(len, bits)) / 30 / 60
    place = F39.ids.index("F20")
    assert records["F20"]["on"] == pytest.approx(on[place], abs=1e-6)
    assert records["F20"]["changes_per_minute"] == pytest.approx(changes[place] / minutes, abs=1e-3)
    assert records["F20"]["lowest"] < 110 < records["F20"]["highest"] <= 180
    assert records["F25"]["lowest"] is None  # two values


def test_a_trial_says_what_looks_odd(clips, odd):
    found = {r["id"]: r["remark"] for r in check_features(load_feature_set(odd), [clips / "walk"])}
    assert (found["HIGH"], found["LOW"]) == ("never on", "always on")


def test_one_document_is_not_counted_twice(clips, tmp_path):
    index_files([clips / "squat"], tmp_path / "s.store")
    with pytest.raises(ParameterError, match="two of the inputs hold"):
        list(check_features(F39, [clips / "squat", tmp_path / "s.store"]))


def test_a_store_is_tried_at_its_own_rate(clips, tmp_path):
    index_files([clips / "squat"], tmp_path / "s.store", IndexOptions(rate=60.0))
    own = list(check_features(F39, [tmp_path / "s.store"]))
    files = list(check_features(F39, [clips / "squat"], rate=60.0))
    assert [record["on"] for record in own] == [record["on"] for record in files]


def test_a_trial_needs_motion(tmp_path):
    with pytest.raises(ParameterError, match="no motion"):
        list(check_features(F39, [tmp_path]))


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_feature_is_drawn_over_a_clip(clips, tmp_path, suffix):
    clip = next((clips / "squat").glob("ann*.amc"))
    picture = tmp_path / f"f.{suffix}"
    draw_features(F39, "F20,F25,F32", clip, picture, start=0.5, end=1.5)
    if suffix == "png":
        with Image.open(picture) as image:
            assert min(image.size) > 300
    else:
        assert picture.read_text().startswith("<?xml")
    first = picture.read_bytes()
    draw_features(F39, "F20,F25,F32", clip, picture, start=0.5, end=1.5)
    assert picture.read_bytes() == first


def test_documents_of_a_store_are_drawn_too(clips, tmp_path):
    index_files([clips / "squat"], tmp_path / "s.store")
    name = next((clips / "squat").glob("ann*.amc")).name
    draw_features(F39, "F20", tmp_path / "s.store", tmp_path / "f.png", document=name)
    assert (tmp_path / "f.png").exists()
    with pytest.raises(ParameterError, match="choose with --document"):
        draw_features(F39, "F20", tmp_path / "s.store", tmp_path / "f.png")
    with pytest.raises(ParameterError, match="no document 'x'"):
        draw_features(F39, "F20", tmp_path / "s.store", tmp_path / "f.png", document="x")


@pytest.mark.parametrize(
    ("select", "picture", "change", "named"),
    [
        ("all", "f.png", {}, "too many"),
        ("F20", "f.gif", {}, ".png or .svg"),
        ("F20", "f.png", {"start": 99.0}, "nothing lies there"),
        ("F99", "f.png", {}, "F99"),
    ],
)
def test_what_can_not_be_drawn_is_named(clips, tmp_path, select, picture, change, named):
    clip = next((clips / "squat").glob("*.amc"))
    with pytest.raises(ParameterError, match=named):
        draw_features(F39, select, clip, tmp_path / picture, **change)
    assert not (tmp_path / picture).exists()


def test_a_learned_threshold_tells_squatting_from_walking(clips, tmp_path):
    squats = [f"squat/{path.name},squat,0.8,1.1" for path in (clips / "squat").glob("ann*.amc")]
    walks = [f"walk/{path.name},walk,," for path in (clips / "walk").glob("*.amc")]
    positive, negative = labels(tmp_path / "p.csv", squats), labels(tmp_path / "n.csv", walks)
    for feature in ("F20", "F37"):
        found = learn_feature([clips], F39, feature, positive, negative)
        assert found.right == found.area == 1
        assert found.on < found.threshold < found.off  # both turn on below
    facts = separation_facts(F39, "F20", found)
    assert facts["on"] == [0.0, found.on]
    index_files([clips], tmp_path / "s.store")
    stored = learn_feature([tmp_path / "s.store"], F39, "F37", positive, negative)
    assert stored == learn_feature([clips], F39, "F37", positive, negative)


def test_a_learned_threshold_works_in_a_set(clips, tmp_path):
    squats = [f"squat/{path.name},s,0.8,1.1" for path in (clips / "squat").glob("ann*.amc")]
    walks = [f"walk/{path.name},w,," for path in (clips / "walk").glob("*.amc")]
    positive, negative = labels(tmp_path / "p.csv", squats), labels(tmp_path / "n.csv", walks)
    found = learn_feature([clips], F39, "F37", positive, negative)
    (tmp_path / "own.toml").write_text(
        'name = "own"\nsource = "learned"\n[[feature]]\nid = "SMALL"\npart = "mix"\n'
        f'kind = "extent_y"\nunit = "hl"\nwhen = "below"\non = {found.on}\noff = {found.off}\n'
    )
    own = load_feature_set(tmp_path / "own.toml")
    for path in (clips / "walk").glob("*.amc"):
        assert not extract_features(read_motion(path), own).any()
    for path in (clips / "squat").glob("ann*.amc"):
        assert extract_features(read_motion(path), own)[24:33].all()


@pytest.mark.parametrize(
    ("feature", "named"), [("F32", "within a range"), ("lower", "names 12 features")]
)
def test_features_without_a_single_threshold_can_not_be_learned(clips, tmp_path, feature, named):
    name = f"squat/{next((clips / 'squat').glob('*.amc')).name}"
    positive = labels(tmp_path / "p.csv", [f"{name},a,0,0.5"])
    negative = labels(tmp_path / "n.csv", [f"{name},b,0.5,1"])
    with pytest.raises(ParameterError, match=named):
        learn_feature([clips], F39, feature, positive, negative)


def test_wrong_examples_are_named_by_file_and_line(clips, tmp_path):
    name = f"squat/{next((clips / 'squat').glob('*.amc')).name}"
    good = labels(tmp_path / "good.csv", [f"{name},a,0,0.5"])
    for rows, named in (
        (["none.amc,a,,"], r"bad\.csv:2: no document 'none\.amc'"),
        ([f"{name},a,90,95"], r"bad\.csv:2: .* no frame of it lies in the label"),
        ([f"{name},a,0.4,0.6"], r"bad\.csv:2: says the opposite of another label"),
    ):
        with pytest.raises(FormatError, match=named):
            learn_feature([clips], F39, "F20", good, labels(tmp_path / "bad.csv", rows))


def test_the_commands_print_records_and_draw(mocapidx, clips, odd, tmp_path):
    listed = mocapidx("features", "list", odd, "--format", "jsonl")
    assert json.loads(listed.stdout)["name"] == "odd"
    shown = mocapidx("features", "show", "f31", "--select", "U1,U2")
    assert [line.split()[0] for line in shown.stdout.splitlines()] == ["id", "U1", "U2"]
    checked = mocapidx("features", "check", odd)
    assert (checked.returncode, checked.stderr) == (0, "")
    tried = mocapidx("features", "check", odd, clips / "walk", "--format", "csv")
    assert "HIGH" in tried.stdout
    assert "never on" in tried.stdout
    clip = next((clips / "squat").glob("*.amc"))
    drawn = mocapidx("features", "plot", clip, "--feature", "F20", "--output", tmp_path / "f.png")
    assert (drawn.returncode, drawn.stdout) == (0, "")
    assert (tmp_path / "f.png").exists()


def test_the_command_learns_a_threshold(mocapidx, clips, tmp_path):
    name = f"squat/{next((clips / 'squat').glob('ann*.amc')).name}"
    positive = labels(tmp_path / "p.csv", [f"{name},a,0.8,1.1"])
    negative = labels(tmp_path / "n.csv", [f"{name},b,0,0.3"])
    options = ["--feature", "F20", "--positive", positive, "--negative", negative]
    done = mocapidx("features", "learn-threshold", clips, *options, "--format", "jsonl")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["right"] == 1
    assert "threshold" in mocapidx("features", "learn-threshold", clips, *options).stdout
    missing = mocapidx("features", "learn-threshold", *options)
    assert (missing.returncode, missing.stderr.count("\n")) == (2, 1)


def test_a_wrong_set_is_one_line_and_exit_3(mocapidx, tmp_path):
    (tmp_path / "bad.toml").write_text(ODD.replace('kind = "fast"', 'kind = "quick"'))
    done = mocapidx("features", "check", tmp_path / "bad.toml")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (3, "", 1)
    assert "feature FAST" in done.stderr
    with pytest.raises(FeatureSetError):
        named_set(Path("none.toml"))
