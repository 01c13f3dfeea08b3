import io
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from PIL import Image

from mocapidx.alignment.banded import refine_match
from mocapidx.alignment.coarse import match_segments
from mocapidx.reports.alignment import alignment_picture
from mocapidx.reports.features import FeaturePanel, LeafCurve, feature_picture

ODD = 'a $x_{ <script>alert("1")</script> \x1b[2J \udc80 \u4e2d'


def alignment(suffix="png", name="walk", length=40):
    one = np.repeat(np.array([0, 1, 3, 2], np.uint64), length // 4)
    match = match_segments(one, np.repeat(one, 2), 3)
    refined = refine_match(match, lambda k, column: np.abs(2.0 * k - column), 2)
    return alignment_picture(
        (name, name), (len(one), 2 * len(one)), (15, 0), 30.0, match=match,
        region=refined.region, path=refined.path, subtitle=f"{name}; " * 6, suffix=suffix,
    )  # fmt: skip


def features(suffix="png", name="walk", length=90):
    values = np.sin(np.arange(length) / 9)
    values[5:9] = np.nan
    curve = LeafCurve("height(rankle)", values, "hl", (0.5,), (0.2,))
    unknown = LeafCurve("fast(root)", np.full(length, np.nan), "hl/s", (0.5,), ())
    panels = [
        FeaturePanel(name, (curve,), values > 0.5),
        FeaturePanel("both", (curve, unknown), np.zeros(length, dtype=bool)),
    ]
    return feature_picture(panels, 30.0, title=name, start=2.0, suffix=suffix)


@pytest.mark.parametrize("draw", [alignment, features])
def test_equal_input_gives_equal_bytes(draw):
    for suffix in ("png", "svg"):
        assert draw(suffix) == draw(suffix)


@pytest.mark.parametrize("draw", [alignment, features])
def test_odd_names_are_inert(draw):
    tree = ElementTree.fromstring(draw("svg", ODD))
    assert not [element for element in tree.iter() if element.tag.endswith(("script", "text"))]
    assert Image.open(io.BytesIO(draw("png", ODD))).size[0] > 300


@pytest.mark.parametrize("draw", [alignment, features])
@pytest.mark.parametrize("length", [8, 5000])
def test_any_length_gives_a_picture_of_bounded_size(draw, length):
    width, height = Image.open(io.BytesIO(draw(length=length))).size
    assert 200 < width < 3000
    assert 200 < height < 2000
