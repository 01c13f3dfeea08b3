"""The same motion in every format: read alike, indexed, found; gaps; doctor."""

import json
import shutil

import numpy as np
import pytest

from mocapidx.errors import FormatError, ParameterError
from mocapidx.features.extract import extract_features, untrusted_features
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.store.read import open_store
from mocapidx.tasks.annotate import AnnotateOptions, annotate_motion
from mocapidx.tasks.doctor import examination_lines, examination_record, examine, examine_file
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.learn import LearnOptions, find_labels, learn_classes
from mocapidx.tasks.query import query_store
from mocapidx.tasks.read import ReadOptions, read_motion, read_take
from mocapidx.tasks.skeleton_report import skeleton_report
from mocapidx.tasks.unspecified import unspecified_in
from tests.made_points import c3d_bytes, markers_of, trc_text

COCO = {
    f"{side}_{name}": side[0] + name
    for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    for side in ("left", "right")
}
COCO_NAMES = ["nose", "left_eye", "right_eye", "left_ear", "right_ear", *COCO]


@pytest.fixture(scope="module")
def clip(fixtures_dir):
    return fixtures_dir / "clips" / "walk" / "ann_walk_001_120.amc"


@pytest.fixture(scope="module")
def formats(clip, tmp_path_factory):
    """One clip as AMC, C3D, TRC, CSV, npz, npy and JSON."""
    folder = tmp_path_factory.mktemp("formats")
    shutil.copy(clip, folder / "walk_120.amc")
    shutil.copy(clip.parent.parent / "ann.asf", folder / "walk.asf")
    motion = read_motion(clip)
    write_all(folder, motion.positions, motion.rate)
    return folder


def write_all(folder, positions, rate):
    names, markers = markers_of(CANONICAL_JOINTS, positions)
    z_up = markers[..., [0, 2, 1]] * [1000, -1000, 1000]
    (folder / "walk.c3d").write_bytes(c3d_bytes([f"Ann:{n}" for n in names], z_up, rate))
    (folder / "walk.trc").write_text(trc_text(names, 1000 * markers, rate))
    header = ",".join(f"{j}.{a}" for j in CANONICAL_JOINTS for a in "xyz")
    rows = [",".join(map(repr, row)) for row in positions.reshape(len(positions), -1).tolist()]
    times = [f"{frame / rate:.6f}," for frame in range(len(rows))]
    table = "\n".join([f"time,{header}", *map(str.__add__, times, rows)])
    (folder / "walk.csv").write_text(table.replace("nan", ""))
    np.savez(folder / "walk.npz", positions=positions, joints=CANONICAL_JOINTS, rate=rate)
    np.save(folder / "walk_120.npy", positions)
    (folder / "walk_120.joints.txt").write_text("\n".join(CANONICAL_JOINTS))
    points = np.stack([positions[:, INDEX[COCO.get(n, "head")]] for n in COCO_NAMES], axis=1)
    table = {"rate": rate, "frames": points.round(5).tolist()}
    (folder / "walk.json").write_text(json.dumps(table).replace("NaN", "null"))


KINDS = ("c3d", "trc", "csv", "npz", "npy", "json")


def path_of(folder, kind):
    return folder / ("walk_120.npy" if kind == "npy" else f"walk.{kind}")


@pytest.mark.parametrize("kind", KINDS)
def test_every_format_has_nearly_the_same_feature_words(formats, kind):
    expected = extract_features(read_motion(formats / "walk_120.amc"))
    motion = read_motion(path_of(formats, kind))
    untrusted = untrusted_features(motion, "f39")
    trusted = [i for i in range(39) if not untrusted >> i & 1]
    assert len(trusted) == (18 if kind == "json" else 39)
    same = extract_features(motion)[:, trusted] == expected[:, trusted]
    # markers give another root, and lengths come from the motion, not the zero pose
    assert same.mean() > 0.97


def test_all_of_them_are_indexed_and_found(formats, tmp_path):
    store = tmp_path / "formats.store"
    summary = index_files([formats], store)
    assert (summary.added, summary.passed_over) == (7, 1)  # the list of joints is no motion
    again = index_files([formats], store)
    assert (again.added, again.changed, again.unchanged) == (0, 0, 7)
    found = query_store(store, f"{formats}/walk.c3d@0.3:1", select="F25,F26,F20")
    assert {hit.document for hit in found.hits} >= {
        "walk.c3d", "walk.trc", "walk.csv", "walk.npz", "walk_120.npy", "walk_120.amc",
    }  # fmt: skip


def holed(positions, joint, frames):
    positions = positions.copy()
    positions[frames, INDEX[joint]] = np.nan
    return positions


