import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError, StoreError
from mocapidx.features.featureset import load_feature_set
from mocapidx.tasks.template import (
    combine_classes,
    design_templates,
    edit_templates,
    keyframe_class,
    mask_class,
    mirror_class,
    shown_template,
    subtract_classes,
    template_records,
)
from mocapidx.tasks.template_records import draw_text
from mocapidx.templates.file import load_templates, save_templates
from mocapidx.templates.template import MotionTemplate, TemplateSet

F39 = load_feature_set("f39")
ARMS = "upper,F27,F28,F33,F34"


def make(label, seed, frames=20, **changes):
    matrix = np.random.default_rng(seed).choice([0.0, 0.02, 0.5, 0.97, 1.0], (frames, 39))
    values = {"mean_length": float(frames), "documents": ("a", "b"), "spread": (0.1, 0.2)}
    return MotionTemplate(label, matrix, F39.digest, 30.0, **(values | changes))


@pytest.fixture
def templates(tmp_path):
    """A file with three classes, one of which has a stretch template too."""
    some = (
        make("throw", 1, tau=0.05, positive_cost=0.01, background_cost=0.067),
        make("grab", 2, 25),
        make("squat", 3, 30, looping=True),
        make("squat", 4, 61, kind="stretch"),
    )
    path = tmp_path / "t.h5"
    save_templates(path, TemplateSet(some, F39.name, F39.digest, F39.text, 30.0))
    return path


def labels(path):
    return [template.label for template in load_templates(path).templates]


def test_a_list_names_every_template_in_order(templates):
    records = template_records(templates)
    assert [record["class"] for record in records] == ["throw", "grab", "squat", "squat"]
    assert [record["kind"] for record in records] == ["class", "class", "class", "stretch"]
    assert records[0]["tau"] == 0.05
    assert records[1]["tau"] is None
    assert records[0]["spread"] == pytest.approx(0.15)


def test_a_mirrored_class_is_added_behind_the_others(templates, tmp_path):
    mirror_class(templates, "throw", "throwLeft", tmp_path / "u.h5")
    assert labels(tmp_path / "u.h5") == [*labels(templates), "throwLeft"]
    (old,), (new,) = (load_templates(tmp_path / "u.h5").of(x) for x in ("throw", "throwLeft"))
    np.testing.assert_array_equal(new.matrix, old.matrix[:, F39.mirror])


def test_the_result_may_be_the_file_itself(templates):
    mask_class(templates, "grab", templates, features=ARMS)
    assert labels(templates) == ["throw", "grab", "squat", "squat"]
    (grab,) = load_templates(templates).of("grab")
    arms = [i for i in range(39) if F39.select(ARMS) >> i & 1]
    assert len(arms) == 18
    assert (grab.matrix[:, arms] == 0.5).all()


def test_a_class_is_masked_in_its_place_with_all_its_templates(templates):
    mask_class(templates, "squat", templates, features="F1", start=0.1, end=0.5)
    squats = load_templates(templates).of("squat")
    assert [len(each.matrix) for each in squats] == [30, 61]
    for each in squats:
        assert (each.matrix[3:15, 0] == 0.5).all()


def test_a_copy_leaves_the_class_as_it_was(templates):
    before = load_templates(templates).of("squat")
    mask_class(templates, "squat", templates, features="F1", new_label="free")
    after = load_templates(templates).of("squat")
    for one, other in zip(before, after, strict=True):
        np.testing.assert_array_equal(one.matrix, other.matrix)
    assert labels(templates)[-2:] == ["free", "free"]


def test_combining_and_subtracting_take_class_templates(templates):
    combine_classes(templates, ["grab", "squat"], "both", templates)
    (both,) = load_templates(templates).of("both")
    assert both.mean_length == 27.5
    subtract_classes(templates, "throw", ["grab", "squat"], templates, new_label="only throw")
    (left,) = load_templates(templates).of("only throw")
    (throw,) = load_templates(templates).of("throw")
    changed = left.matrix != throw.matrix
    assert (left.matrix[changed] == 0.5).all()


def test_keyframes_by_hand(templates):
    keyframe_class(templates, "squat", [20, 4], 3, templates)
    whole, stretch = load_templates(templates).of("squat")
    assert (whole.keyframes, whole.keyframe_tolerance) == ((4, 20), 3)
    assert stretch.keyframes == ()
    keyframe_class(templates, "squat", [], 0, templates)
    assert load_templates(templates).of("squat")[0].keyframes == ()


