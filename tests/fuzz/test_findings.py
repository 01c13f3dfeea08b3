"""What the machines found, one by one, so that nobody has to find it again."""

import json
import shutil
import struct
from dataclasses import replace

import numpy as np
import pytest

from mocapidx.errors import FormatError, StoreError
from mocapidx.formats.registry import read_recording
from mocapidx.graphs.graph_text import graph_from_graphml
from mocapidx.index.postings import open_index
from mocapidx.queries.files import parse_pattern
from mocapidx.store.read import open_store, read_manifest
from mocapidx.store.templates import read_templates, write_templates
from mocapidx.store.web import read_web, write_web
from mocapidx.tasks.compact import compact_store
from mocapidx.tasks.compare import compare_methods
from mocapidx.tasks.info import document_info, store_info
from mocapidx.tasks.label_files import Label, LabelFile
from mocapidx.tasks.origins import find_origins
from mocapidx.tasks.query import query_store
from mocapidx.tasks.stored import stored_motion, stored_poses
from mocapidx.tasks.template import shown_template
from mocapidx.tasks.unspecified import unspecified_in
from mocapidx.tasks.web import build_web, web_info
from mocapidx.templates.file import load_templates
from tests.fuzz.forging import forge_digests, tree_of, with_index, with_tree
from tests.fuzz.seeds import put
from tests.fuzz.text_readers import F39
from tests.fuzz.using import COMMANDS, Asked
from tests.made_points import c3d_bytes


def test_a_signalling_nan_is_a_point_that_was_not_seen(tmp_path):
    data = c3d_bytes(["A", "B"], np.full((4, 2, 3), 5.0))
    signalling = struct.pack("<I", 0x7F800001)
    changed = data.replace(struct.pack("<f", 5.0), signalling, 1)
    found = read_recording(put(tmp_path, ".", "x.c3d", changed)).positions
    assert np.isnan(found[0, 0]).all()
    assert np.isfinite(found[0, 1]).all()


def test_names_beyond_unicode_are_refused(tmp_path):
    names = np.array(["a", "b"])
    np.savez(tmp_path / "x.npz", positions=np.zeros((2, 2, 3)), joints=names, rate=30)
    data = (tmp_path / "x.npz").read_bytes()
    odd = names.copy()
    odd.view("u4")[1] = 0x110000
    members = {"positions": np.zeros((2, 2, 3)), "rate": 30, "joints": odd}
    np.savez(tmp_path / "x.npz", **members)
    assert (tmp_path / "x.npz").read_bytes() != data
    with pytest.raises(FormatError, match="what is no character"):
        read_recording(tmp_path / "x.npz")


def test_angles_that_overflow_are_refused(tmp_path):
    poses = np.zeros((2, 156))
    poses[1, 3] = 1e300
    np.savez(tmp_path / "x.npz", poses=poses, trans=np.zeros((2, 3)), mocap_framerate=60)
    with pytest.raises(FormatError, match="no angle in radians"):
        read_recording(tmp_path / "x.npz")


def test_a_frame_of_which_no_point_was_seen_is_one(tmp_path):
    frames = [[[1, 2, 3], [4, 5, 6]], [None, None], [[1, 2, 3], None]]
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"joints": ["a", "b"], "frames": frames}))
    assert np.isnan(read_recording(path).positions[:, :, 0]).tolist() == [
        [False, False],
        [True, True],
        [False, True],
    ]


@pytest.mark.parametrize("encoding", ["UT8", "utf-7", "hex", "idna", "x" * 100])
def test_graphml_of_another_encoding_is_read_as_the_text_that_it_is(encoding):
    with pytest.raises(FormatError, match="not a match graph"):
        graph_from_graphml(f'<?xml version="1.0" encoding="{encoding}"?><graphml/>')


@pytest.mark.parametrize("seconds", ["9" * 400, "1" + "0" * 15])
def test_seconds_without_end_are_refused(seconds):
    text = f'steps = ["F20", {{ is = "F37", min = {seconds} }}]'
    with pytest.raises(FormatError, match="'min' must be seconds"):
        parse_pattern(text, F39, 30.0, "p.toml")


def test_a_kind_of_template_steers_no_terminal(seeds, tmp_path):
    meta, matrices = read_templates(seeds / "templates/t.mt")
    meta["templates"][0]["kind"] = "\x1b[2J" + "x" * 5000
    write_templates(tmp_path / "t.mt", meta, matrices)
    with pytest.raises(StoreError) as caught:
        load_templates(tmp_path / "t.mt")
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 400


def test_templates_of_other_features_than_their_text_are_refused(seeds, tmp_path):
    meta, matrices = read_templates(seeds / "templates/t.mt")
    write_templates(tmp_path / "t.mt", meta, [matrix[:, :5] for matrix in matrices])
    with pytest.raises(StoreError, match="other features than their feature set"):
        shown_template(tmp_path / "t.mt", "squat")
    meta["feature_set_text"] = "nonsense ="
    write_templates(tmp_path / "u.mt", meta, matrices)
    with pytest.raises(StoreError, match="make the template file again"):
        shown_template(tmp_path / "u.mt", "squat")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("skeleton", 3),
        ("skeleton", []),
        ("skeleton", [3]),
        ("skeleton", ["a\0"]),
        ("skeleton", ["a", "b"]),
        ("source_start", "x"),
        ("source_start", -1),
        ("source_start", 2**62),
        ("untrusted", []),
        ("coincident", [3]),
        ("coincident", 3),
        ("coincident", [["a", "b", "c"]]),
    ],
)
def test_whatever_a_store_says_of_a_skeleton_is_told_or_refused(store, key, value):
    with_tree(lambda tree: tree["rigs"][0].__setitem__(key, value))(store)
    name = tree_of(store)["files"][0]["documents"]["name"][0]
    if key == "coincident":
        asked(store, name)
        return
    with pytest.raises(StoreError) as caught:
        asked(store, name)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("value", [[[10**400] * 3] * 24, [[1e300] * 3] * 24, [], "x", [[0, 0, 0]]])
