"""What was measured on a store is kept beside it, and never trusted when damaged."""

import hashlib
import json
import math
import os

import pytest

from mocapidx.errors import WriteError
from mocapidx.store import sigma as module
from mocapidx.store.place import sweep
from mocapidx.store.read import open_store
from mocapidx.store.sigma import MeasuredSigma, drop_sigma, read_sigma, save_sigma, sigma_fault
from mocapidx.tasks.verify import verify_store
from tests.made_store import store_bytes
from tests.made_words import F39, make_word_store, rest

MEASURED = MeasuredSigma((0.5, math.nan, 1.25), "ab" * 32, 1000)


def test_what_is_saved_is_read(tmp_path):
    assert read_sigma(tmp_path) is None
    assert sigma_fault(tmp_path) is None
    assert save_sigma(tmp_path, MEASURED)
    read = read_sigma(tmp_path)
    assert (read.sigma[0], read.sigma[2], read.frames) == (0.5, 1.25, 1000)
    assert math.isnan(read.sigma[1])
    assert sigma_fault(tmp_path) is None
    drop_sigma(tmp_path)
    drop_sigma(tmp_path)
    assert read_sigma(tmp_path) is None


def test_it_holds_until_the_store_has_doubled_or_halved():
    assert MEASURED.holds_for("ab" * 32, 1000)
    assert MEASURED.holds_for("ab" * 32, 1999)
    assert not MEASURED.holds_for("ab" * 32, 2000)
    assert MEASURED.holds_for("ab" * 32, 501)
    assert not MEASURED.holds_for("ab" * 32, 500)
    assert not MEASURED.holds_for("cd" * 32, 1000)


def test_any_changed_byte_makes_it_none(tmp_path):
    save_sigma(tmp_path, MEASURED)
    place = tmp_path / "SIGMA"
    good = place.read_bytes()
    for number in range(len(good)):
        place.write_bytes(good[:number] + bytes([good[number] ^ 1]) + good[number + 1 :])
        assert read_sigma(tmp_path) is None
        assert sigma_fault(tmp_path) is not None


@pytest.mark.parametrize(
    "tree",
    [
        [],
        {},
        {"format": "mocapidx-sigma", "version": 2},
        {"frames": True},
        {"frames": 0},
        {"sigma": {}},
        {"sigma": [1]},
        {"sigma": [-0.5]},
        {"sigma": [1e999]},
        {"feature_set": 7},
    ],
)
def test_right_digests_over_wrong_things_are_none(tmp_path, tree):
    known = {"format": "mocapidx-sigma", "version": 1, "feature_set": "ab", "frames": 9}
    body = json.dumps({**known, "sigma": [0.5], **tree} if tree else tree).encode()
    digest = hashlib.blake2b(body, digest_size=32).hexdigest().encode()
    (tmp_path / "SIGMA").write_bytes(digest + b"\n" + body)
    assert read_sigma(tmp_path) is None
    assert "not what a mocapidx" in sigma_fault(tmp_path)


@pytest.mark.parametrize("make", ["folder", "pipe", "link", "large"])
def test_odd_files_are_no_measurement_and_no_danger(tmp_path, make):
    place, victim = tmp_path / "SIGMA", tmp_path / "victim"
    victim.write_text("precious")
    if make == "folder":
        place.mkdir()
    elif make == "pipe":
        os.mkfifo(place)
    elif make == "link":
        place.symlink_to(victim)
    else:
        place.write_bytes(b"x" * (1 << 17))
    assert read_sigma(tmp_path) is None
    assert sigma_fault(tmp_path) is not None
    assert save_sigma(tmp_path, MEASURED) == (make == "large")
    assert victim.read_text() == "precious"


def test_a_folder_that_may_not_be_written_keeps_nothing(tmp_path, monkeypatch):
    def refuse(*_):
        raise WriteError("may not be written")

    monkeypatch.setattr(module, "durable_replace", refuse)
    assert not save_sigma(tmp_path, MEASURED)
    assert not list(tmp_path.iterdir())


def test_a_writer_leaves_it_and_sweeps_what_a_killed_one_left(store):
    save_sigma(store, MEASURED)
    debris = store / "SIGMA.123.tmp"
    debris.write_bytes(b"half")
    with open_store(store) as snapshot:
        sweep(store, snapshot.manifest)
    assert not debris.exists()
    assert read_sigma(store) is not None


def test_other_files_of_the_store_do_not_depend_on_it(store):
    before = store_bytes(store)
    save_sigma(store, MEASURED)
    after = store_bytes(store)
    after.pop("SIGMA")
    assert after == before


def test_verify_reports_damage_and_repair_removes_it(tmp_path):
    store = make_word_store(tmp_path / "s.store", {"a.amc": rest(20)}, feature_set=F39)
    save_sigma(store, MEASURED)
    assert verify_store(store).problems == ()
    (store / "SIGMA").write_bytes(b"nonsense")
    (problem,) = verify_store(store).problems
    assert problem.startswith(f"{store / 'SIGMA'}: it does not match its digest")
    assert len(verify_store(store, repair=True).problems) == 1
    assert verify_store(store).problems == ()
    assert not (store / "SIGMA").exists()
