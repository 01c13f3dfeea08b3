import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError, StoreError
from mocapidx.features.featureset import parse_feature_set
from mocapidx.tasks.labels import read_labels
from mocapidx.tasks.learn import LearnOptions, find_labels, learn_classes, save_learning
from mocapidx.templates.file import load_templates
from tests.made_words import F39, GESTURES, gesture, make_word_store, rest


def clips(count=4, seed=0):
    """Some performances of each gesture by two people, one document each."""
    rng = np.random.default_rng(seed)
    return {
        f"{name}/{'ab'[n % 2]}{n}.amc": np.vstack((rest(3), gesture(name, rng), rest(3)))
        for name in GESTURES
        for n in range(count)
    }


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return make_word_store(tmp_path_factory.mktemp("learn") / "s.store", clips(), batches=2)


def labelled(tmp_path, text):
    path = tmp_path / "labels.csv"
    path.write_text(text)
    return read_labels(path)


def same(one, other):
    assert len(one.templates) == len(other.templates)
    for left, right in zip(one.templates, other.templates, strict=True):
        assert (left.label, left.tau, left.keyframes) == (right.label, right.tau, right.keyframes)
        np.testing.assert_array_equal(left.matrix, right.matrix)


def test_every_label_becomes_a_template_with_its_threshold(store, tmp_path):
    learning = learn_classes(store, find_labels(store, labels_from="folder"))
    assert learning.templates.labels == ("bow", "kick", "raise")
    for template in learning.templates.templates:
        assert template.kind == "class"
        assert sorted(template.documents) == sorted(
            f"{template.label}/{'ab'[n % 2]}{n}.amc" for n in range(4)
        )
        assert template.tau is not None
        assert template.positive_cost < template.tau < template.background_cost
        assert template.feature_set_digest == F39.digest
        assert set(np.flatnonzero(template.matrix.max(axis=0) > 0.5)) <= set(
            GESTURES[template.label]
        )
    save_learning(learning, tmp_path / "t.h5")
    same(load_templates(tmp_path / "t.h5"), learning.templates)


def test_processes_learn_the_same(store):
    labels = find_labels(store, labels_from="folder")
    alone = learn_classes(store, labels)
    steps = []
    together = learn_classes(
        store, labels, LearnOptions(jobs=2), progress=lambda *step: steps.append(step)
    )
    same(alone.templates, together.templates)
    assert steps == [(1, 3), (2, 3), (3, 3)]


def test_only_the_classes_asked_for_are_learned_and_the_rest_is_background(store):
    labels = find_labels(store, labels_from="folder")
    everything = learn_classes(store, labels)
    one = learn_classes(store, labels, LearnOptions(classes=("kick",)))
    assert one.templates.labels == ("kick",)
    assert one.templates.templates[0].tau == everything.templates.of("kick")[0].tau


def test_times_cut_examples_out_of_a_document(tmp_path):
    rng = np.random.default_rng(1)
    parts = [rest(30), gesture("kick", rng), rest(30), gesture("bow", rng), rest(30)]
    bounds = np.cumsum([len(part) for part in parts]) / 30.0
    store = make_word_store(tmp_path / "s.store", {"take.amc": np.vstack(parts)})
    text = "document,label,start_time,end_time\n"
    text += f"take.amc,kick,{bounds[0]:.4f},{bounds[1]:.4f}\n"
    text += f"take.amc,bow,{bounds[2]:.4f},{bounds[3]:.4f}\n"
    learning = learn_classes(store, labelled(tmp_path, text))
    kick = learning.templates.of("kick")[0]
    np.testing.assert_array_equal(kick.matrix, parts[1])
    assert kick.documents == (f"take.amc@1:{bounds[1]:g}",)
    assert any("kick: no basis for a threshold" in remark for remark in learning.remarks)


