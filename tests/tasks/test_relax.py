"""`--select relax`: every hit agrees in what its record says, and the fewer features the later."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from mocapidx.errors import ParameterError
from mocapidx.features.featureset import load_feature_set
from mocapidx.store.read import open_store
from mocapidx.tasks.answers import open_archive
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.query import query_store
from mocapidx.tasks.query_example import load_example
from mocapidx.tasks.read import ReadOptions
from tests.made_words import make_word_store, rest

F39 = load_feature_set("f39")


@pytest.fixture(scope="module")
def clips(fixtures_dir):
    return fixtures_dir / "clips"


@pytest.fixture(scope="module")
def store(clips, tmp_path_factory):
    """The clips of one person."""
    place, path = (tmp_path_factory.mktemp("relax") / name for name in ("clips", "s.store"))
    for clip in sorted(clips.rglob("ann_*.amc")):
        target = place / clip.parent.name / clip.name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(clip, target)
    shutil.copyfile(clips / "ann.asf", place / "ann.asf")
    index_files([place], path)
    return path


def example(clips, label):
    return sorted((clips / label).glob("dov_*.amc"))[0]


def steps(words, mask):
    """The sequence of different feature words, looking at some features."""
    selected = (words & np.uint64(mask)).tolist()
    return [word for n, word in enumerate(selected) if n == 0 or word != selected[n - 1]]


@pytest.mark.parametrize("label", ["squat", "kickFrontLeft", "clapAboveHead"])
def test_hits_agree_in_what_their_record_says(store, clips, label):
    found = query_store(store, example(clips, label), select="relax")
    assert found.hits
    with open_archive(store) as archive:
        own = load_example(archive, example(clips, label), ReadOptions()).words
        words = {}
        for placed in archive.snapshot.documents():
            rows = (placed.frame_offset, placed.frame_offset + placed.document.frames)
            words[placed.document.name] = archive.snapshot.array(
                placed.file, "frames/words", *rows
            ).astype(np.uint64)
    for hit, extra in zip(found.hits, found.extras, strict=True):
        mask = F39.select(extra["selection"].replace(" ", ""))
        there = words[hit.document][hit.start_frame : hit.end_frame]
        assert steps(there, mask) == steps(own, mask)
        # The whole part of the cost counts what was left out.
        assert int(hit.cost) == 39 - mask.bit_count()
    costs = [hit.cost for hit in found.hits]
    assert costs == sorted(costs)


@pytest.mark.parametrize("label", ["squat", "lieDownFloor"])
def test_it_finds_what_all_features_together_do_not(store, clips, label):
    relaxed = query_store(store, example(clips, label), select="relax")
    strict = query_store(store, example(clips, label))
    assert Path(relaxed.hits[0].document).parent.name == label
    assert len(strict.hits) < len(relaxed.hits)


def test_it_goes_on_until_there_are_as_many_hits_as_wanted(store, clips):
    few = query_store(store, example(clips, "squat"), select="relax", top=2)
    many = query_store(store, example(clips, "squat"), select="relax", top=12)
    assert len(few.hits) == 2
    assert len(many.hits) > 2
    assert max(hit.cost for hit in few.hits) <= max(hit.cost for hit in many.hits)
    asked = [int(found.remarks[-1].split()[0]) for found in (few, many)]
    assert asked[0] < asked[1]


def test_hits_do_not_overlap(store, clips):
    found = query_store(store, example(clips, "squat"), select="relax")
    for one in found.hits:
        for other in found.hits:
            if one is not other and one.document == other.document:
                assert one.end_frame <= other.start_frame or other.end_frame <= one.start_frame


def test_what_it_cannot_do_is_refused(store, clips, tmp_path):
    clip = example(clips, "squat")
    for options in ({"mirror": True}, {"mode": "mismatch", "mismatches": 1}):
        with pytest.raises(ParameterError, match="--select relax takes one example"):
            query_store(store, clip, select="relax", **options)
    with pytest.raises(ParameterError, match="--select relax takes one example"):
        query_store(store, [clip, clip], select="relax")
    bare = make_word_store(tmp_path / "bare.store", {"a.amc": rest(9)})
    with pytest.raises(ParameterError, match="keeps no poses"):
        query_store(bare, "a.amc", select="relax")


def test_a_store_without_poses_can_be_asked_with_a_file(clips, tmp_path):
    index_files([clips / "squat", clips / "jog"], tmp_path / "s.store", IndexOptions(poses=False))
    found = query_store(tmp_path / "s.store", example(clips, "squat"), select="relax", top=3)
    assert {Path(hit.document).stem.split("_")[1] for hit in found.hits} == {"squat"}
    with open_store(tmp_path / "s.store") as snapshot:
        assert not snapshot.manifest.settings.poses
