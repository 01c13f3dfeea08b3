"""Rankings of real clips, against plain versions of what each of them measures."""

import math

import numpy as np
import pytest

from mocapidx.features.featureset import load_feature_set
from mocapidx.store.read import open_store
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.query import query_store
from tests import naive_queries as naive
from tests.naive_alignment import subsequence
from tests.naive_warping import warp

SELECT = "F20"
MASK = load_feature_set("f39").select(SELECT)


@pytest.fixture(scope="module", params=[True, False], ids=["poses", "words"])
def store(request, real_data, tmp_path_factory):
    """A store of squats, their words and their poses by document."""
    clips = sorted((real_data / "hdm05" / "squat1Reps").glob("*.amc"))[:8]
    path = tmp_path_factory.mktemp("stores") / "squats.store"
    index_files(clips, path, IndexOptions(poses=request.param))
    words, poses = {}, {}
    with open_store(path) as snapshot:
        for entry in snapshot.documents():
            rows = (entry.frame_offset, entry.frame_offset + entry.document.frames)
            name = entry.document.name
            words[name] = snapshot.array(entry.file, "frames/words", *rows).tolist()
            if request.param:
                poses[name] = snapshot.array(entry.file, "frames/poses", *rows).astype(float)
    return path, words, poses


def answers(store, rank):
    """The hits of the first squat, with the borders of their steps and of its own."""
    path, words, _ = store
    names = sorted(words)
    own = naive.segments(words[names[0]], MASK)
    expected = naive.exact_hits([w for w, _, _ in own], MASK, [words[name] for name in names])
    bounds = {(names[d], steps[0], steps[-1]): steps for d, *steps in expected}
    found = query_store(path, names[0], select=SELECT, mode="exact", rank=rank)
    assert {(hit.document, hit.start_frame, hit.end_frame) for hit in found.hits} == set(bounds)
    assert len(found.hits) > 4
    lengths = [end - start for _, start, end in own]
    for hit in found.hits:
        yield names[0], hit, bounds[hit.document, hit.start_frame, hit.end_frame], lengths


def core(bounds, lengths):
    """The frames of a hit without what its outer steps last longer than in the example."""
    start = max(bounds[0], bounds[1] - lengths[0])
    return start, min(bounds[-1], bounds[-2] + lengths[-1])


def distance(one, other):
    """Root mean square of the joints after the best shift and turn, which has a closed form."""
    one, other = one - one.mean(axis=0) * [1, 0, 1], other - other.mean(axis=0) * [1, 0, 1]
    a, b = one[:, 0] + 1j * one[:, 2], other[:, 0] + 1j * other[:, 2]
    turn = np.exp(1j * np.angle(np.vdot(b, a)))
    flat, upright = np.abs(a - turn * b) ** 2, (one[:, 1] - other[:, 1]) ** 2
    return math.sqrt((flat + upright).mean())


def test_lengths(store):
    for _, hit, bounds, lengths in answers(store, "length"):
        logs = [
            math.log((end - start + 1) / (own + 1)) ** 2
            for start, end, own in zip(bounds, bounds[1:], lengths, strict=False)
        ]
        assert hit.cost == pytest.approx(math.sqrt(sum(logs) / len(logs)))


def test_warping(store):
    _, words, poses = store
    for example, hit, bounds, lengths in answers(store, "dtw"):
        start, end = core(bounds, lengths)
        if poses:
            own, frames = poses[example], poses[hit.document][start:end]
            table = [[distance(a, b) for b in frames] for a in own]
        else:
            own, frames = words[example], words[hit.document][start:end]
            table = [[(a ^ b).bit_count() / 39 for b in frames] for a in own]
        total, path = warp(table, lambda row, column: True)
        assert hit.cost == pytest.approx(total / len(path), abs=1e-5)


def test_templates(store):
    _, words, _ = store
    for example, hit, bounds, lengths in answers(store, "template"):
        start, end = core(bounds, lengths)
        own, frames = words[example], words[hit.document][start:end]
        assert len(frames) > len(own) / 2
        padding = math.ceil(0.05 * len(own))
        frames = [frames[0]] * padding + frames + [frames[-1]] * padding
        table = [[(a ^ b).bit_count() / 39 for b in frames] for a in own]
        ends = subsequence(table, 2)[0]
        assert hit.cost == pytest.approx(min(ends[padding:]), abs=1e-6)
