import contextlib
import errno
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocapidx.errors import (
    FormatError,
    Interrupted,
    LockedError,
    ParameterError,
    StoreError,
    WriteError,
)
from mocapidx.features.extract import extract_features
from mocapidx.features.words import pack_words
from mocapidx.store.read import open_store
from mocapidx.store.write import writing
from mocapidx.tasks import index as index_task
from mocapidx.tasks import prepare as prepare_task
from mocapidx.tasks.compact import compact_store
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.prune import gone_documents
from mocapidx.tasks.query import query_store
from mocapidx.tasks.read import Limits, ReadOptions, read_motion
from tests.small_files import PERSON, bvh_text, person_rows

PROGRAM = Path(sys.executable).parent / "mocapidx"


@pytest.fixture
def takes(fixtures_dir, tmp_path):
    """Nine clips of three classes with their skeletons, free to be changed."""
    folder = tmp_path / "takes"
    clips = fixtures_dir / "clips"
    for label in ("squat", "kickFrontRight", "walk"):
        (folder / label).mkdir(parents=True)
        for clip in sorted((clips / label).glob("*.amc"))[:3]:
            shutil.copy2(clip, folder / label)
    for skeleton in clips.glob("*.asf"):
        shutil.copy2(skeleton, folder)
    return folder


def contents(store):
    """Every file of a store but the lock, whose text is for people."""
    return {
        str(path.relative_to(store)): path.read_bytes()
        for path in sorted(store.rglob("*"))
        if path.is_file() and path.name != "LOCK"
    }


def names(store):
    with open_store(store) as snapshot:
        return [entry.document.name for entry in snapshot.documents()]


def test_what_is_kept_is_what_reading_and_extraction_give(takes, tmp_path):
    store = tmp_path / "s.store"
    summary = index_files([takes], store)
    assert (summary.added, summary.changed, summary.unchanged) == (9, 0, 0)
    with open_store(store) as snapshot:
        assert sorted(takes.rglob("*.amc")) == sorted(
            takes / entry.document.name for entry in snapshot.documents()
        )
        for entry in snapshot.documents():
            motion = read_motion(takes / entry.document.name)
            words = pack_words(extract_features(motion, "f39", 30.0))
            rows = entry.frame_offset, entry.frame_offset + entry.document.frames
            np.testing.assert_array_equal(snapshot.array(entry.file, "frames/words", *rows), words)
            poses = snapshot.array(entry.file, "frames/poses", *rows)
            np.testing.assert_allclose(poses, motion.positions[::4], atol=1e-6)
            assert entry.document.source_frames == len(motion.positions)


def test_a_second_run_reads_and_writes_nothing(takes, tmp_path):
    store = tmp_path / "s.store"
    index_files([takes], store)
    before = {path: path.stat().st_mtime_ns for path in store.rglob("*") if path.name != "LOCK"}
    summary = index_files([takes], store)
    assert (summary.added, summary.changed, summary.unchanged) == (0, 0, 9)
    assert before == {
        path: path.stat().st_mtime_ns for path in store.rglob("*") if path.name != "LOCK"
    }


def test_a_touched_file_is_unchanged_and_one_with_other_bytes_is_read_again(takes, tmp_path):
    store = tmp_path / "s.store"
    index_files([takes], store)
    touched, changed = sorted((takes / "squat").glob("*.amc"))[:2]
    os.utime(touched)
    shutil.copyfile(touched, changed)
    summary = index_files([takes], store)
    assert (summary.added, summary.changed, summary.unchanged) == (0, 1, 8)
    assert len(names(store)) == len(set(names(store))) == 9


def test_another_skeleton_or_other_options_read_the_files_again(takes, tmp_path):
    store = tmp_path / "s.store"
    index_files([takes], store)
    summary = index_files([takes], store, IndexOptions(read=ReadOptions(source_rate=60.0)))
    assert summary.changed == 9
    for skeleton in takes.glob("*.asf"):
        skeleton.write_bytes(skeleton.read_bytes() + b"\n")
    summary = index_files([takes], store, IndexOptions(read=ReadOptions(source_rate=60.0)))
    assert summary.changed == 9


