"""Clips hold what the stretch of their file held, lie in their folder, and say where from."""

import contextlib
import csv
import json
import os
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from mocapidx.errors import FormatError, Interrupted, ParameterError, WriteError
from mocapidx.features.extract import extract_features
from mocapidx.formats.registry import read_recording, sources_of
from mocapidx.skeleton.resample import resample_motion
from mocapidx.tasks import export as subject
from mocapidx.tasks.export import SIDECAR, ExportOptions, export_clips
from mocapidx.tasks.read import read_motion, read_take

TAKES = ("takes/ann_take_120.amc", "bvh/ann_take.bvh")


def record(document, start, end, rank=1, label="kick", **more):
    return {
        "rank": rank,
        "document": document,
        "start_time": start,
        "end_time": end,
        "cost": 0.5,
        "label": label,
    } | more


def records_file(path, records):
    path.write_text("".join(f"{json.dumps(each)}\n" for each in records))
    return path


@pytest.fixture
def exported(tmp_path, fixtures_dir):
    """Export records from the generated motion; gives the folder and its sidecar."""

    def run(records, **options):
        options = {"roots": (fixtures_dir,)} | options
        hits = records_file(tmp_path / "hits.jsonl", records)
        export_clips(hits, tmp_path / "clips", ExportOptions(**options))
        return tmp_path / "clips", sidecar(tmp_path / "clips")

    return run


def sidecar(folder):
    return [json.loads(line) for line in (folder / SIDECAR).read_text().splitlines()]


@pytest.mark.parametrize("document", TAKES)
def test_a_clip_has_the_very_values_of_its_stretch(exported, fixtures_dir, document):
    folder, (clip,) = exported([record(document, 4.0, 5.5)])
    whole, part = read_recording(fixtures_dir / document), read_recording(folder / clip["file"])
    start, end = clip["clip_start_frame"], clip["clip_end_frame"]
    assert (start, end) == (round(4.0 * clip["rate"]), round(5.5 * clip["rate"]))
    np.testing.assert_array_equal(part.values, whole.values[start:end])
    np.testing.assert_array_equal(part.skeleton.offsets, whole.skeleton.offsets)
    assert part.skeleton.names == whole.skeleton.names
    assert part.rate == clip["rate"]


def test_an_amc_goes_with_its_own_skeleton(exported, fixtures_dir):
    folder, clips = exported(
        [record("takes/ann_take_120.amc", 1, 2), record("takes/dov_take_120.amc", 1, 2, rank=2)]
    )
    for clip, actor in zip(clips, ("ann", "dov"), strict=True):
        skeleton = sources_of(folder / clip["file"])[1]
        assert skeleton.stem == (folder / clip["file"]).stem
        assert skeleton.read_bytes() == (fixtures_dir / "takes" / f"{actor}.asf").read_bytes()


@pytest.mark.parametrize("ends", [b"\n", b"\r\n"])
def test_a_clip_of_an_amc_says_the_rate_that_its_name_told(tmp_path, fixtures_dir, ends):
    own = tmp_path / "own"
    own.mkdir()
    text = (fixtures_dir / TAKES[0]).read_bytes().replace(b"\n", ends)
    (own / "take_200.amc").write_bytes(text)
    (own / "take.asf").write_bytes((fixtures_dir / "takes" / "ann.asf").read_bytes())
    hits = records_file(tmp_path / "hits.jsonl", [record("take_200.amc", 1.0, 2.0)])
    export_clips(hits, tmp_path / "clips", ExportOptions(roots=(own,)))
    (clip,) = sidecar(tmp_path / "clips")
    assert clip["rate"] == 200
    part, whole = read_take(tmp_path / "clips" / clip["file"]), read_take(own / "take_200.amc")
    assert (part.motion.rate, part.rate_origin) == (200, "file")
    np.testing.assert_array_equal(part.motion.positions, whole.motion.positions[200:400])


