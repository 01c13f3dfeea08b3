"""Edited templates on real motion: what a session's accidents cost, and what editing mends."""

import numpy as np
import pytest

from mocapidx.features.extract import extract_features
from mocapidx.features.featureset import load_feature_set
from mocapidx.features.words import pack_words
from mocapidx.tasks.read import read_motion
from mocapidx.templates.edit import mask_template, mirror_template
from mocapidx.templates.learn import learn_template
from mocapidx.templates.match import find_hits, match_documents
from mocapidx.templates.quantise import quantise
from mocapidx.templates.template import TAU, MotionTemplate

F39 = load_feature_set("f39")
ARMS = "upper,F27,F28,F33,F34"  # the 18 rows of the arms
SQUAT = "3"  # in the label files of the exercise takes


def features_of(path):
    return extract_features(read_motion(path), F39, 30.0)


@pytest.fixture(scope="module")
def squat(real_data):
    clips = sorted(real_data.glob("hdm05/squat1Reps/*.amc"))
    if not clips:
        pytest.skip("no HDM05 squats here")
    learned = learn_template([features_of(clip) for clip in clips])
    return MotionTemplate("squat", learned.matrix, F39.digest, 30.0)


@pytest.fixture(scope="module")
def takes(real_data):
    """Words of the exercise takes, and where in them people saw squats, in seconds."""
    found = {}
    for path in sorted(real_data.glob("exercises/*.amc")):
        labels = path.with_suffix(".labels.txt").read_text().split()
        squats = np.flatnonzero(np.array(labels) == SQUAT) / 10
        found[path.stem] = (pack_words(features_of(path)), squats.min(), squats.max() + 0.1)
    if not found:
        pytest.skip("no exercise takes here")
    return found


def hits_in(template, words, steps, tau=TAU):
    quantised = quantise(template.matrix, template.delta)
    return find_hits(match_documents(quantised, words, np.array([0, len(words)]), steps), tau)


@pytest.mark.parametrize("steps", ["weighted", "printed"])
def test_squats_with_stretched_arms_find_no_others(squat, takes, steps):
    assert sum(len(hits_in(squat, words, steps).costs) for words, _, _ in takes.values()) == 0


@pytest.mark.parametrize(("steps", "least"), [("weighted", 2), ("printed", 6)])
def test_with_the_arms_masked_squats_are_found_and_nothing_else(squat, takes, steps, least):
    legs = mask_template(squat, F39.select(ARMS))
    found = 0
    for words, start, end in takes.values():
        hits = hits_in(legs, words, steps)
        middles = (hits.starts + hits.ends) / 60
        assert ((start < middles) & (middles < end)).all()
        found += len(middles)
    assert found >= least


def test_a_mirrored_kick_finds_mirrored_kicks_as_well(real_data):
    clips = sorted(real_data.glob("hdm05/kickLFront1Reps/*_bd_*.amc"))[:4]
    if not clips:
        pytest.skip("no HDM05 kicks here")
    left = [features_of(clip) for clip in clips]
    kick = MotionTemplate("left", learn_template(left[1:]).matrix, F39.digest, 30.0)
    right = mirror_template(kick, F39.mirror, "right")
    words, mirrored = pack_words(left[0]), pack_words(left[0][:, F39.mirror])
    lowest = [
        hits_in(template, each, "weighted", np.inf).costs[0]
        for template, each in ((kick, words), (right, mirrored), (right, words))
    ]
    assert lowest[0] == lowest[1] < TAU < lowest[2]