def test_prune_drops_what_is_gone_but_not_with_its_whole_folder(takes, tmp_path):
    store = tmp_path / "s.store"
    index_files([takes], store)
    gone = sorted((takes / "walk").glob("*.amc"))[0]
    gone.unlink()
    assert index_files([takes], store).removed == 0
    assert index_files([takes], store, IndexOptions(prune=True)).removed == 1
    assert len(names(store)) == 8
    (tmp_path / "other").mkdir()
    takes.rename(tmp_path / "moved")
    assert index_files([tmp_path / "other"], store, IndexOptions(prune=True)).removed == 0


def test_prune_keeps_what_may_be_on_a_disk_that_is_not_mounted(takes, tmp_path, mocapidx):
    store = tmp_path / "s.store"
    index_files([takes], store)
    shutil.rmtree(takes / "walk")
    (takes / "walk").mkdir()
    summary = index_files([takes], store, IndexOptions(prune=True))
    assert (summary.removed, dict(summary.kept)) == (0, {takes / "walk": 3})
    done = mocapidx("index", takes, "--store", store, "--prune", "--quiet")
    assert done.returncode == 0
    assert done.stderr.startswith(f"Warning: {takes}/walk: is empty or can't be listed, so 3 doc")
    (takes / "walk").rmdir()
    assert index_files([takes], store, IndexOptions(prune=True)).removed == 3
    shutil.rmtree(takes)
    takes.mkdir()
    assert index_files([takes], store, IndexOptions(prune=True)).removed == 0
    assert len(names(store)) == 6


def test_prune_keeps_what_is_in_folders_that_can_not_be_listed(takes, tmp_path, monkeypatch):
    store = tmp_path / "s.store"
    index_files([takes], store)
    with open_store(store) as snapshot:
        known = {entry.document.name: entry.document for entry in snapshot.documents()}
    shutil.rmtree(takes / "walk")
    (takes / "walk").mkdir()

    def refused(_):
        raise PermissionError

    monkeypatch.setattr(os, "scandir", refused)
    assert gone_documents(known) == ([], {takes / "walk": 3})


def test_a_folder_that_can_not_be_listed_stops_the_run_or_is_passed_over(
    takes, tmp_path, monkeypatch
):
    store, scandir = tmp_path / "s.store", os.scandir
    index_files([takes], store)

    def refusing(folder):
        if str(folder).endswith("walk"):
            raise PermissionError(errno.EACCES, "Permission denied")
        return scandir(folder)

    monkeypatch.setattr(os, "scandir", refusing)
    with pytest.raises(FormatError, match=r"walk: can't be listed \(permission denied\)"):
        index_files([takes], store)
    summary = index_files([takes], store, IndexOptions(skip_bad=True, prune=True))
    assert (summary.unchanged, summary.removed, len(summary.refused)) == (6, 0, 1)
    assert len(names(store)) == 9