@pytest.mark.parametrize("document", TAKES)
def test_feature_words_of_a_clip_are_those_of_its_stretch(exported, fixtures_dir, document):
    # speeds and hysteresis look a little further than the stretch: handles give them that
    folder, (clip,) = exported([record(document, 4.0, 6.0)], handles=1.0)
    whole = extract_features(read_motion(fixtures_dir / document))
    part = extract_features(read_motion(folder / clip["file"]))
    np.testing.assert_array_equal(part[30:90], whole[120:180])


@pytest.mark.parametrize("document", TAKES)
def test_any_input_becomes_bvh_with_the_same_motion(exported, fixtures_dir, document):
    folder, (clip,) = exported([record(document, 4.0, 5.0)], to="bvh")
    assert clip["file"].endswith(".bvh")
    whole, part = read_motion(fixtures_dir / document), read_motion(folder / clip["file"])
    expected = whole.positions[clip["clip_start_frame"] : clip["clip_end_frame"]]
    np.testing.assert_allclose(part.positions, expected, atol=1e-9)
    assert part.rate == whole.rate


@pytest.mark.parametrize("document", TAKES)
def test_positions_as_npz_and_csv(exported, fixtures_dir, document, tmp_path):
    whole = read_motion(fixtures_dir / document)
    folder, (clip,) = exported([record(document, 4.0, 5.0)], to="npz")
    expected = whole.positions[clip["clip_start_frame"] : clip["clip_end_frame"]]
    with np.load(folder / clip["file"], allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["positions"], expected)
        assert tuple(arrays["joints"]) == whole.joints
        assert arrays["rate"] == whole.rate
    folder, (clip,) = exported([record(document, 4.0, 5.0)], to="csv", force=True)
    header, *rows = (folder / clip["file"]).read_text().splitlines()
    assert header.startswith("time,root_x,root_y,root_z,lhip_x")
    table = np.array([[float(cell or "nan") for cell in row.split(",")] for row in rows])
    np.testing.assert_array_equal(table[:, 1:].reshape(expected.shape), expected)
    np.testing.assert_array_equal(table[:, 0], np.arange(len(expected)) / whole.rate)


@pytest.mark.parametrize("document", TAKES)
@pytest.mark.parametrize("to", ["npz", "csv"])
def test_positions_are_read_back_as_the_same_motion(exported, fixtures_dir, document, to):
    folder, (clip,) = exported([record(document, 4.0, 6.0)], to=to, handles=1.0)
    whole, part = read_motion(fixtures_dir / document), read_motion(folder / clip["file"])
    expected = whole.positions[clip["clip_start_frame"] : clip["clip_end_frame"]]
    np.testing.assert_array_equal(part.positions, expected)
    assert part.rate == whole.rate
    words = extract_features(whole)[120:180]
    np.testing.assert_array_equal(extract_features(part)[30:90], words)


def test_an_npz_says_what_is_up_even_of_somebody_who_lies(exported, fixtures_dir):
    folder, (clip,) = exported([record(TAKES[0], 0.2, 1.0)], to="npz")  # lieDownFloor
    whole, part = read_take(fixtures_dir / TAKES[0]), read_take(folder / clip["file"])
    assert (part.conventions.unit, part.conventions.up) == (1.0, "y")
    np.testing.assert_array_equal(part.motion.positions, whole.motion.positions[24:120])


@pytest.mark.parametrize("to", ["npz", "csv"])
def test_made_joints_are_made_again(exported, real_data, to):
    document = "c3d/PlugInC3D.c3d"
    folder, (clip,) = exported([record(document, 0.5, 1.5)], to=to, roots=(real_data,))
    whole, part = read_motion(real_data / document), read_motion(folder / clip["file"])
    assert set(whole.made) <= set(part.made) <= {*whole.made, "headtop", "belly", "chest", "neck"}


