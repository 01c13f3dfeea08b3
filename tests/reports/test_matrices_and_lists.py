"""Pictures of feature matrices, inverted lists and confusion tables."""

import io
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from PIL import Image

from mocapidx.reports.confusion import confusion_picture
from mocapidx.reports.lists import list_sizes_picture
from mocapidx.reports.segments import feature_matrix_picture

ODD = 'a $x_{ <script>alert("1")</script> \x1b[2J \udc80 \u4e2d'


def matrix(suffix="png", name="walk", frames=90):
    bits = np.arange(frames)[:, None] // np.array([3, 10, 25]) % 2 > 0
    names = [name, "F2 left", "F3 far"]
    return feature_matrix_picture(
        bits, names, ["upper", "upper", "lower"], 30.0,
        title=name, start=2.0, untrusted=[False, True, False], suffix=suffix,
    )  # fmt: skip


def lists(suffix="png", name="walk", frames=40):
    sizes = {name: np.arange(1, frames), "lower": np.array([5]), "mix": np.array([], int)}
    return list_sizes_picture(sizes, title=name, suffix=suffix)


def confusion(suffix="png", name="walk", frames=30):
    classes = [f"{name} {i}" for i in range(min(frames, 30))]
    seconds = {(label, classes[0]): 1.5 for label in classes}
    return confusion_picture(seconds, classes, [*classes, "(none)"], title=name, suffix=suffix)


DRAWN = pytest.mark.parametrize("draw", [matrix, lists, confusion])


@DRAWN
def test_equal_input_gives_equal_bytes(draw):
    for suffix in ("png", "svg"):
        assert draw(suffix) == draw(suffix)


@DRAWN
def test_odd_names_are_inert(draw):
    tree = ElementTree.fromstring(draw("svg", ODD))
    assert not [element for element in tree.iter() if element.tag.endswith(("script", "text"))]


@DRAWN
@pytest.mark.parametrize("frames", [1, 4000])
def test_any_length_gives_a_picture_of_bounded_size(draw, frames):
    width, height = Image.open(io.BytesIO(draw(frames=frames))).size
    assert 200 < width < 3000
    assert 80 < height < 3000


def test_a_segment_begins_where_a_trusted_feature_changes():
    """The strip of one colour shows as many alternations as there are segments."""
    bits = np.repeat(np.array([[0, 0], [1, 0], [1, 1]], bool), 30, axis=0)

    def strip(untrusted):
        picture = feature_matrix_picture(
            bits, ["a", "b"], ["mix", "mix"], 30.0, title="t", untrusted=untrusted
        )
        pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)
        blue = (abs(pixels - (0, 114, 178)).sum(axis=2) < 9).any(axis=0)
        return int((np.diff(blue.astype(int)) == 1).sum())

    assert strip([False, False]) == 1  # light, dark, light
    assert strip([True, True]) == 0  # nothing is known, so nothing changes