def test_a_damaged_segment_file_puts_off_the_merge_alone(takes, tmp_path, monkeypatch, mocapidx):
    monkeypatch.setattr(index_task, "MOST_SEGMENT_FILES", 2)
    store, clips = tmp_path / "s.store", sorted((takes / "squat").glob("*.amc"))
    for clip in clips[:2]:
        index_files([clip], store, IndexOptions(root=takes))
    flip = store / "segments/000001.h5"
    data = bytearray(flip.read_bytes())
    data[len(data) // 2] ^= 1
    flip.write_bytes(data)
    summary = index_files([clips[2]], store, IndexOptions(root=takes))
    assert summary.added == 1
    assert "000001.h5: damaged" in summary.not_merged
    assert len(names(store)) == 3


def test_a_bad_file_stops_the_run_or_is_passed_over(takes, tmp_path):
    store = tmp_path / "s.store"
    (takes / "walk" / "bad.bvh").write_text("no motion")
    with pytest.raises(FormatError, match=r"bad\.bvh.*--skip-bad"):
        index_files([takes], store)
    summary = index_files([takes], store, IndexOptions(skip_bad=True))
    assert summary.added == 9
    assert [refused.name for refused in summary.refused] == ["walk/bad.bvh"]


@pytest.mark.parametrize("jobs", [1, 3])
def test_any_number_of_workers_gives_the_same_bytes(takes, tmp_path, jobs, monkeypatch):
    monkeypatch.setattr(index_task, "JOBS_PER_WORKER", 1)
    stores = [tmp_path / "one.store", tmp_path / "other.store"]
    for store, workers in zip(stores, (1, jobs), strict=True):
        index_files([takes], store, IndexOptions(jobs=workers, batch_bytes=100_000))
    assert contents(stores[0]) == contents(stores[1])


def test_runs_that_are_interrupted_end_in_the_bytes_of_a_clean_run(takes, tmp_path):
    options = IndexOptions(batch_bytes=50_000)
    index_files([takes], tmp_path / "clean.store", options)
    assert len(list((tmp_path / "clean.store" / "segments").iterdir())) > 4
    for stop in range(1, 9):

        def progress(step, stop=stop):
            if step.done == stop:
                raise Interrupted(signal.SIGTERM)

        with pytest.raises(Interrupted, match="run again to continue"):
            index_files([takes], tmp_path / "cut.store", options, progress=progress)
        index_files([takes], tmp_path / "cut.store", options)
        assert contents(tmp_path / "cut.store") == contents(tmp_path / "clean.store")
        shutil.rmtree(tmp_path / "cut.store")


def test_many_small_segment_files_are_merged(takes, tmp_path, monkeypatch):
    monkeypatch.setattr(index_task, "MOST_SEGMENT_FILES", 3)
    store = tmp_path / "s.store"
    for clip in sorted(takes.rglob("*.amc")):
        index_files([clip], store, IndexOptions(root=takes))
    with open_store(store) as snapshot:
        assert len(snapshot.files) <= 4
    assert sorted(names(store)) == sorted(
        str(clip.relative_to(takes)) for clip in takes.rglob("*.amc")
    )


def test_compact_keeps_documents_and_answers(takes, tmp_path):
    store = tmp_path / "s.store"
    index_files([takes], store, IndexOptions(batch_bytes=100_000))
    example = str(sorted((takes / "squat").glob("*.amc"))[0])
    before = query_store(store, example, select="F20,F21")
    assert compact_store(store)[1] == 1
    assert query_store(store, example, select="F20,F21") == before
    assert compact_store(store) == (1, 1)


def test_names_are_paths_below_the_input_or_the_root(takes, tmp_path):
    clip = sorted((takes / "squat").glob("*.amc"))[0]
    for inputs, root, expected in (
        ([clip], None, clip.name),
        ([takes / "squat"], None, clip.name),
        ([takes], None, f"squat/{clip.name}"),
        ([clip], tmp_path, f"takes/squat/{clip.name}"),
    ):
        store = tmp_path / "s.store"
        index_files(inputs, store, IndexOptions(root=root))
        assert expected in names(store)
        shutil.rmtree(store)


def test_two_files_with_one_name_are_an_error_that_shows_both(takes, tmp_path):
    clip = sorted((takes / "squat").glob("*.amc"))[0]
    twin = takes / "walk" / clip.name
    shutil.copyfile(clip, twin)
    with pytest.raises(ParameterError, match=clip.name) as caught:
        index_files([clip, twin], tmp_path / "s.store")
    assert str(clip) in str(caught.value)
    assert str(twin) in str(caught.value)


def test_wrong_inputs_are_refused_before_a_store_is_made(takes, tmp_path):
    store = tmp_path / "s.store"
    with pytest.raises(ParameterError, match="no such file"):
        index_files([tmp_path / "nowhere"], store)
    (takes / "notes.txt").write_text("notes")
    with pytest.raises(FormatError, match=r"notes\.txt"):
        index_files([takes / "notes.txt"], store)
    with pytest.raises(ParameterError, match="root"):
        index_files([takes], store, IndexOptions(root=takes / "walk"))
    assert not store.exists()
    assert index_files([takes], store).passed_over == 1


def test_links_to_files_are_read_and_links_to_folders_are_not_followed(takes, tmp_path):
    folder = tmp_path / "links"
    folder.mkdir()
    for skeleton in takes.glob("*.asf"):
        shutil.copy2(skeleton, folder)
    clip = sorted((takes / "squat").glob("*.amc"))[0]
    (folder / clip.name).symlink_to(clip)
    (folder / "loop").symlink_to(folder)
    index_files([folder], tmp_path / "s.store")
    assert names(tmp_path / "s.store") == [clip.name]


def test_a_pipe_named_as_a_motion_is_refused_at_once(takes, tmp_path):
    os.mkfifo(takes / "pipe.bvh")
    summary = index_files([takes], tmp_path / "s.store", IndexOptions(skip_bad=True))
    assert [refused.name for refused in summary.refused] == ["pipe.bvh"]


def test_another_feature_set_or_rate_is_refused_with_advice(takes, tmp_path):
    store = tmp_path / "s.store"
    index_files([takes], store)
    with pytest.raises((ParameterError, StoreError), match="rate"):
        index_files([takes], store, IndexOptions(rate=60.0))


def test_a_store_says_itself_what_its_rate_and_features_are(takes, tmp_path):
    store = tmp_path / "s.store"
    first = IndexOptions(rate=60.0, feature_set="f31", poses=False)
    index_files([takes / "walk"], store, replace(first, read=skeleton_of(takes)))
    index_files([takes / "squat"], store, IndexOptions(read=skeleton_of(takes)))
    index_files(
        [takes / "walk", takes / "squat"],
        tmp_path / "once.store",
        replace(first, read=skeleton_of(takes)),
    )
    compact_store(store)
    with open_store(store) as one, open_store(tmp_path / "once.store") as other:
        assert one.manifest.settings == other.manifest.settings
        assert one.manifest.settings.rate == 60
    assert sorted(names(store)) == sorted(names(tmp_path / "once.store"))


def test_a_store_that_keeps_poses_goes_on_keeping_them(takes, tmp_path):
    store = tmp_path / "s.store"
    index_files([takes], store)
    with pytest.raises(ParameterError, match="leave --no-poses out"):
        index_files([takes], store, IndexOptions(poses=False))


def test_the_summary_counts_minutes_at_the_rate_of_the_store(takes, tmp_path):
    summary = index_files([takes], tmp_path / "s.store", IndexOptions(rate=60.0))
    usual = index_files([takes], tmp_path / "t.store")
    assert (summary.rate, usual.rate) == (60.0, 30.0)
    assert summary.frames / 60 == pytest.approx(usual.frames / 30, rel=0.02)


def test_a_file_under_two_names_is_reported(takes, tmp_path, mocapidx):
    store = tmp_path / "s.store"
    assert index_files([takes], store).doubled == []
    again = index_files([takes / "walk"], store).doubled
    assert len(again) == 3
    assert all(first == f"walk/{second}" for first, second in again)
    done = mocapidx("index", takes, takes / "squat", "--store", tmp_path / "t.store")
    assert "3 files in the store under two names, such as 'ann_squat" in done.stderr
    assert "and 'squat/ann_squat" in done.stderr
    assert "--root" in done.stderr


def test_what_is_hidden_in_a_folder_is_left_alone(takes, tmp_path):
    (takes / "._walk.bvh").write_bytes(b"\0\5\26\7")
    (takes / ".trash").mkdir()
    shutil.copy2(next((takes / "walk").glob("*.amc")), takes / ".trash")
    summary = index_files([takes], tmp_path / "s.store")
    assert (summary.added, summary.passed_over) == (9, 0)


def skeleton_of(takes):
    return ReadOptions(skeleton=sorted(takes.glob("*.asf"))[0])


def test_odd_names_never_reach_a_terminal_raw(takes, tmp_path, mocapidx):
    clip = sorted((takes / "squat").glob("*.amc"))[0]
    odd = takes / "squat" / f"{clip.stem[:3]}_\x1b[31mred\n_120.amc"
    shutil.copyfile(clip, odd)
    (takes / "bad\x1b[2J.bvh").write_text("no motion")
    store = tmp_path / "s.store"
    done = mocapidx("index", takes, "--store", store, "--skip-bad")
    assert done.returncode == 5
    assert "\x1b" not in done.stderr
    assert done.stderr.count("\n") == 2
    for form in ("table", "csv", "jsonl"):
        done = mocapidx("query", store, "--example", clip, "--select", "F20", "--format", form)
        assert done.returncode == 0
        assert "\x1b" not in done.stdout
        assert "red" in done.stdout


def test_a_second_writer_is_told_who_writes(takes, tmp_path, mocapidx):
    store = tmp_path / "s.store"
    index_files([takes], store)
    with writing(store, command="index"):
        done = mocapidx("index", takes, "--store", store)
        assert done.returncode == LockedError.exit_code
        assert "is being written by" in done.stderr
        assert done.stderr.count("\n") == 1
        assert mocapidx("info", store).returncode == 0  # readers wait for nobody
    assert mocapidx("index", takes, "--store", store).returncode == 0


def test_a_full_disk_leaves_the_store_as_it_was(takes, tmp_path):
    store = tmp_path / "s.store"
    index_files([takes / "walk"], store)
    before = contents(store)

    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))

    done = subprocess.run(
        [PROGRAM, "index", takes, "--store", store],
        capture_output=True,
        text=True,
        timeout=60,
        preexec_fn=small_files,
    )
    assert done.returncode == WriteError.exit_code
    assert "no space left" in done.stderr
    assert "3 documents" in done.stderr
    assert done.stderr.count("\n") == 1
    assert contents(store) == before


