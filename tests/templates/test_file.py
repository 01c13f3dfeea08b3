from dataclasses import fields

import numpy as np
import pytest

from mocapidx.errors import StoreError
from mocapidx.store.templates import read_templates, write_templates
from mocapidx.templates.file import FIELDS, load_templates, save_templates
from mocapidx.templates.template import MotionTemplate, TemplateSet


@pytest.fixture
def templates():
    random = np.random.default_rng(0)
    full = MotionTemplate(
        label="squat \udc80",
        matrix=random.random((5, 3)),
        feature_set_digest="d",
        rate=30.0,
        delta=0.2,
        mean_length=4.5,
        passes=3,
        documents=("a/x.amc", "b.bvh@1:2.5"),
        spread=(0.1, np.float64(0.2)),
        keyframes=(1, 4),
        keyframe_tolerance=2,
        positive_cost=np.float32(0.5),
        background_cost=0.25,
        tau=0.1,
        kind="stretch",
        looping=True,
    )
    plain = MotionTemplate("plain", np.zeros((1, 3)), "d", 30)
    return TemplateSet((full, plain), "tiny", "d", "text", 30.0)


def changed(path, change):
    meta, matrices = read_templates(path)
    change(meta)
    write_templates(path, meta, matrices)


def test_every_field_of_a_template_survives(templates, tmp_path):
    save_templates(tmp_path / "t.h5", templates)
    loaded = load_templates(tmp_path / "t.h5")
    for name in ("feature_set_name", "feature_set_digest", "feature_set_text", "rate"):
        assert getattr(loaded, name) == getattr(templates, name)
    for one, other in zip(loaded.templates, templates.templates, strict=True):
        for field in fields(MotionTemplate):
            left, right = getattr(one, field.name), getattr(other, field.name)
            np.testing.assert_array_equal(left, right) if field.name == "matrix" else None
            assert field.name == "matrix" or left == right, field.name


def test_no_field_is_forgotten():
    own = {field.name for field in fields(MotionTemplate)}
    assert own == set(FIELDS) | {"matrix", "feature_set_digest", "rate"}


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda meta: meta.pop("templates"), "'templates' is missing"),
        (lambda meta: meta["templates"].pop(), "1 templates for 2 matrices"),
        (lambda meta: meta.update(rate="30"), "'rate' is missing or of a wrong type"),
        (lambda meta: meta.update(rate=0.0), "rate must be positive"),
        (lambda meta: meta.update(templates=[1, 2]), "no JSON object"),
        (lambda meta: meta["templates"][0].update(label=5), "'label'"),
        (lambda meta: meta["templates"][0].update(kind="odd"), "kind"),
        (lambda meta: meta["templates"][0].update(delta=0.7), "delta"),
        (lambda meta: meta["templates"][0].update(keyframes=[10**30]), "keyframes"),
        (lambda meta: meta["templates"][0].update(keyframes=[True]), "'keyframes'"),
        (lambda meta: meta["templates"][0].update(documents=[None]), "'documents'"),
    ],
)
def test_a_file_whose_parts_do_not_fit_is_refused(templates, tmp_path, change, complaint):
    save_templates(tmp_path / "t.h5", templates)
    changed(tmp_path / "t.h5", change)
    with pytest.raises(StoreError, match=complaint):
        load_templates(tmp_path / "t.h5")


def test_entries_that_are_no_shares_are_refused(templates, tmp_path):
    save_templates(tmp_path / "t.h5", templates)
    meta, matrices = read_templates(tmp_path / "t.h5")
    write_templates(tmp_path / "t.h5", meta, [matrices[0] * np.nan, matrices[1]])
    with pytest.raises(StoreError, match="between 0 and 1"):
        load_templates(tmp_path / "t.h5")
