import numpy as np
import pytest

from mocapidx.errors import ParameterError
from mocapidx.templates.template import MotionTemplate, TemplateSet


def template(label="squat", **changes):
    values = {"matrix": np.full((4, 2), 0.5), "feature_set_digest": "d", "rate": 30.0}
    return MotionTemplate(label, **(values | changes))


def test_the_threshold_is_the_class_own_or_the_papers():
    assert template().threshold == 0.06
    assert template(tau=0.03).threshold == 0.03


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"matrix": np.zeros(3)}, "shape"),
        ({"matrix": np.zeros((0, 2))}, "frames"),
        ({"matrix": np.zeros((3, 65))}, "64"),
        ({"matrix": np.zeros((3, 2), dtype=np.float32)}, "float64"),
        ({"matrix": np.full((3, 2), 1.5)}, "between 0 and 1"),
        ({"matrix": np.full((3, 2), np.nan)}, "between 0 and 1"),
        ({"delta": 0.5}, "delta"),
        ({"rate": 0.0}, "rate"),
        ({"keyframes": (4,)}, "keyframes"),
        ({"keyframes": (2, 1)}, "keyframes"),
        ({"keyframes": (1, 1)}, "keyframes"),
    ],
)
def test_values_out_of_range_are_refused(changes, complaint):
    with pytest.raises(ParameterError, match=complaint):
        template(**changes)


def test_a_set_finds_the_templates_of_a_class():
    templates = (template("a"), template("b"), template("a", kind="stretch"))
    family = TemplateSet(templates, "f", "d", "", 30.0)
    assert family.labels == ("a", "b")
    assert family.of("a") == (templates[0], templates[2])
    with pytest.raises(ParameterError, match="'c'; there are: a, b"):
        family.of("c")


def test_a_set_holds_templates_of_one_feature_set_and_rate():
    with pytest.raises(ParameterError, match="another feature set or rate"):
        TemplateSet((template(rate=60.0),), "f", "d", "", 30.0)