def test_a_run_that_is_killed_anywhere_is_finished_by_the_next(takes, tmp_path):
    index_files([takes], tmp_path / "clean.store")
    rng = np.random.default_rng(2005)
    store = tmp_path / "s.store"
    for delay in rng.uniform(0.2, 0.9, 8):
        process = subprocess.Popen(
            [PROGRAM, "index", takes, "--store", store, "--jobs", "1"], stderr=subprocess.DEVNULL
        )
        try:
            process.wait(delay)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if (store / "MANIFEST").exists():
            assert set(names(store)) <= set(names(tmp_path / "clean.store"))
    index_files([takes], store)
    assert contents(store) == contents(tmp_path / "clean.store")


def test_limits_and_ways_to_say_where_a_skeleton_is_change_nothing(takes, tmp_path, monkeypatch):
    store = tmp_path / "s.store"
    skeleton = sorted(takes.glob("*.asf"))[0]
    first = IndexOptions(read=ReadOptions(skeleton=skeleton, source_rate=120.0))
    assert index_files([takes], store, first).added == 9
    monkeypatch.chdir(takes)
    limits = Limits(max_frames=99_999)
    told = ReadOptions(skeleton=Path(skeleton.name), source_rate=120.0, limits=limits)
    assert index_files(["."], store, IndexOptions(read=told)).unchanged == 9