def test_stretches_of_many_repetitions_are_cut(tmp_path):
    rng = np.random.default_rng(2)
    takes = {
        f"{name}.amc": np.vstack([gesture(name, rng) for _ in range(6)]) for name in ("kick", "bow")
    }
    store = make_word_store(tmp_path / "s.store", takes)
    labels = labelled(tmp_path, "document,label\nkick.amc,kick\nbow.amc,bow\n")
    learning = learn_classes(store, labels, LearnOptions(repetitions="auto"))
    kinds = [template.kind for template in learning.templates.of("kick")]
    assert kinds == ["class", "stretch"]
    for found in learning.classes:
        assert found.template.looping
        assert 5 <= found.repetitions <= 7
        assert 32 <= len(found.template.matrix) <= 48


def test_a_long_stretch_without_repetitions_is_told_with_its_line(tmp_path):
    takes = {"kick.amc": gesture("kick", np.random.default_rng(0)), "still.amc": rest(4200)}
    store = make_word_store(tmp_path / "s.store", takes)
    labels = labelled(tmp_path, "document,label\nkick.amc,kick\nstill.amc,still\n")
    with pytest.raises(FormatError, match=r"labels.csv:3: no repetitions were found in 140 s"):
        learn_classes(store, labels, LearnOptions(repetitions="auto"))


def test_each_class_is_reported_when_it_is_learned(store):
    told = []
    learning = learn_classes(store, find_labels(store, labels_from="folder"), report=told.append)
    assert tuple(told) == learning.classes


def test_what_a_rig_cannot_tell_is_undecided_and_not_zero(tmp_path):
    documents = clips()
    lost = 1 << GESTURES["kick"][2]
    store = make_word_store(
        tmp_path / "s.store", documents, untrusted=dict.fromkeys(documents, lost)
    )
    learning = learn_classes(store, find_labels(store, labels_from="folder"))
    for template in learning.templates.templates:
        np.testing.assert_array_equal(template.matrix[:, GESTURES["kick"][2]], 0.5)


def test_unlabelled_motion_lowers_a_threshold_and_labelled_documents_do_not_count(store, tmp_path):
    labels = find_labels(store, labels_from="folder")
    plain = learn_classes(store, labels)
    itself = learn_classes(store, labels, LearnOptions(background=store))
    same(plain.templates, itself.templates)
    rng = np.random.default_rng(5)
    half = gesture("kick", rng)
    half[:, GESTURES["kick"][6:]] = False
    other = make_word_store(tmp_path / "b.store", {"long.amc": np.vstack((rest(400), half))})
    lower = learn_classes(store, labels, LearnOptions(background=other))
    assert lower.templates.of("kick")[0].tau < plain.templates.of("kick")[0].tau


def test_a_background_of_other_features_is_refused(store, tmp_path):
    other = parse_feature_set(F39.text.replace("1.8", "1.9", 1), "other")
    background = make_word_store(tmp_path / "b.store", {"x.amc": rest(9)}, feature_set=other)
    with pytest.raises(StoreError, match="made with feature set"):
        learn_classes(
            store, find_labels(store, labels_from="folder"), LearnOptions(background=background)
        )


def test_a_class_without_examples_is_told(store):
    labels = find_labels(store, labels_from="folder")
    with pytest.raises(ParameterError, match=r"'jump' has no example.*bow, kick, raise"):
        learn_classes(store, labels, LearnOptions(classes=("jump",)))


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("kick/none.amc,kick,,", "labels.csv:2: no document 'kick/none.amc'"),
        ("kick/a0.amc,kick,0,0.05", "labels.csv:2: 'kick' has 2 frames"),
        ("long.amc,kick,,", "labels.csv:2: 'kick' lasts 167 s.*--repetitions auto"),
    ],
)
def test_bad_rows_are_told_with_their_line(tmp_path, row, complaint):
    documents = clips(1) | {"long.amc": rest(5000)}
    store = make_word_store(tmp_path / "s.store", documents)
    labels = labelled(tmp_path, f"document,label,start_time,end_time\n{row}\n")
    with pytest.raises(FormatError, match=complaint):
        learn_classes(store, labels)


def test_labels_come_from_one_place(store, tmp_path):
    with pytest.raises(ParameterError, match="--labels"):
        find_labels(store)
    with pytest.raises(ParameterError, match="--labels"):
        find_labels(store, tmp_path / "x.csv", "folder")