def test_handles_end_where_the_motion_ends(exported, fixtures_dir):
    seconds = read_take(fixtures_dir / TAKES[1]).source_frames / 30
    _, (first, last) = exported(
        [record(TAKES[1], 0.5, 1.0), record(TAKES[1], seconds - 1, seconds, rank=2)], handles=2.0
    )
    assert (first["handle_before"], first["handle_after"]) == (0.5, 2.0)
    assert (last["handle_before"], last["handle_after"]) == (2.0, 0.0)


def test_a_pose_before_the_motion_is_no_handle(exported):
    read = replace(ExportOptions().read, keep_first_frame=False)
    _, (clip,) = exported([record(TAKES[1], 0.0, 1.0)], handles=1.0, read=read)
    assert clip["clip_start_frame"] == clip["source_start_frame"] == 1


def test_frames_of_the_source_count_more_than_times(exported):
    _, (clip,) = exported([record(TAKES[0], 1.0, 2.0, source_start_frame=7, source_end_frame=19)])
    assert (clip["clip_start_frame"], clip["clip_end_frame"]) == (7, 19)


def test_clips_sort_by_rank_and_the_best_come_first(exported):
    records = [record(TAKES[1], n, n + 1, rank=12 - n) for n in range(12)]
    folder, clips = exported(records, top=3)
    assert [clip["rank"] for clip in clips] == [1, 2, 3]
    assert [clip["start_time"] for clip in clips] == [11, 10, 9]
    names = sorted(p.name for p in folder.glob("*.bvh"))
    assert names == [clip["file"] for clip in clips]
    assert names[0].startswith("0001_kick_ann_take-")


@pytest.mark.parametrize("key", ["missing", "twice"])
def test_without_different_ranks_the_order_counts(exported, key):
    records = [record(TAKES[1], n, n + 1) for n in range(3)]
    if key == "missing":
        for each in records:
            del each["rank"]
    _, clips = exported(records)
    assert [(clip["rank"], clip["start_time"]) for clip in clips] == [(1, 0), (2, 1), (3, 2)]


def test_the_sidecar_says_where_a_clip_is_from_and_can_be_exported_again(exported, fixtures_dir):
    folder, (clip,) = exported([record(TAKES[0], 4.0, 5.0)], handles=0.25)
    assert clip["document"] == TAKES[0]
    assert clip["cost"] == 0.5
    assert clip["source"] == str(fixtures_dir / TAKES[0])
    assert clip["handle_before"] == 0.25
    options = ExportOptions(roots=(fixtures_dir,), handles=0.25)
    again = export_clips(folder / SIDECAR, folder.parent / "again", options)
    assert again.clips == (clip,)


def test_a_store_knows_where_the_files_are(tmp_path, fixtures_store, fixtures_dir):
    hits = records_file(tmp_path / "hits.jsonl", [record(TAKES[0], 4.0, 5.0)])
    export_clips(hits, tmp_path / "clips", ExportOptions(stores=(fixtures_store,)))
    (clip,) = sidecar(tmp_path / "clips")
    assert clip["source"] == str(fixtures_dir / TAKES[0])
    part = read_motion(tmp_path / "clips" / clip["file"], source_rate=120)
    whole = resample_motion(read_motion(fixtures_dir / TAKES[0]), 120.0)
    np.testing.assert_array_equal(part.positions, whole.positions[480:600])


@pytest.mark.parametrize(("to", "suffix"), [("npz", ".npz"), ("csv", ".npz"), ("bvh", ".bvh")])
def test_clips_are_documents_again(tmp_path, exported, mocapidx, to, suffix):
    folder, (clip,) = exported([record(TAKES[0], 4.0, 8.0)], to=to)
    store = tmp_path / "clips.store"
    done = mocapidx("index", folder / clip["file"], "--store", store, "--jobs", "1")
    assert done.returncode == 0, done.stderr
    hits = records_file(tmp_path / "again.jsonl", [record(clip["file"], 1.0, 2.0)])
    export_clips(hits, tmp_path / "again", ExportOptions(stores=(store,)))
    (again,) = sidecar(tmp_path / "again")
    assert again["file"].endswith(suffix)
    part = read_motion(tmp_path / "again" / again["file"])
    whole = read_motion(folder / clip["file"])
    np.testing.assert_array_equal(part.positions, whole.positions[120:240])


