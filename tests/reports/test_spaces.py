import io

import numpy as np
import pytest
from PIL import Image

from mocapidx.reports.spaces import poses_picture, region_picture

RANDOM = np.random.default_rng(0)


@pytest.mark.parametrize("dimensions", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("with_targets", [False, True])
def test_regions_of_any_dimension_are_drawn(dimensions, with_targets):
    examples, samples = RANDOM.random((5, dimensions)), RANDOM.random((40, dimensions))
    targets = {"targets": examples[:2] + 1, "reached": examples[:2]} if with_targets else {}
    drawn = region_picture(
        [f"value {n}" for n in range(dimensions)], ["m"] * dimensions, examples, samples, **targets
    )
    with Image.open(io.BytesIO(drawn)) as picture:
        assert min(picture.size) > 300


def test_a_body_stands_beside_places():
    pose = RANDOM.random((24, 3))
    pose[4] = np.nan
    points = RANDOM.random((9, 3))
    options = {"pose": pose, "title": "<b>\x1b", "suffix": "svg"}
    drawn = region_picture(["x", "y", "z"], ["m"] * 3, points[:3], points, **options)
    assert drawn.startswith(b"<?xml")
    assert b"<b>" not in drawn
    assert drawn == region_picture(["x", "y", "z"], ["m"] * 3, points[:3], points, **options)


@pytest.mark.parametrize("frames", [1, 2, 200])
def test_motions_of_any_length_are_drawn(frames):
    drawn = poses_picture(RANDOM.random((frames, 24, 3)), 120.0)
    with Image.open(io.BytesIO(drawn)) as picture:
        assert min(picture.size) > 200
