"""What `info`, `skeleton`, `index`, `verify` and `compact` say to people."""

import csv
import io
import json
import shutil

import pytest


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_documents_are_listed_by_name_with_length_and_source(fixtures_store, mocapidx):
    listed = rows(mocapidx("info", fixtures_store, "--documents", "--format", "csv").stdout)
    names = [row["document"] for row in listed]
    assert names == sorted(names)
    walk = next(row for row in listed if row["document"] == "clips/walk/ann_walk_001_120.amc")
    assert walk["source_rate_hz"] == "120"
    assert walk["joint_map"] == "acclaim"
    assert walk["source"].endswith("clips/walk/ann_walk_001_120.amc")
    assert float(walk["seconds"]) == pytest.approx(int(walk["source_frames"]) / 120, abs=0.04)
    table = mocapidx("info", fixtures_store, "--documents").stdout.splitlines()
    assert len(table) == len(listed) + 1
    assert max(map(len, table)) <= 120


def test_listing_all_and_asking_for_one_is_wrong_usage(fixtures_store, mocapidx):
    done = mocapidx("info", fixtures_store, "clips/walk/ann_walk_001_120.amc", "--documents")
    assert done.returncode == 2
    assert "leave DOCUMENT out" in done.stderr


def test_a_part_of_a_name_is_answered_with_a_name_that_holds_it(fixtures_store, mocapidx):
    done = mocapidx("info", fixtures_store, "ann_walk_001")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "; is 'bvh/walk/ann_walk_001.bvh' meant?" in done.stderr
    assert "--documents" in done.stderr


def test_what_is_known_of_a_document_is_text_for_people(fixtures_store, mocapidx):
    name = "clips/walk/ann_walk_001_120.amc"
    facts = json.loads(mocapidx("info", fixtures_store, name, "--format", "jsonl").stdout)
    assert facts["coincident"] == "neck = lclavicle, neck = rclavicle, lclavicle = rclavicle"
    assert facts["made"] == facts["missing"] == "none"
    assert facts["skeleton"].endswith("clips/ann.asf")
    assert not any("[" in str(value) for value in facts.values())


def test_a_saved_skeleton_table_has_the_guesses_too(fixtures_dir, mocapidx, tmp_path):
    clip = fixtures_dir / "clips/walk/ann_walk_001_120.amc"
    output = tmp_path / "skeleton.txt"
    assert mocapidx("skeleton", clip, "--output", output).stdout == ""
    assert output.read_text() == mocapidx("skeleton", clip).stdout
    assert output.read_text().startswith("files: ")


def test_a_folder_without_motion_is_said_to_be_one(mocapidx, tmp_path):
    (tmp_path / "empty").mkdir()
    done = mocapidx("index", "empty", "--store", "s.store", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr.splitlines()[0] == (
        "Warning: no motion file below empty: is it the right folder?"
    )


def test_a_second_run_says_that_there_was_nothing_to_read(fixtures_dir, mocapidx, tmp_path):
    folder = tmp_path / "takes"
    folder.mkdir()
    for clip in sorted((fixtures_dir / "bvh/walk").glob("*.bvh"))[:2]:
        shutil.copy2(clip, folder)
    first, second = (mocapidx("index", folder, "--store", tmp_path / "s.store") for _ in range(2))
    assert "2 added" in first.stderr
    assert "minutes of motion read in" in first.stderr
    assert "2 unchanged, 0 removed; nothing to read" in second.stderr


def test_an_assumed_rate_names_the_only_file(fixtures_dir, mocapidx, tmp_path):
    shutil.copy2(fixtures_dir / "clips/ann.asf", tmp_path)
    shutil.copy2(fixtures_dir / "clips/walk/ann_walk_001_120.amc", tmp_path / "ann_walk.amc")
    done = mocapidx("index", tmp_path, "--store", tmp_path / "s.store")
    warning = done.stderr.splitlines()[0]
    assert warning.startswith("Warning: nothing says the rate of 1 AMC file, taken as 120 Hz")
    assert warning.endswith("otherwise): ann_walk.amc")