def test_no_hits_are_no_clips(exported):
    folder, clips = exported([])
    assert clips == []
    assert [path.name for path in folder.iterdir()] == [SIDECAR]


def test_who_stops_it_is_told_how_far_it_came(tmp_path, fixtures_dir):
    records = [record(document, 1, 2, rank=n) for n, document in enumerate(TAKES, start=1)]
    hits = records_file(tmp_path / "hits.jsonl", records)

    def stop(done, total):
        raise Interrupted(15)

    options = ExportOptions(roots=(fixtures_dir,))
    with pytest.raises(Interrupted, match="stopped after 1 clip; run again to continue"):
        export_clips(hits, tmp_path / "clips", options, progress=stop)


def test_a_disk_that_is_full_half_way_is_told_with_how_far_it_came(
    tmp_path, fixtures_dir, monkeypatch
):
    records = [record(document, 1, 2, rank=n) for n, document in enumerate(TAKES, start=1)]
    hits = records_file(tmp_path / "hits.jsonl", records)
    real, written = subject.durable_replace, []

    def write(path, data):
        if len(written) == 2:  # an AMC and its ASF
            raise WriteError(f"no space left on / for {path}; {path} is not there")
        written.append(path)
        real(path, data)

    monkeypatch.setattr(subject, "durable_replace", write)
    options = ExportOptions(roots=(fixtures_dir,))
    with pytest.raises(WriteError, match=r"not there; 1 clip written; run again to continue"):
        export_clips(hits, tmp_path / "clips", options)


def test_nothing_is_replaced_without_force(exported):
    folder, _ = exported([record(TAKES[1], 1.0, 2.0)])
    (clip,) = folder.glob("*.bvh")
    clip.write_text("mine")
    (folder / SIDECAR).unlink()
    with pytest.raises(ParameterError, match="is there already; --force replaces it"):
        exported([record(TAKES[1], 1.0, 2.0)])
    assert clip.read_text() == "mine"
    exported([record(TAKES[1], 1.0, 2.0)], force=True)
    assert clip.read_text() != "mine"


def contents(folder):
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.iterdir()}


def bytes_below(folder):
    return {name: data for name, (data, _) in contents(folder).items()}


BOTH = [record(document, n, n + 1, rank=n) for n in (1, 2) for document in TAKES]


@pytest.mark.parametrize("to", ["source", "bvh", "npz", "csv"])
@pytest.mark.parametrize("stop", range(8))
def test_an_export_that_was_stopped_ends_like_one_that_never_was(
    tmp_path, fixtures_dir, monkeypatch, to, stop
):
    hits = records_file(tmp_path / "hits.jsonl", BOTH)
    options = ExportOptions(roots=(fixtures_dir,), to=to)
    whole = export_clips(hits, tmp_path / "whole", options)
    real, left = subject.durable_replace, stop

    def write(path, data):
        nonlocal left
        left -= 1
        if left < 0:
            raise Interrupted(15)
        real(path, data)

    monkeypatch.setattr(subject, "durable_replace", write)
    with contextlib.suppress(Interrupted):  # the last ones need as many writes, or fewer
        export_clips(hits, tmp_path / "clips", options)
    monkeypatch.undo()
    before = contents(tmp_path / "clips")
    again = export_clips(hits, tmp_path / "clips", options)
    assert bytes_below(tmp_path / "clips") == bytes_below(tmp_path / "whole")
    assert contents(tmp_path / "clips").items() >= before.items()  # nothing was written twice
    assert again.clips == whole.clips
    # of an AMC whose ASF is not there yet only half a clip is
    files = [name for name in before if not name.endswith((".asf", ".jsonl"))]
    halves = sum(name.endswith(".amc") and f"{name[:-4]}.asf" not in before for name in files)
    assert again.there == len(files) - halves


