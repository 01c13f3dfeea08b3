"""Learning and matching on real clips, where they are."""

import numpy as np
import pytest

from mocapidx.features.extract import extract_features
from mocapidx.features.words import pack_words
from mocapidx.tasks.read import read_motion
from mocapidx.templates.learn import learn_template
from mocapidx.templates.match import find_hits, lowest_costs, match_documents
from mocapidx.templates.quantise import quantise
from tests import naive_alignment as naive

CLASSES = ("squat1Reps", "kickLFront1Reps")


@pytest.fixture(scope="module")
def clips(real_data):
    """Feature matrices of three clips of each actor and class."""
    found = {}
    for name in CLASSES:
        for actor in ("bd", "bk", "dg"):
            paths = sorted((real_data / "hdm05" / name).glob(f"HDM_{actor}_*.amc"))[:3]
            found[name, actor] = [extract_features(read_motion(path)) for path in paths]
    return found


@pytest.fixture(scope="module")
def templates(clips):
    """Learned from the first two actors."""
    return {
        name: quantise(learn_template(clips[name, "bd"] + clips[name, "bk"]).matrix, 0.1)
        for name in CLASSES
    }


def test_an_unseen_actor_is_told_apart(clips, templates):
    for name in CLASSES:
        words = [pack_words(features) for features in clips[name, "dg"]]
        bounds = np.cumsum([0, *map(len, words)])
        costs = {
            other: lowest_costs(match_documents(templates[other], np.concatenate(words), bounds))
            for other in CLASSES
        }
        assert (costs[name] < 0.08).all()  # three clips of two actors are few
        assert all((costs[name] < costs[other]).all() for other in CLASSES if other != name)


@pytest.mark.parametrize(("steps", "charge"), [("weighted", 2), ("printed", 1)])
def test_costs_and_starts_on_real_words_match_the_plain_version(clips, templates, steps, charge):
    template = templates["squat1Reps"]
    words = pack_words(np.vstack((clips["kickLFront1Reps", "dg"][0], clips["squat1Reps", "dg"][0])))
    matching = match_documents(template, words, np.array([0, len(words)]), steps, padded=False)
    table = [
        [((word ^ one) & care).bit_count() / max(care.bit_count(), 1) for word in words.tolist()]
        for one, care in zip(template.ones.tolist(), template.care.tolist(), strict=True)
    ]
    expected, _ = naive.subsequence(table, charge)
    np.testing.assert_allclose(matching.costs, expected, rtol=1e-5, atol=1e-6)
    hits = find_hits(matching, 0.3)
    assert len(hits.costs)
    for start, end, cost in zip(hits.starts, hits.ends, hits.costs, strict=True):
        assert naive.path_cost(table, start, end - 1, charge) == pytest.approx(cost, abs=1e-6)
