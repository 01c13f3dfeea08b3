import io
import os
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from mocapidx.errors import ParameterError
from mocapidx.reports.matrices import template_picture
from mocapidx.reports.style import class_colours, drawing, new_figure, render
from mocapidx.reports.timelines import (
    Curve,
    Span,
    Track,
    annotation_picture,
    distance_picture,
)

ODD = 'a $x_{ <script>alert("1")</script> \x1b[2J \udc80 \u4e2d'


def template(suffix="png", title="squat", **changes):
    random = np.random.default_rng(0)
    matrix = random.choice([0.0, 0.5, 1.0], (30, 6))
    return template_picture(
        matrix,
        0.1,
        [f"F{n} {title}" for n in range(6)],
        ["upper"] * 3 + ["lower"] * 3,
        30.0,
        title=title,
        subtitle=title,
        keyframes=(3, 20),
        suffix=suffix,
        **changes,
    )


def distance(suffix="png", title="squat", frames=200):
    costs = np.abs(np.sin(np.arange(frames) / 20)).astype(np.float32) * 0.3
    costs[:20] = np.inf
    hits = (Span(1.0, 2.0, title), Span(frames / 30 - 1, frames / 30, title))
    curves = [Curve(title, costs, 0.06, hits), Curve("jump", costs[::-1], 0.06, ())]
    truth = [Span(0.5, 2.0, title), Span(3.0, 3.1, "jump")]
    return distance_picture(curves, 30.0, title=title, borders=[2.5], truth=truth, suffix=suffix)


def annotation(suffix="png", title="squat"):
    spans = (Span(0.0, 3.0, title), Span(3.0, 3.2, "jump"))
    tracks = [Track(title, spans, spans), Track("b", ()), Track("c", spans)]
    return annotation_picture(tracks, title=title, suffix=suffix)


PICTURES = (template, distance, annotation)


@pytest.mark.parametrize("draw", PICTURES)
def test_equal_input_gives_equal_png_whatever_the_names(draw):
    picture = draw("png", ODD)
    assert picture == draw("png", ODD)
    image = Image.open(io.BytesIO(picture))
    assert image.format == "PNG"
    assert all(250 < side < 3000 for side in image.size)


@pytest.mark.parametrize("draw", PICTURES)
def test_equal_input_gives_equal_svg_and_odd_names_are_never_markup(draw):
    picture = draw("svg", ODD)
    assert picture == draw("svg", ODD)
    assert picture.startswith(b"<?xml")
    assert b"<dc:date>" not in picture
    assert b"<script" not in picture
    assert b"\x1b[2J" not in picture


def test_entries_are_black_white_or_coloured():
    matrix = np.zeros((40, 3))
    matrix[:, 1], matrix[:, 2] = 1.0, 0.5
    picture = template_picture(matrix, 0.1, ["a", "b", "c"], ["upper"] * 3, 30.0, title="x")
    pixels = np.array(Image.open(io.BytesIO(picture)).convert("RGB")).reshape(-1, 3)
    colours, counts = np.unique(pixels, axis=0, return_counts=True)
    usual = {tuple(colour.tolist()) for colour in colours[np.argsort(counts)[-3:]]}
    assert {(0, 0, 0), (255, 255, 255)} < usual
    (coloured,) = usual - {(0, 0, 0), (255, 255, 255)}
    assert coloured[0] > coloured[1] > coloured[2]


def test_other_suffixes_are_refused():
    with drawing(), pytest.raises(ParameterError, match="'gif'"):
        render(new_figure(1.0, 1.0, "x"), "gif")
    with drawing():
        assert render(new_figure(1.0, 1.0, "x"), ".PNG").startswith(b"\x89PNG")


def test_an_hour_is_drawn_with_few_points_and_keeps_its_minima():
    costs = np.full(108_000, 0.3, dtype=np.float32)
    costs[70_001] = 0.01
    picture = distance_picture([Curve("x", costs, 0.06, ())], 30.0, title="x", suffix="svg")
    assert len(picture) < 400_000
    flat = distance_picture([Curve("x", costs.clip(0.3), 0.06, ())], 30.0, title="x", suffix="svg")
    assert picture != flat


def test_where_no_match_can_end_nothing_is_drawn_and_nothing_fails():
    costs = np.full(40, np.inf, dtype=np.float32)
    assert distance_picture([Curve("x", costs, 0.06, ())], 30.0, title="x")


def test_colours_belong_to_classes_not_to_their_order():
    assert class_colours(["b", "a", "b"]) == class_colours(["a", "b"])


def test_three_dozen_classes_have_colours_that_can_be_told_apart():
    colours = class_colours(f"{n:02d}" for n in range(36)).values()
    parts = np.array([[int(colour[at : at + 2], 16) for at in (1, 3, 5)] for colour in colours])
    apart = np.abs(parts[:, None] - parts).sum(axis=2)
    assert apart[~np.eye(36, dtype=bool)].min() >= 28


def test_settings_of_the_user_and_a_missing_home_change_nothing(tmp_path):
    settings = tmp_path / "matplotlibrc"
    settings.write_text("font.size: 30\nbackend: TkAgg\nsvg.fonttype: none\nsavefig.dpi: 20\n")
    code = (
        "import sys\nfrom mocapidx.reports.timelines import *\n"
        "data = annotation_picture([Track('a', (Span(0, 1, 'x'),))], title='t')\n"
        "sys.stdout.buffer.write(data)"
    )
    ours = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    odd = {"MATPLOTLIBRC": str(settings), "HOME": "/nonexistent", "XDG_CONFIG_HOME": "/dev/null"}
    pictures = []
    for environment in (ours, ours | odd):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, env=environment, timeout=120
        )
        assert done.stderr == b""
        pictures.append(done.stdout)
    assert pictures[0] == pictures[1]
    assert pictures[0].startswith(b"\x89PNG")


def test_importing_the_module_does_not_import_matplotlib():
    code = "import sys, mocapidx.tasks.plot\nsys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


NOWHERE_TO_WRITE = """
import tempfile
from mocapidx.errors import WriteError
from mocapidx.reports.style import drawing

def full(**_options):
    raise FileNotFoundError(2, "No usable temporary directory found")

tempfile.mkdtemp = full
try:
    with drawing():
        pass
except WriteError as exc:
    print(exc)
"""


def test_where_no_folder_may_be_written_matplotlib_says_what_it_needs():
    environment = os.environ | {"HOME": "/dev/null/home", "XDG_CONFIG_HOME": "/dev/null"}
    environment.pop("MPLCONFIGDIR", None)
    done = subprocess.run(
        [sys.executable, "-c", NOWHERE_TO_WRITE], capture_output=True, text=True, env=environment
    )
    assert done.stderr == ""
    assert done.stdout.startswith("matplotlib, which draws, needs a folder to write to")
    assert done.stdout.endswith("set MPLCONFIGDIR to a folder\n")