def test_short_gaps_are_filled_and_long_ones_left_open(clip, tmp_path):
    motion = read_motion(clip)
    positions = holed(motion.positions, "rankle", slice(30, 50))
    positions = holed(positions, "lwrist", slice(60, 100))
    np.savez(tmp_path / "x.npz", positions=positions, joints=CANONICAL_JOINTS, rate=120)
    reading = read_take(tmp_path / "x.npz")
    assert (reading.gaps.filled, reading.gaps.left, reading.gaps.left_frames) == (1, 1, 40)
    found = reading.motion.positions
    np.testing.assert_allclose(
        found[30:50, INDEX["rankle"]], motion.positions[30:50, INDEX["rankle"]], atol=0.05
    )
    assert np.isnan(found[60:100, INDEX["lwrist"]]).all()
    longer = read_take(tmp_path / "x.npz", ReadOptions(fill_gaps=0.5)).gaps
    assert (longer.filled, longer.left) == (2, 0)
    with pytest.raises(ParameterError, match="gaps to fill"):
        ReadOptions(fill_gaps=-1)


def test_no_hit_goes_across_a_gap_in_what_is_asked_for(clip, tmp_path):
    motion = read_motion(clip)
    folder = tmp_path / "takes"
    folder.mkdir()
    options = {"joints": CANONICAL_JOINTS, "rate": 120}
    np.savez(folder / "whole.npz", positions=motion.positions, **options)
    gap = slice(48, 120)  # 0.4 to 1.0 s
    np.savez(folder / "holed.npz", positions=holed(motion.positions, "rankle", gap), **options)
    store = tmp_path / "x.store"
    summary = index_files([folder], store)
    assert (summary.gaps_filled, summary.gaps_left) == (0, 1)
    with open_store(store) as snapshot:
        documents = {p.document.name: p.document for p in snapshot.documents()}
    assert unspecified_in(documents["whole.npz"]) == ()
    assert unspecified_in(documents["holed.npz"])[0][:2] == (11, 12)  # velocities one earlier

    def hits(select):
        found = query_store(store, f"{folder}/whole.npz@0.2:0.9", select=select).hits
        across = (hit for hit in found if hit.start_frame < 30 and hit.end_frame > 12)
        return {hit.document for hit in across}

    assert hits("F15,F26") == {"whole.npz"}
    assert hits("F13,F14") == {"whole.npz", "holed.npz"}  # hands are seen throughout


def test_templates_compare_what_is_known_in_a_gap(fixtures_dir, fixtures_store, clip, tmp_path):
    labels = find_labels(fixtures_store, fixtures_dir / "labels.csv")
    learned = learn_classes(fixtures_store, labels, LearnOptions(classes=("walk",)))
    motion = read_motion(clip)
    positions = holed(motion.positions, "lwrist", slice(40, 110))
    np.savez(
        tmp_path / "x.npz", positions=positions, joints=CANONICAL_JOINTS, rate=120,
    )  # fmt: skip
    for method in ("path", "hits"):
        options = AnnotateOptions(method=method)
        annotated = annotate_motion([tmp_path / "x.npz"], learned.templates, options)
        spans = [(a.hit.start_frame, a.hit.end_frame) for a in annotated.annotations]
        assert annotated.documents == 1
        assert all(0 <= start < end <= annotated.frames for start, end in spans)


def test_subjects_are_asked_for_where_there_are_several(clip, tmp_path):
    motion = read_motion(clip)
    names, markers = markers_of(CANONICAL_JOINTS, motion.positions[:30])
    both = np.concatenate((markers, markers + 2), axis=1) * 1000
    labels = [f"{who}:{name}" for who in ("Ann", "Bob") for name in names]
    path = tmp_path / "duo.c3d"
    path.write_bytes(c3d_bytes(labels, both, 120.0, up="+Y"))
    with pytest.raises(FormatError, match="'Ann', 'Bob'; name one with --subject"):
        read_motion(path)
    bob = read_motion(path, subject="Bob")
    np.testing.assert_allclose(
        bob.positions[:, INDEX["lknee"]], motion.positions[:30, INDEX["lknee"]] + 2, atol=1e-3
    )


def test_a_file_that_is_wrong_about_up_is_doubted(clip, tmp_path):
    names, markers = markers_of(CANONICAL_JOINTS, read_motion(clip).positions)
    path = tmp_path / "x.c3d"
    path.write_bytes(c3d_bytes(names, 1000 * markers, 120.0, up="+Z"))
    warning = read_take(path).conventions.warnings[0]
    assert warning.startswith("along z, which the file says is up, the body is ")
    assert warning.endswith("--up y?")
    told = read_take(path, ReadOptions(up="y"))
    assert told.conventions.warnings == ()
    assert np.nanmedian(told.motion.positions[:, INDEX["head"], 1]) > 1.2


def test_points_without_a_rate_need_one(clip, tmp_path):
    motion = read_motion(clip)
    np.savez(tmp_path / "x.npz", positions=motion.positions, joints=CANONICAL_JOINTS)
    with pytest.raises(FormatError, match="does not say its frames a second"):
        read_motion(tmp_path / "x.npz")
    assert read_motion(tmp_path / "x.npz", source_rate=50).rate == 50