def test_edits_from_toml_change_and_add(templates, tmp_path):
    design = tmp_path / "d.toml"
    design.write_text(
        'feature_set = "f39"\n[[template]]\nclass = "grab"\ntau = 0.09\n'
        '[[template]]\nclass = "sweep"\nframes = 50\n'
        '[[template.set]]\nfeatures = "F13,F32,F33"\nvalue = 1\n'
    )
    assert edit_templates(templates, design, templates) == ("grab", "sweep")
    assert labels(templates) == ["throw", "grab", "squat", "squat", "sweep"]
    assert load_templates(templates).of("grab")[0].tau == 0.09


def test_templates_without_training(tmp_path):
    design = tmp_path / "d.toml"
    design.write_text('rate = 60\n[[template]]\nclass = "sweep"\nframes = 50\n')
    design_templates(design, tmp_path / "n.h5")
    templates = load_templates(tmp_path / "n.h5")
    assert (templates.rate, templates.feature_set_name, templates.labels) == (60, "f39", ("sweep",))


@pytest.mark.parametrize(
    ("change", "error", "complaint"),
    [
        (lambda t: mirror_class(t, "kick", "x", t), ParameterError, "there are: throw, grab"),
        (lambda t: mirror_class(t, "grab", "squat", t), ParameterError, "'squat' already"),
        (lambda t: mask_class(t, "grab", t), ParameterError, "nothing to match"),
        (lambda t: mask_class(t, "grab", t, features="F99"), ParameterError, "F99"),
        (lambda t: mask_class(t, "grab", t, start=9.0), ParameterError, "lasts 0.83 s; nothing"),
        (lambda t: subtract_classes(t, "grab", ["grab"], t), ParameterError, "from itself"),
        (lambda t: combine_classes(t, ["grab"], "x", t), ParameterError, "at least two"),
        (lambda t: keyframe_class(t, "grab", [25], 0, t), ParameterError, "0 to 24"),
        (lambda t: edit_templates(t, t.with_name("no"), t), FormatError, "no such file"),
        (lambda t: mirror_class(t.with_name("no"), "a", "b", t), StoreError, "no template file"),
    ],
)
def test_what_can_not_be_done_leaves_the_file_as_it_is(templates, change, error, complaint):
    before = templates.read_bytes()
    with pytest.raises(error, match=complaint):
        change(templates)
    assert templates.read_bytes() == before


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('feature_set = "f31"\n[[template]]\nclass = "grab"\n', "'f31', the templates have 'f39'"),
        ('rate = 60\n[[template]]\nclass = "grab"\n', "key 'rate': 60, the templates have 30"),
    ],
)
def test_a_design_must_fit_what_it_changes(templates, tmp_path, text, complaint):
    design = tmp_path / "d.toml"
    design.write_text(text)
    with pytest.raises(FormatError, match=complaint):
        edit_templates(templates, design, templates)


def test_a_new_template_needs_a_length(tmp_path):
    design = tmp_path / "d.toml"
    design.write_text('[[template]]\nclass = "x"\n')
    with pytest.raises(FormatError, match="'frames' is missing; a new template needs it"):
        design_templates(design, tmp_path / "n.h5")


def test_a_template_in_text_has_a_line_for_each_feature(templates):
    (throw,), feature_set = shown_template(templates, "throw")
    lines = list(draw_text(throw, feature_set, width=100))
    rows = [line for line in lines if line.lstrip().startswith("F")]
    assert [row.split()[0] for row in rows] == list(feature_set.ids)
    margin = rows[0].index("forwards") + 8
    assert "threshold 0.0500" in "\n".join(lines)
    assert all(set(row[60:]) <= set("#. ") for row in rows)
    assert margin < 60


def test_entries_in_text_are_those_of_the_match():
    matrix = np.full((3, 39), 0.5)
    matrix[:, 0], matrix[1, 1], matrix[:, 2] = 1.0, 0.0, 0.85
    template = MotionTemplate("x", matrix, F39.digest, 30.0, keyframes=(1,))
    lines = list(draw_text(template, F39))
    by_name = {line.split()[0]: line.rstrip()[-3:] for line in lines if line.strip()}
    assert by_name["F1"] == "###"
    assert next(line for line in lines if " F2 " in line).endswith("  .")
    assert by_name["keyframes"].endswith("^")
    assert "no threshold of its own, 0.06 is taken" in "\n".join(lines)


def test_long_templates_fit_the_width_and_bad_separation_is_said():
    long = make("x", 5, 400, positive_cost=0.08, background_cost=0.1, tau=0.09)
    lines = list(draw_text(long, F39, width=80))
    assert max(map(len, lines[6:])) <= 80
    assert any("not well separated" in line and "0.80" in line for line in lines)


def test_a_class_name_can_not_steer_the_terminal():
    assert "\x1b" not in "".join(draw_text(make("a\x1b[2J", 1), F39))
