import csv
import itertools
import json

import numpy as np
import pytest
from PIL import Image

from mocapidx.alignment.banded import align_inside
from mocapidx.alignment.coarse import full_region
from mocapidx.alignment.distances import pose_distance
from mocapidx.errors import FormatError, ParameterError
from mocapidx.skeleton.resample import resample_motion
from mocapidx.tasks.align import AlignOptions, align_motions, path_records, segment_records
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.read import read_motion
from tests.made_words import make_word_store


@pytest.fixture(scope="module")
def pair(fixtures_dir):
    """Two squats of different people."""
    folder = fixtures_dir / "clips" / "squat"
    return folder / "ann_squat_001_120.amc", folder / "dov_squat_002_120.amc"


def poses(path):
    return resample_motion(read_motion(path), 30.0).positions.astype(float)


def test_the_path_leads_from_the_first_frames_to_the_last(pair):
    aligned = align_motions(*pair)
    records = list(path_records(aligned))
    assert (records[0]["a_frame"], records[0]["b_frame"]) == (0, 0)
    assert (records[-1]["a_frame"], records[-1]["b_frame"]) == tuple(n - 1 for n in aligned.frames)
    steps = {
        (after["a_frame"] - before["a_frame"], after["b_frame"] - before["b_frame"])
        for before, after in itertools.pairwise(records)
    }
    assert steps <= {(1, 1), (1, 0), (0, 1)}
    assert records[7]["a_time"] == pytest.approx(records[7]["a_frame"] / 30, abs=1e-6)
    assert records[-1]["total"] == pytest.approx(aligned.path.cost, abs=1e-5)


def test_the_cost_is_that_of_all_pairs_of_frames_at_a_fraction_of_them(pair):
    aligned = align_motions(*pair)
    one, other = map(poses, pair)
    full = align_inside(full_region(len(one), len(other)), pose_distance(one, other))
    assert aligned.path.cost == pytest.approx(full.cost, rel=0.01)
    assert aligned.region.share < 0.8
    assert not aligned.remarks


def test_knees_of_squatting_people_bend_together(pair):
    aligned = align_motions(*pair, AlignOptions(select="F20,F21", coarse_only=True))
    records = list(segment_records(aligned))
    assert aligned.path is None
    assert [bool(record["features"]) for record in records] == [False, True, False]
    assert records[0]["a_start_frame"] == records[0]["b_start_frame"] == 0
    assert (records[-1]["a_end_frame"], records[-1]["b_end_frame"]) == aligned.frames
    for before, after in itertools.pairwise(records):
        assert before["a_end_frame"] == after["a_start_frame"]
        assert before["b_end_time"] == after["b_start_time"]


def test_a_stretch_keeps_the_frame_numbers_of_its_file(pair):
    aligned = align_motions(f"{pair[0]}@0.5:1.5", pair[1])
    records = list(path_records(aligned))
    assert records[0]["a_frame"] == 15
    assert records[-1]["a_frame"] == 44


def test_without_common_segments_all_pairs_are_looked_at_and_it_says_so(pair):
    aligned = align_motions(*pair, AlignOptions(select="F22"))
    assert aligned.match is None
    assert aligned.region.share == 1
    assert any("no coarse alignment" in remark for remark in aligned.remarks)
    coarse = align_motions(*pair, AlignOptions(select="F22", coarse_only=True))
    assert list(segment_records(coarse)) == list(path_records(coarse)) == []
    assert any("no coarse alignment" in remark for remark in coarse.remarks)


def test_documents_of_a_store_are_aligned_without_their_files(pair, tmp_path):
    index_files([pair[0].parent], tmp_path / "s.store")
    names = [path.name for path in pair]
    stored = align_motions(*names, store=tmp_path / "s.store")
    read = align_motions(*pair)
    assert stored.path.rows.tolist() == read.path.rows.tolist()
    assert stored.path.cost == pytest.approx(read.path.cost, rel=1e-5)
    mixed = align_motions(pair[0], names[1], store=tmp_path / "s.store")
    assert mixed.path.columns.tolist() == read.path.columns.tolist()
    with pytest.raises(FormatError, match=r"no such file, and no document of .*s\.store"):
        align_motions("none.amc", names[0], store=tmp_path / "s.store")


def test_a_store_without_poses_gives_an_alignment_of_words(pair, tmp_path):
    index_files([pair[0].parent], tmp_path / "s.store", IndexOptions(poses=False))
    aligned = align_motions(*(path.name for path in pair), store=tmp_path / "s.store")
    assert aligned.unit == "features"
    assert any("keeps no poses" in remark for remark in aligned.remarks)
    assert float(aligned.path.cost).is_integer()


def test_features_that_a_skeleton_can_not_tell_are_passed_over(tmp_path):
    bits = np.zeros((20, 39), dtype=bool)
    bits[8:, [3, 5]] = True
    store = make_word_store(
        tmp_path / "s.store", {"a": bits, "b": np.repeat(bits, 2, axis=0)}, untrusted={"b": 1 << 3}
    )
    aligned = align_motions("a", "b", AlignOptions(distance="words"), store=store)
    assert aligned.features == ("F6",)
    assert any("F4" in remark for remark in aligned.remarks)
    assert aligned.match.other_bounds.tolist() == [0, 16, 40]


@pytest.mark.parametrize(
    ("change", "named"),
    [({"margin": -1.0}, "margin"), ({"select": "F99"}, "F99")],
)
def test_wrong_options_are_named(pair, change, named):
    with pytest.raises(ParameterError, match=named):
        align_motions(*pair, AlignOptions(**change))
    with pytest.raises(ParameterError, match=r"lasts .* s, the part starts at 90"):
        align_motions(f"{pair[0]}@90:", pair[1])


def test_the_command_prints_records_draws_and_says_how_it_went(mocapidx, pair, tmp_path):
    picture, path = tmp_path / "a.png", tmp_path / "path.csv"
    done = mocapidx("align", *pair, "--plot", picture, "--output", path, "--format", "csv")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "pairs of frames looked at" in done.stderr
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert list(rows[0]) == ["a_frame", "b_frame", "a_time", "b_time", "cost", "total"]
    with Image.open(picture) as image:
        assert min(image.size) > 200

    coarse = mocapidx("align", *pair, "--coarse-only", "--format", "jsonl", "--quiet")
    assert coarse.stderr == ""
    assert all("features" in json.loads(line) for line in coarse.stdout.splitlines())

    none = mocapidx("align", *pair, "--select", "F22", "--plot", tmp_path / "none.svg")
    assert none.returncode == 0
    assert "Warning: no coarse alignment" in none.stderr
    assert (tmp_path / "none.svg").read_text().startswith("<?xml")


def test_another_kind_of_picture_is_refused_before_any_work(mocapidx, pair, tmp_path):
    done = mocapidx("align", *pair, "--plot", tmp_path / "a.gif")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert ".png or .svg" in done.stderr


def test_pairs_of_one_class_cost_the_same_within_a_per_cent(real_data):
    checked = 0
    for folder in sorted((real_data / "hdm05").iterdir()):
        clips = sorted(folder.glob("*.amc")) if folder.is_dir() else []
        for one, other in zip(clips[::6], clips[5::6], strict=False):
            aligned = align_motions(one, other)
            a, b = poses(one), poses(other)
            full = align_inside(full_region(len(a), len(b)), pose_distance(a, b))
            assert aligned.path.cost <= 1.01 * full.cost, (one.name, other.name)
            checked += 1
    assert checked > 10