def test_six_encodings_are_one_motion_with_a_map_of_ones_own(real_data, tmp_path):
    text = """
name = "clusters"
[joints]
root = { mean = ["RPV1", "RPV2", "RPV3"] }
"""
    for side in "LR":
        small = side.lower()
        text += f"""
{small}hip = {{ mean = ["{side}TH1", "{side}TH2"] }}
{small}knee = {{ mean = ["{side}TH3", "{side}SK1"] }}
{small}ankle = "{side}SK3"
{small}toes = "{side}FT1"
"""
    joint_map = tmp_path / "clusters.toml"
    joint_map.write_text(text)
    names = (
        "sgi_real.c3d",
        "DEC_INT.C3D",
        "Dec_real.c3d",
        "pc_int.c3d",
        "pc_real.c3d",
        "sgi_int.c3d",
    )
    motions = [read_motion(real_data / "c3d" / name, joint_map=joint_map) for name in names]
    assert motions[0].positions.shape == (89, 24, 3)
    for motion in motions[1:]:
        np.testing.assert_allclose(motion.positions, motions[0].positions, atol=3e-4)


def test_real_markers_stand_on_the_floor_and_face_their_toes(real_data):
    for name in ("PiG_Motion3_FF.c3d", "PlugInC3D.c3d", "sample21.c3d"):
        reading = read_take(real_data / "c3d" / name)
        feet = reading.motion.positions[:, [INDEX["rankle"], INDEX["rtoes"]], 1]
        assert 0.0 < np.nanpercentile(feet, 5) < 0.15, name
        assert (
            "1.00" in reading.conventions.evidence[2] or "0.99" in reading.conventions.evidence[2]
        )
        assert not reading.conventions.warnings
    for name in ("walk_free_01", "gait10dof18musc_walk_CRLF_line_ending"):
        motion = read_motion(real_data / "trc" / f"{name}.trc")
        assert 1.5 < np.nanmedian(motion.positions[:, INDEX["headtop"], 1]) < 2.0


def test_the_skeleton_of_markers_shows_formulas_gaps_and_points(formats):
    report = skeleton_report(formats / "walk.c3d")
    rows = {row.joint: row for row in report.segments}
    assert rows["chest"].node == "mean(C7, STRN, T10)"
    assert rows["lknee"].state == "real"
    points = {row.name: row for row in report.points}
    assert points["Ann:LKNE"].joints == ("lknee",)
    assert points["Ann:LKNE"].seen == 1


def test_doctor_tells_of_one_file_and_of_a_folder(clip, tmp_path):
    motion = read_motion(clip)
    positions = holed(motion.positions, "rwrist", slice(60, 100))
    positions[30, INDEX["head"]] += 0.6
    knees = [INDEX["lknee"], INDEX["rknee"]]
    positions[70:, knees] = positions[70:, knees[::-1]]
    folder = tmp_path / "takes"
    folder.mkdir()
    np.savez(folder / "odd.npz", positions=positions, joints=CANONICAL_JOINTS, rate=120)
    (folder / "Empty.c3d").write_bytes(b"")
    found = examine_file(folder / "odd.npz")
    lines = "\n".join(examination_lines(found))
    assert "jumps: 2: head at 0.25 s (frame 30), head at 0.26 s (frame 31)" in lines
    assert "sides exchanged: 1: lknee at 0.58 s (frame 70)" in lines
    assert "gaps: 0 filled (0 frames), 1 left open (40 frames), the longest of 0.33 s" in lines
    assert "features open in gaps: F1, F3, F5" in lines
    records = [examination_record(each) for each in examine([folder])]
    assert [record["document"] for record in records] == ["Empty.c3d", "odd.npz"]
    assert records[0]["problem"] == "not a C3D file: it is empty"
    assert (records[1]["jumps"], records[1]["exchanges"], records[1]["gaps_left"]) == (2, 1, 1)


def test_doctor_on_the_command_line(formats, tmp_path, mocapidx):
    folder = tmp_path / "takes"
    folder.mkdir()
    shutil.copy(formats / "walk.c3d", folder)
    good = mocapidx("doctor", folder, "--format", "csv")
    assert good.returncode == 0, good.stderr
    assert good.stdout.splitlines()[1].startswith("walk.c3d,c3d,plug-in-gait,")
    (folder / "broken.trc").write_text("nothing")
    bad = mocapidx("doctor", folder, "--format", "jsonl")
    assert bad.returncode == 5
    assert "not a TRC file" in json.loads(bad.stdout.splitlines()[0])["problem"]
    one = mocapidx("doctor", folder / "broken.trc")
    assert one.returncode == 3
    assert len(one.stderr.splitlines()) == 1
    alone = mocapidx("doctor", folder / "walk.c3d")
    assert alone.returncode == 0
    assert "joint map: plug-in-gait" in alone.stdout


def test_indexing_again_reads_nothing_where_only_defaults_are_told(formats, tmp_path):
    store = tmp_path / "x.store"
    index_files([formats / "walk.trc"], store)
    with open_store(store) as snapshot:
        options = snapshot.documents()[0].document.rig["options"]
    assert "subject" not in options  # stores from before these options are still up to date
    other = IndexOptions(read=ReadOptions(fill_gaps=0.5))
    assert index_files([formats / "walk.trc"], store, other).changed == 1
