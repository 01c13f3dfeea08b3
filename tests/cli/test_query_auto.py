"""`query --select auto` and `--select relax` on the command line."""

import json
import shutil
import stat

import pytest


@pytest.fixture(scope="module")
def store(fixtures_store, tmp_path_factory):
    return shutil.copytree(fixtures_store, tmp_path_factory.mktemp("auto") / "s.store")


@pytest.fixture(scope="module")
def clip(fixtures_dir):
    return sorted((fixtures_dir / "clips" / "squat").glob("dov_*.amc"))[0]


def test_records_have_two_keys_more(mocapidx, store, clip):
    done = mocapidx("query", store, "--example", clip, "--select", "auto", "--format", "jsonl")
    assert done.returncode == 0
    records = [json.loads(line) for line in done.stdout.splitlines()]
    assert list(records[0])[-4:] == ["cost", "label", "sure", "accepted"]
    sure = {record["document"] for record in records if record["sure"]}
    assert f"clips/squat/{clip.name}" in sure
    assert [record["rank"] for record in records] == list(range(1, len(records) + 1))
    assert "are sure, up to a cost of" in done.stderr
    again = mocapidx("query", store, "--example", clip, "--select", "auto", "--format", "jsonl")
    assert (again.stdout, again.stderr) == (done.stdout, done.stderr)


def test_a_table_says_what_is_sure_and_explains_the_weight(mocapidx, store, clip):
    done = mocapidx(
        "query", store, "--example", clip, "--select", "auto", "--top", "3", "--explain"
    )
    assert done.stdout.splitlines()[0].endswith("sure")
    assert len(done.stdout.splitlines()) == 4
    assert "of the weight: F" in done.stderr


def test_a_store_that_may_not_be_written_is_read(mocapidx, fixtures_store, clip, tmp_path):
    store = shutil.copytree(fixtures_store, tmp_path / "s.store")
    (store / "SIGMA").unlink(missing_ok=True)
    mode = store.stat().st_mode
    store.chmod(mode & ~(stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH))
    try:
        done = mocapidx("query", store, "--example", clip, "--select", "auto", "--top", "1")
    finally:
        store.chmod(mode)
    assert done.returncode == 0, done.stderr


def test_what_does_not_go_together_is_wrong_usage(mocapidx, store, clip, tmp_path):
    query = ("query", store, "--example", clip)
    for options in (
        ("--learn", tmp_path / "t.h5"),
        ("--no-feedback",),
        ("--select", "auto", "--mirror"),
        ("--select", "relax", "--mirror"),
    ):
        done = mocapidx(*query, *options)
        assert done.returncode == 2, options
        assert len(done.stderr.strip().splitlines()) == 1


def test_learning_prints_what_was_learned_from(mocapidx, store, clip, tmp_path):
    options = ("--select", "auto", "--top", "1", "--learn", tmp_path / "t.h5")
    done = mocapidx("query", store, "--example", clip, *options)
    assert f"the template is learned from {clip}, " in done.stderr
    found = mocapidx("retrieve", store, "--templates", tmp_path / "t.h5", "--class", clip.stem)
    assert "squat" in found.stdout


def test_relaxing_says_in_which_features_a_hit_agrees(mocapidx, store, clip):
    options = ("--select", "relax", "--top", "3", "--format", "jsonl")
    done = mocapidx("query", store, "--example", clip, *options)
    records = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(records) == 3
    assert all(record["selection"].startswith("F") for record in records)
    assert "selections were asked for" in done.stderr