def test_what_is_there_is_told(tmp_path, fixtures_dir, mocapidx):
    hits = records_file(tmp_path / "hits.jsonl", BOTH)
    arguments = ("export", hits, "--root", fixtures_dir, "--output", tmp_path / "clips")
    assert mocapidx(*arguments, "--top", "1").returncode == 0
    (tmp_path / "clips" / SIDECAR).unlink()
    assert mocapidx(*arguments).stderr == f"4 clips in {tmp_path}/clips; 1 was there already\n"
    assert mocapidx(*arguments).stderr == f"4 clips in {tmp_path}/clips; 4 were there already\n"
    assert mocapidx(*arguments, "--force").stderr == f"4 clips in {tmp_path}/clips\n"


def test_one_that_differs_is_refused_before_anything_is_written(exported, tmp_path):
    folder, clips = exported(BOTH)
    last, first = folder / clips[-1]["file"], folder / clips[0]["file"]
    first.unlink()
    (folder / SIDECAR).unlink()
    size = last.stat().st_size
    last.write_bytes(b"x" * size)
    before = contents(folder)
    with pytest.raises(ParameterError, match=f"{last.name}: is there already; --force replaces"):
        exported(BOTH)
    assert contents(folder) == before


def test_the_sidecar_of_other_clips_is_refused_before_anything_is_written(exported):
    folder, _ = exported(BOTH[:2])
    before = contents(folder)
    for records in (BOTH, BOTH[:1], BOTH[2:]):
        with pytest.raises(ParameterError, match=r"clips\.jsonl: is there already; --force repl"):
            exported(records)
        assert contents(folder) == before


def test_a_clip_that_was_taken_away_comes_back(exported):
    folder, clips = exported(BOTH)
    before = bytes_below(folder)
    (folder / clips[1]["file"]).unlink()
    exported(BOTH)
    assert bytes_below(folder) == before


def test_a_clip_in_another_format_is_in_the_way(exported):
    folder, _ = exported(BOTH, to="npz")
    (folder / SIDECAR).unlink()
    with pytest.raises(ParameterError, match=r"npz: is there already; --force replaces it"):
        exported(BOTH, to="csv")


def test_documents_that_are_passed_over_are_so_again(tmp_path, fixtures_dir):
    records = [record("gone.bvh", 1, 2, rank=9), record(TAKES[1], 1e6, 1e6 + 1, rank=10), *BOTH]
    hits = records_file(tmp_path / "hits.jsonl", records)
    options = ExportOptions(roots=(fixtures_dir,), skip_bad=True)
    first = export_clips(hits, tmp_path / "clips", options)
    before = contents(tmp_path / "clips")
    again = export_clips(hits, tmp_path / "clips", options)
    assert (again.clips, again.refused) == (first.clips, first.refused)
    assert len(again.refused) == 2
    assert contents(tmp_path / "clips") == before


def test_what_can_not_be_made_again_may_be_somebody_elses(tmp_path, fixtures_dir):
    hits = records_file(tmp_path / "hits.jsonl", [record("gone.bvh", 1, 2)])
    options = ExportOptions(roots=(fixtures_dir,), skip_bad=True)
    export_clips(hits, tmp_path / "clips", options)
    (tmp_path / "clips" / SIDECAR).unlink()
    stem = subject._stems(subject._numbered(subject.read_found(hits), None))[0]
    (tmp_path / "clips" / f"{stem}.bvh").write_text("mine")
    with pytest.raises(ParameterError, match="is there already"):
        export_clips(hits, tmp_path / "clips", options)


def test_the_records_that_are_read_are_not_replaced(exported, fixtures_dir):
    folder, _ = exported(BOTH)
    before = contents(folder)
    for more in ({}, {"force": True, "top": 1}):
        options = ExportOptions(roots=(fixtures_dir,), **more)
        if more:
            with pytest.raises(ParameterError, match="is read and would be replaced"):
                export_clips(folder / SIDECAR, folder, options)
        else:
            export_clips(folder / SIDECAR, folder, options)
        assert contents(folder) == before


