"""The kernels and NumPy on words of motion, as they come, not made up."""

import numpy as np
import pytest

from mocapidx import extract_features, read_motion
from mocapidx.alignment import dtw, loops, subsequence, weighted
from mocapidx.features.words import pack_words
from mocapidx.kernels.choice import compiled
from mocapidx.templates.path import find_path, loop_bank

MODULES = {"matching": subsequence, "path": loops, "dtw": dtw, "weighted": weighted}


def features_of(paths):
    return [extract_features(read_motion(path)) for path in paths]


@pytest.fixture(scope="module")
def motions(request):
    """Features of some clips: the project's own, or real ones where there are any."""
    if request.param == "fixtures":
        folder = request.getfixturevalue("fixtures_dir")
        return features_of(sorted(folder.rglob("*.bvh"))[:4] + sorted(folder.rglob("*.amc"))[:8])
    folder = request.getfixturevalue("real_data") / "hdm05"
    return features_of(sorted(folder.rglob("*.amc"))[::16])


both_kinds = pytest.mark.parametrize("motions", ["fixtures", "real"], indirect=True)


@pytest.fixture
def both_ways(monkeypatch):
    """Do something with the kernel and with NumPy, and give both results."""

    def run(name, function):
        if compiled(name) is None:
            pytest.skip("without the kernel there is one way only")
        ours = function()
        with monkeypatch.context() as patch:
            patch.setattr(MODULES[name], "compiled", lambda name: None)
            return ours, function()

    return run


@both_kinds
@pytest.mark.parametrize("steps", ["weighted", "printed"])
def test_matching_has_the_same_bits(motions, both_ways, steps):
    documents = [pack_words(features) for features in motions]
    words = np.concatenate([part for own in documents for part in (own, own[-2:])])
    ends = np.cumsum([len(own) + 2 for own in documents])
    breaks = np.column_stack((ends - 2, ends - 1)).ravel()
    rng = np.random.default_rng(1)
    templates = []
    for own in documents:
        care = rng.integers(0, 1 << 39, len(own), dtype=np.uint64)
        templates.append((own & care, care))
    ours, theirs = both_ways(
        "matching",
        lambda: subsequence.many_subsequence_costs(
            templates, words, [breaks] * len(templates), steps
        ),
    )
    np.testing.assert_array_equal(ours.view(np.uint32), theirs.view(np.uint32))
    assert np.isfinite(theirs).any(axis=1).all()


@both_kinds
def test_paths_are_the_same(motions, both_ways):
    half = len(motions) // 2
    bank = loop_bank([own.astype(float) for own in motions[:half]], list(map(str, range(half))))
    words = np.concatenate([pack_words(own) for own in motions])
    ours, theirs = both_ways("path", lambda: find_path(words, bank))
    for name in ("columns", "jumps", "costs"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert len(np.unique(theirs.columns)) > 10


@both_kinds
def test_alignments_are_the_same(motions, both_ways):
    matrices = [own.astype(float) for own in motions]
    ours, theirs = both_ways("dtw", lambda: list(dtw.align(matrices[0], matrices)))
    for (cost, *path), (other_cost, *other_path) in zip(ours, theirs, strict=True):
        assert cost == other_cost
        np.testing.assert_array_equal(path, other_path)


@both_kinds
def test_weighted_patterns_match_alike(motions, both_ways):
    ones = motions[0]
    weights = np.rint(np.random.default_rng(2).random(ones.shape) * weighted.LARGEST_WEIGHT)
    words = np.concatenate([pack_words(own) for own in motions])
    ours, theirs = both_ways("weighted", lambda: weighted.match_rows(ones, weights, words))
    np.testing.assert_array_equal(ours, theirs)