def test_a_joint_map_that_has_changed_reads_the_files_again(tmp_path):
    (tmp_path / "takes").mkdir()
    (tmp_path / "takes" / "a.bvh").write_text(bvh_text(PERSON, person_rows(8)))
    joint_map = tmp_path / "map.toml"
    shipped = Path(index_task.__file__).parents[1] / "skeleton" / "maps" / "humanik.toml"
    joint_map.write_bytes(shipped.read_bytes())
    options = IndexOptions(read=ReadOptions(joint_map=joint_map))
    for text, changed in ((b"", 0), (b"", 0), (b"# more\n", 1), (b"", 0)):
        joint_map.write_bytes(joint_map.read_bytes() + text)
        assert index_files([tmp_path / "takes"], tmp_path / "s.store", options).changed == changed


def test_a_take_that_grows_beyond_the_limit_at_the_rate_of_the_store_is_refused(tmp_path):
    take = tmp_path / "a.bvh"
    take.write_text(bvh_text(PERSON, person_rows(31), frame_time="0.1"))
    limited = ReadOptions(limits=Limits(max_frames=90))
    with pytest.raises(FormatError, match="more than 90 frames; --max-frames"):
        index_files([take], tmp_path / "s.store", IndexOptions(read=limited))
    index_files([take], tmp_path / "s.store", IndexOptions(read=limited, rate=10.0))