def test_no_more_than_one_clip_is_held(tmp_path, fixtures_dir):
    peaks = []
    for number in (1, 1, 6):  # the first one loads modules
        whole = [record(TAKES[0], 0, 1000, rank=rank) for rank in range(1, number + 1)]
        hits = records_file(tmp_path / "hits.jsonl", whole)
        folder = tmp_path / f"clips{len(peaks)}"
        options = ExportOptions(roots=(fixtures_dir,), to="csv")
        for _ in range(2):  # written, then compared
            tracemalloc.start()
            export_clips(hits, folder, options)
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
    size = max(path.stat().st_size for path in folder.iterdir())
    assert abs(peaks[4] - peaks[2]) < size / 2
    assert abs(peaks[5] - peaks[3]) < size / 2


def test_annotations_that_are_there_are_passed_over(tmp_path, mocapidx):
    hits = records_file(tmp_path / "hits.jsonl", BOTH)
    arguments = ("export", hits, "--to", "vtt", "--output", tmp_path / "said")
    assert mocapidx(*arguments).returncode == 0
    before = contents(tmp_path / "said")
    first, second = sorted((tmp_path / "said").iterdir())
    first.unlink()
    assert mocapidx(*arguments).returncode == 0
    assert bytes_below(tmp_path / "said") == {name: data for name, (data, _) in before.items()}
    assert contents(tmp_path / "said")[second.name] == before[second.name]
    first.unlink()
    second.write_text("mine")
    refused = mocapidx(*arguments)
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert not first.exists()


@pytest.mark.parametrize("force", [False, True])
def test_links_in_the_folder_are_not_followed(exported, tmp_path, force):
    folder, _ = exported([record(TAKES[1], 1.0, 2.0)])
    (clip,) = folder.glob("*.bvh")
    outside = tmp_path / "outside"
    outside.write_text("mine")
    clip.unlink()
    clip.symlink_to(outside)
    (folder / SIDECAR).unlink()
    with pytest.raises(ParameterError, match="symbolic link"):
        exported([record(TAKES[1], 1.0, 2.0)], force=force)
    assert outside.read_text() == "mine"


REAL = {
    "c3d/PiG_Motion3_FF.c3d": ".c3d",
    "c3d/PlugInC3D.c3d": ".c3d",
    "trc/pyomeca_markers.trc": ".npz",
    "bandai/2/dataset-2_raise-up-left-hand_normal_002.bvh": ".bvh",
    "cmu/02/02_03.amc": ".amc",
}


@pytest.mark.parametrize("document", REAL)
def test_real_files_of_every_kind_are_cut(exported, real_data, document):
    folder, (clip,) = exported([record(document, 0.2, 0.9)], roots=(real_data,))
    assert clip["file"].endswith(REAL[document])
    whole = read_take(real_data / document)
    start, end = clip["clip_start_frame"], clip["clip_end_frame"]
    expected = whole.motion.positions[start - whole.source_start : end - whole.source_start]
    if REAL[document] == ".npz":
        with np.load(folder / clip["file"], allow_pickle=False) as arrays:
            np.testing.assert_array_equal(arrays["positions"], expected)
        return
    read = {"unit": clip["unit"], "up": clip["up"], "keep_first_frame": True}
    part = read_motion(folder / clip["file"], **read)
    np.testing.assert_array_equal(part.positions, expected)
    assert part.rate == whole.motion.rate


@pytest.mark.parametrize("document", REAL)
def test_real_files_of_every_kind_become_bvh(exported, real_data, document):
    folder, (clip,) = exported([record(document, 0.2, 0.9)], roots=(real_data,), to="bvh")
    recording = read_recording(folder / clip["file"])
    assert len(recording.values) == clip["clip_end_frame"] - clip["clip_start_frame"]
    assert recording.rate == clip["rate"]


