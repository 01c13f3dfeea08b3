"""What notebooks show: inert text, whole pictures, nothing that fails on odd data."""

import base64
import io
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from PIL import Image

import mocapidx
from mocapidx.markup import facts_html, grey_picture_html, point_figures_html, table_html
from mocapidx.model import Hit, HitList, Motion
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.templates.template import MotionTemplate

ODD = '<script>alert("1")</script> & \x1b[2J \udc80'


def elements(html):
    closed = re.sub(r"(<img[^>]*)>", r"\1/>", html)
    tree = ElementTree.fromstring(f"<div>{closed}</div>")
    return [element.tag for element in tree.iter()], "".join(tree.itertext())


def test_names_are_text():
    for html in (table_html([ODD], [[ODD]], ODD), facts_html(ODD, {ODD: ODD})):
        tags, text = elements(html)
        assert set(tags) <= {"div", "p", "b", "table", "thead", "tbody", "tr", "th", "td"}
        assert text.count('<script>alert("1")</script> & \\x1b[2J \\x80') == 3


def test_a_matrix_is_a_picture_in_the_text():
    matrix = np.array([[0.0, 0.5, 1.0], [1.0, 0.0, 0.0]])
    html = grey_picture_html(matrix, 30, 20, ODD)
    source = re.search(r"base64,([^\"]*)", html)[1]
    picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(source))))
    assert picture.tolist() == [[0, 128, 255], [255, 0, 0]]
    assert elements(html)[0] == ["div", "img"]


def test_a_pose_is_drawn_as_its_known_points():
    poses = np.random.default_rng(1).normal(size=(2, 3, 3))
    poses[0, 1] = np.nan
    html = point_figures_html(poses, ["root", "lknee", "rknee"], ODD)
    assert html.count("<circle") == 5
    assert "nan" not in html.split("aria-label")[0]


@pytest.mark.parametrize("frames", [0, 1, 100])
def test_a_motion_shows_itself(frames):
    positions = np.random.default_rng(2).normal(size=(frames, 24, 3))
    positions[:, 3] = np.nan
    html = Motion(CANONICAL_JOINTS, positions, 30.0, made=("headtop",))._repr_html_()
    assert f"{frames} frames at 30 Hz" in html
    assert "headtop" in html
    assert ("<circle" in html) == (frames > 0)
    unknown = Motion(CANONICAL_JOINTS, np.full_like(positions, np.nan), 30.0)
    assert "Motion" in unknown._repr_html_()


def test_a_template_and_hits_show_themselves():
    template = MotionTemplate(ODD, np.eye(5, 39), "0" * 64, 30.0)
    assert "script" not in elements(template._repr_html_())[0]
    hits = HitList(Hit(ODD, 0, 30, 0.0, 1.0, 0, 120, 0.25, "kick") for _ in range(23))
    tags, text = elements(hits._repr_html_())
    assert tags.count("tr") == 21
    assert "and 3 more" in text
    assert "no hits" in HitList()._repr_html_()
    assert len(hits) == 23


def test_a_store_and_an_answer_show_themselves(fixtures_store, fixtures_dir):
    with mocapidx.open_store(fixtures_store) as store:
        html = store._repr_html_()
    assert "documents" in html
    assert "and " in html
    clip = fixtures_dir / "clips/walk/ann_walk_001_120.amc"
    found = mocapidx.query_store(fixtures_store, str(clip), select="F15,F16")
    assert isinstance(found.hits, HitList)
    assert "ann_walk_001_120.amc" in found._repr_html_()