def test_another_working_directory_or_a_detour_changes_nothing(takes, tmp_path, monkeypatch):
    index_files([takes], tmp_path / "s.store")
    for folder, given, store in (
        (tmp_path, "takes", "s.store"),
        (takes, ".", "../s.store"),
        (takes / "walk", "../../takes/squat/..", "../../s.store"),
    ):
        monkeypatch.chdir(folder)
        assert index_files([given], store).unchanged == 9


def test_a_file_given_twice_or_beside_its_folder_is_one_document(takes, tmp_path):
    clip = sorted((takes / "squat").glob("*.amc"))[0]
    options = IndexOptions(root=takes)
    assert index_files([takes, takes, clip, clip], tmp_path / "s.store", options).added == 9


def test_a_store_among_its_takes_is_passed_over(takes):
    store = takes / "in.store"
    assert index_files([takes], store).added == 9
    assert index_files([takes], store).unchanged == 9


def test_a_file_that_goes_away_before_its_turn_is_refused(takes, tmp_path):
    victim = sorted((takes / "walk").glob("*.amc"))[-1]

    def losing(function, items):
        for item in items:
            victim.unlink(missing_ok=True)
            yield function(item)

    options = IndexOptions(skip_bad=True)
    summary = index_files([takes], tmp_path / "s.store", options, map_fn=losing)
    assert [refused.name for refused in summary.refused] == [f"walk/{victim.name}"]
    assert "no such file" in summary.refused[0].message
    assert summary.added == 8


def test_a_file_that_is_written_while_it_is_read_is_refused(takes, tmp_path, monkeypatch):
    victim = sorted((takes / "walk").glob("*.amc"))[-1]
    read_take = prepare_task.read_take

    def growing(path, options, rate):
        reading = read_take(path, options, rate)
        if path == victim:
            os.utime(path, ns=(1, 1))
        return reading

    monkeypatch.setattr(prepare_task, "read_take", growing)
    options = IndexOptions(skip_bad=True)
    (refused,) = index_files([takes], tmp_path / "s.store", options).refused
    assert "changed while it was read" in refused.message
    monkeypatch.undo()
    assert index_files([takes], tmp_path / "s.store", options).added == 1


def marked(mark):
    """Processes that were started with a mark in their environment, and their children."""
    found = []
    for folder in Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            if folder.name.isdigit() and mark in (folder / "environ").read_bytes():
                found.append(folder.name)
    return found


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc")
def test_workers_end_with_a_run_that_is_killed(takes, tmp_path):
    mark = f"MARK={tmp_path.name}-{os.getpid()}"
    with subprocess.Popen(
        [PROGRAM, "index", takes, "--store", tmp_path / "s.store", "--jobs", "2"],
        stderr=subprocess.DEVNULL,
        env=os.environ | dict([mark.split("=")]),
    ) as process:
        deadline = time.monotonic() + 30
        while len(marked(mark.encode())) < 4 and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.kill()
    while marked(mark.encode()):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert index_files([takes], tmp_path / "s.store").added in (0, 9)