def test_a_zero_pose_that_is_none_is_damage(store, value):
    with_tree(lambda tree: [rig.__setitem__("rest", value) for rig in tree["rigs"]])(store)
    with open_store(store) as snapshot:
        placed = next(iter(snapshot.files[0].placed()))
        with pytest.raises(StoreError, match="its zero pose is none"):
            stored_motion(snapshot, placed)


@pytest.mark.parametrize(
    ("key", "value"),
    [("made", [[]]), ("made", {"a": 1}), ("made", [1, "x"]), ("unit", 10**400), ("unit", -1)],
    ids=["list", "object", "number", "endless", "negative"],
)
def test_odd_facts_of_a_skeleton_say_nothing(seeds, tmp_path, key, value):
    shutil.copytree(seeds / "forged-used.beside", tmp_path, dirs_exist_ok=True)
    store, folder = tmp_path / "take.store", tmp_path / "results"
    with_tree(lambda tree: [rig.__setitem__(key, value) for rig in tree["rigs"]])(store)
    with open_store(store) as snapshot:
        names = [placed.document.name for placed in snapshot.documents()]
    for command in ("features check", "reindex", "web build, match", "report", "export"):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        COMMANDS[command](Asked(store, names, folder))


def test_a_store_of_dead_documents_alone_is_emptied(store):
    def kill(tree):
        for file in tree["files"]:
            file["documents"]["live"] = [False] * len(file["documents"]["live"])

    with_tree(kill)(store)
    assert compact_store(store) == (2, 0)
    assert read_manifest(store).files == ()


def test_a_feature_set_is_known_by_a_digest_and_nothing_else(store):
    with_tree(lambda tree: tree["feature_set"].__setitem__("digest", "\x1b[2J"))(store)
    with pytest.raises(StoreError, match="a digest is not 64 hexadecimal digits"):
        store_info(store)


def test_a_path_of_a_store_that_is_longer_than_any_is_shortened(store, tmp_path):
    with_tree(lambda tree: tree.__setitem__("roots", ["x" * 5000]))(store)
    name = tree_of(store)["files"][0]["documents"]["name"][0]
    (origin,) = find_origins([name], [store]).values()
    assert "is not there" in str(origin)
    assert len(str(origin)) < 1000


def test_gaps_without_end_are_damage(store):
    document = read_manifest(store).files[0].documents[0]
    with pytest.raises(StoreError, match="its gaps are none"):
        unspecified_in(replace(document, rig={"unspecified": [[0, float("inf"), "1"]]}))


def asked(store, name):
    document_info(store, name)
    query_store(store, steps_of=("F20", "0"))


def test_a_part_of_control_characters_steers_no_terminal(store):
    with_index(lambda data, size: (data.replace(b"upper", b"\x1b[2Jx", 1), size))(store)
    head = read_manifest(store).files[0]
    data = (store / "segments" / head.names[1]).read_bytes()
    lists = open_index(data[: head.head.size], lambda at, size: b"", len(data))
    assert all(name.isprintable() for name in lists)


def test_lists_of_another_part_are_damage(store):
    with_index(lambda data, size: (data.replace(b"upper", b"apper", 1), size))(store)
    with pytest.raises(StoreError, match="its lists are of other runs"):
        store_info(store)


def test_poses_that_overflow_are_damage(store):
    manifest = read_manifest(store)
    dataset = manifest.files[0].datasets["frames/poses"]
    path = store / "segments/000001.h5"
    data = bytearray(path.read_bytes())
    data[dataset.offset : dataset.offset + 4] = struct.pack("<f", 3e38)
    path.write_bytes(data)
    forge_digests(store, manifest, 0, data)
    with open_store(store) as snapshot:
        placed = snapshot.files[0].placed()
        with pytest.raises(StoreError, match="its poses are none"):
            stored_poses(snapshot, next(iter(placed)))
    names = [name for file in manifest.files for name in (d.name for d in file.documents)]
    labels = (Label(name, f"{n % 2}", None, None, f"{n}", "here") for n, name in enumerate(names))
    with pytest.raises(StoreError, match="its poses are none"):
        compare_methods(store, LabelFile(tuple(labels)))


def test_paths_that_are_cut_off_are_damage_to_every_command(seeds, tmp_path):
    shutil.copytree(seeds / "web.beside", tmp_path, dirs_exist_ok=True)
    path = tmp_path / "arms.web"
    held = read_web(seeds / "web/arms.web")
    pieces = held.pieces.copy()
    pieces[np.flatnonzero(pieces[:, 3])[0], 3] = 7
    write_web(path, replace(held, pieces=pieces))
    for work in (lambda: web_info(path), lambda: build_web(tmp_path / "arms.store", path)):
        with pytest.raises(StoreError, match=r"arms\.web: damaged \(.* are cut off\)"):
            work()


def test_numbers_beyond_all_frames_and_rates_are_damage(seeds, tmp_path):
    path = tmp_path / "arms.web"
    held = read_web(seeds / "web/arms.web")
    first, *rest = held.documents
    endless = replace(held, documents=(replace(first, frames=10**400), *rest))
    for forged in (endless, replace(held, rate=10**400)):
        write_web(path, forged)
        with pytest.raises(StoreError, match=r"arms\.web: damaged"):
            web_info(path)