def made_files(folder, motion):
    """Files of the kinds that there are no small real ones of, made without our writers."""
    positions, names = motion.positions[:480:4], motion.joints
    np.save(folder / "list.npy", positions)
    (folder / "list.joints.txt").write_text("\n".join(names))
    np.savez(folder / "points.npz", positions=positions, joints=np.array(names), rate=30.0)
    rows = [[n / 30, *row.ravel().tolist()] for n, row in enumerate(positions)]
    with (folder / "table.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *(f"{name}.{axis}" for name in names for axis in "xyz")])
        writer.writerows(rows)
    points = {"rate": 30, "joints": list(names), "frames": positions.tolist()}
    (folder / "named.json").write_text(json.dumps(points))
    poses = np.random.default_rng(4).normal(0, 0.1, (120, 156))
    poses[:, :3] = (np.pi / 2, 0, 0)  # stands: up is z there
    arrays = {"poses": poses, "trans": np.zeros((120, 3)), "mocap_framerate": 30.0}
    np.savez(folder / "amass.npz", gender=np.array("neutral"), **arrays)


@pytest.mark.parametrize("to", ["source", "bvh", "npz", "csv"])
def test_files_of_every_kind_go_through_a_store_into_clips(tmp_path, fixtures_dir, mocapidx, to):
    own = tmp_path / "own"
    own.mkdir()
    made_files(own, read_motion(fixtures_dir / TAKES[0]))
    names = sorted(path.name for path in own.iterdir() if path.suffix != ".txt")
    done = mocapidx("index", own, "--store", tmp_path / "s", "--jobs", "1", "--source-rate", "30")
    assert done.returncode == 0, done.stderr
    records = [record(name, 1.0, 2.0, rank=n) for n, name in enumerate(names, start=1)]
    hits = records_file(tmp_path / "hits.jsonl", records)
    export_clips(hits, tmp_path / "clips", ExportOptions(stores=(tmp_path / "s",), to=to))
    clips = sidecar(tmp_path / "clips")
    assert [clip["document"] for clip in clips] == names
    for clip in clips:
        whole = read_motion(own / clip["document"], source_rate=30.0)
        part = read_motion(tmp_path / "clips" / clip["file"], unit=clip["unit"], up=clip["up"])
        assert part.rate == 30.0
        off = np.linalg.norm(part.positions - whole.positions[30:60], axis=2)
        exact = to != "bvh" or clip["document"] == "amass.npz"
        assert np.nanmax(off) < (1e-9 if exact else 0.05)


BAD_NAMES = (
    "../../etc/passwd",
    "/etc/passwd",
    "a/../../b.bvh",
    "a\0b.bvh",
    "CON",
    "x" * 300,
    "\ud800.bvh",
    "\udcff.bvh",
    "",
    "<script>alert(1)</script>.bvh",
    "=cmd|' /C calc'!A0",
    "no\nnewline\t\x1b[2J\u202e.bvh",
)


@pytest.mark.parametrize("name", BAD_NAMES)
def test_names_that_lead_nowhere_are_one_line(exported, name):
    with pytest.raises(FormatError) as caught:
        exported([record(name, 1.0, 2.0)])
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 400


@pytest.mark.parametrize(
    "name",
    [
        "../up.bvh",
        "sub/=cmd.bvh",
        "CON.bvh",
        "<script>.bvh",
        "x" * 200 + ".bvh",
        "new\nline.bvh",
        "esc\x1b[2J.bvh",
        "bidi\u202e.bvh",
        "latin\udcfc.bvh",
        "-rf.bvh",
        " .bvh",
    ],
)
def test_whatever_a_document_and_its_class_are_called_clips_stay_in_their_folder(
    tmp_path, fixtures_dir, name
):
    own = tmp_path / "own"
    (own / "sub").mkdir(parents=True)
    os.symlink(fixtures_dir / TAKES[1], own / "up.bvh")
    if not name.startswith(".."):
        (own / name).write_bytes((fixtures_dir / TAKES[1]).read_bytes())
    hits = records_file(
        tmp_path / "hits.jsonl", [record(name.replace("../", ""), 1.0, 2.0, label=name)]
    )
    before = {p for p in tmp_path.rglob("*")}
    export_clips(hits, tmp_path / "clips", ExportOptions(roots=(own,)))
    new = {p for p in tmp_path.rglob("*")} - before - {tmp_path / "clips"}
    assert {p.parent for p in new} == {tmp_path / "clips"}
    assert len(new) == 2
    assert all(p.name.isascii() and p.name.isprintable() and len(p.name) < 120 for p in new)


def test_names_that_differ_in_case_only_get_different_clips(tmp_path, fixtures_dir):
    own = tmp_path / "own"
    own.mkdir()
    records = []
    for n, name in enumerate(("Walk.bvh", "walk.bvh", "walk .bvh"), start=1):
        (own / name).write_bytes((fixtures_dir / TAKES[1]).read_bytes())
        records.append(record(name, 1.0, 2.0, rank=n))
    hits = records_file(tmp_path / "hits.jsonl", records)
    export_clips(hits, tmp_path / "clips", ExportOptions(roots=(own,)))
    tails = {p.name[5:].lower() for p in (tmp_path / "clips").glob("*.bvh")}
    assert len(tails) == 3


def test_a_file_that_changed_since_it_was_indexed_is_refused(tmp_path, fixtures_dir, mocapidx):
    own = tmp_path / "own"
    own.mkdir()
    take = own / "take.bvh"
    take.write_bytes((fixtures_dir / TAKES[1]).read_bytes())
    assert mocapidx("index", own, "--store", tmp_path / "s", "--jobs", "1").returncode == 0
    take.write_bytes(take.read_bytes().replace(b"Frame Time: 0.0333333", b"Frame Time: 0.0333334"))
    hits = records_file(tmp_path / "hits.jsonl", [record("take.bvh", 1.0, 2.0)])
    with open(take, "ab") as file:
        file.write(b"\n")
    with pytest.raises(FormatError, match="has changed since it was indexed"):
        export_clips(hits, tmp_path / "clips", ExportOptions(stores=(tmp_path / "s",)))


def test_bad_documents_can_be_passed_over(tmp_path, fixtures_dir, mocapidx):
    hits = records_file(
        tmp_path / "hits.jsonl", [record("gone.bvh", 1, 2), record(TAKES[1], 1, 2, rank=2)]
    )
    arguments = ("export", hits, "--root", fixtures_dir, "--output", tmp_path / "clips")
    refused = mocapidx(*arguments)
    assert refused.returncode == 3
    assert refused.stderr.count("\n") == 1
    assert "gone.bvh" in refused.stderr
    done = mocapidx(*arguments, "--skip-bad", "--force")
    assert done.returncode == 5
    assert "gone.bvh" in done.stderr
    assert [clip["rank"] for clip in sidecar(tmp_path / "clips")] == [2]


def test_hits_come_through_a_pipe(tmp_path, fixtures_dir, fixtures_store, mocapidx):
    hits = records_file(tmp_path / "hits.jsonl", [record(TAKES[1], 1, 2)])
    done = mocapidx(
        *("export", "-", "--store", fixtures_store, "--output", tmp_path / "clips"),
        input=hits.read_text(),
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert done.stderr == f"1 clip in {tmp_path / 'clips'}\n"


def test_a_stretch_that_the_file_does_not_have_is_refused(exported):
    with pytest.raises(FormatError, match="begins at frame"):
        exported([record(TAKES[1], 1e6, 1e6 + 1)])


def test_the_folder_may_not_be_a_file(exported, tmp_path):
    (tmp_path / "clips").write_text("")
    with pytest.raises(ParameterError, match="is a file, expected a folder"):
        exported([record(TAKES[1], 1, 2)])
