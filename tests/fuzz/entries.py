"""Where fuzzing guided by coverage goes in: bytes to every reader of files that strangers write.

A reader may refuse what it gets by an error of mocapidx with one line. Whatever else comes out is a
finding: another exception, a warning, or an answer that depends on how the file was read.
"""

import codecs
import contextlib
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path

import numpy as np

from mocapidx.errors import FormatError, MocapidxError
from mocapidx.formats import amc, amc_frames, asf, bvh, cells
from mocapidx.formats import text as whole_text
from mocapidx.formats.registry import read_recording
from mocapidx.formats.slice_c3d import c3d_frames
from mocapidx.formats.slice_text import amc_frames as frames_of_amc
from mocapidx.formats.slice_text import bvh_frames
from mocapidx.formats.text import Limits
from mocapidx.kernels.choice import compiled
from mocapidx.model import Recording
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from tests.fuzz import text_readers
from tests.naive_numbers import rows_of
from tests.small_files import AMC, ASF

__all__ = ["CORPUS", "ENTRIES", "NUMBERS", "Entry", "judge", "replay"]

CORPUS = Path(__file__).parents[2] / "fixtures/corpus"
HOSTILE = CORPUS.with_name("hostile")
FRAMES = {".bvh": bvh_frames, ".amc": frames_of_amc, ".c3d": c3d_frames}
UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
LONGEST = 1500  # characters of a message
PIECE = 96  # bytes read at a time, so that what is small has some borders between pieces
BONES = (b"root", b"thigh", b"a")
COUNTS = (3, 2, 1)  # numbers of each


@dataclass(frozen=True)
class Entry:
    """A place where bytes go in.

    Every one of `readers` gets the bytes and a folder to work in; `words` are what such files are
    made of; `kinds` are the folders of files in ``fixtures/hostile`` that once broke a reader.
    """

    readers: tuple[Callable[[bytes, Path], object], ...]
    words: str
    kinds: tuple[str, ...] = ()


def judge(name, data, folder):
    """Give bytes to all readers of an entry; AssertionError, or another one, is a finding."""
    for reader in ENTRIES[name].readers:
        message = refusal(reader, data, folder)
        assert message.isprintable(), message
        assert len(message) <= LONGEST, message


def refusal(read, *given):
    """The message by which something is refused, or nothing."""
    try:
        read(*given)
    except MocapidxError as exc:
        return str(exc)
    return ""


def replay(name, folder):
    """Read all files that are kept of an entry."""
    folders = [CORPUS / name, *(HOSTILE / kind for kind in ENTRIES[name].kinds)]
    for path in sorted(path for each in folders for path in each.iterdir()):
        try:
            judge(name, path.read_bytes(), folder)
        except Exception as exc:
            exc.add_note(f"while reading {path}")
            raise


def no_kernel(name):
    return None


SMALL = (
    (bvh, "compiled", no_kernel), (amc_frames, "compiled", no_kernel), (bvh, "BLOCK", PIECE),
    (amc, "BLOCK", PIECE), (cells, "BLOCK", PIECE), (whole_text, "CHUNK", PIECE),
)  # fmt: skip


def motion(place, beside=None):
    """Read motion in two ways, and what can be cut into stretches by its stretches too."""

    def read(data, folder):
        path = written(folder / place, data)
        take, skeleton = path, None
        if beside is not None:
            name, its_text = beside
            other = folder / name
            if not other.exists():
                other.write_text(its_text)
            # What is known of files of the same size and time is kept: these have both.
            asf._read_asf.cache_clear()
            take, skeleton = (other, path) if path.suffix == ".asf" else (path, other)
        bvh._rig_of.cache_clear()
        recording, outcome = read_so(take, skeleton)
        with in_small_pieces():
            _, other_outcome = read_so(take, skeleton)
        # Where text ends to be UTF-16 shows earlier or later than what else is wrong with it.
        if not data.startswith(UTF_16):
            assert outcome == other_outcome, f"{outcome!r} and in small pieces {other_outcome!r}"
        if recording is None:
            raise FormatError(outcome)
        if take.suffix in FRAMES:
            compare_stretches(take, skeleton, recording)

    return read


def written(path, data):
    if not path.parent.exists():
        path.parent.mkdir(parents=True)
    path.write_bytes(data)
    return path


def read_so(take, skeleton):
    """Read motion; give the recording, if any, and what it holds or why it is refused."""
    try:
        recording = read_recording(take, skeleton_path=skeleton)
    except MocapidxError as exc:
        return None, str(exc)
    return recording, facts(recording)


@contextlib.contextmanager
def in_small_pieces():
    """Let readers use NumPy in place of the compiled scanner, and take a few bytes at a time."""
    before = [(module, name, getattr(module, name)) for module, name, _ in SMALL]
    for each in SMALL:
        setattr(*each)
    try:
        yield
    finally:
        for each in before:
            setattr(*each)


def facts(value):
    """What a recording holds, to the last bit."""
    if is_dataclass(value):
        return tuple((field.name, facts(getattr(value, field.name))) for field in fields(value))
    if isinstance(value, np.ndarray):
        return str(value.dtype), value.shape, value.tobytes()
    return value


def compare_stretches(take, skeleton, recording):
    """What can be read can be cut, and the last frames cut out are the last of the whole."""
    numbers = numbers_of(recording)
    middle = len(numbers) // 2
    if not np.isfinite(numbers[middle:]).any():
        middle = 0
    try:
        frames = FRAMES[take.suffix](take, Limits())
        assert len(frames) == len(numbers), (len(frames), len(numbers))
        part = written(take.with_name(f"part{take.suffix}"), frames.cut(middle, len(frames)))
        cut = read_recording(part, skeleton_path=skeleton)
    except MocapidxError as exc:
        raise AssertionError(f"read, but not cut: {exc}") from exc
    # A point that was seen before may not be seen any more, and is left out then.
    if take.suffix != ".c3d" or cut.names == recording.names:
        np.testing.assert_array_equal(numbers_of(cut), numbers[middle:])


def numbers_of(recording):
    return recording.values if isinstance(recording, Recording) else recording.positions


def text(place, *names):
    """Readers of a text by the names that they have in `tests.fuzz.text_readers`."""

    def reader(name):
        read = getattr(text_readers, name)
        return lambda data, folder: read(written(folder / place, data))

    return tuple(map(reader, names))


def npy(data, folder):
    names = folder / "joints.txt"
    if not names.exists():
        names.write_text("\n".join(CANONICAL_JOINTS))
    read_recording(written(folder / "take.npy", data), skeleton_path=names)


def scanned_rows(data, folder):
    """The rows that the scanner finds in a text are those that Python finds."""
    kernel = compiled("text")
    if kernel is None or len(data) < 2:
        return
    width, room, lines = data[0] % 5 + 1, data[1] % 9, data[2:]
    values = np.full((room, width), np.nan)
    targets = np.arange(width)[::-1].copy()
    read, at, ends = kernel.read_rows(lines, 0, targets, np.full(width, 0.5), values, 0)
    expected = list(rows_of(lines, width))[:room]
    assert values[:read, ::-1].tolist() == [[0.5 * number for number in row] for row in expected]
    assert 0 <= at <= len(lines)
    assert ends == lines.count(b"\n", 0, at)


def scanned_frames(data, folder):
    """The scanner of frames stays within its text and its arrays."""
    kernel = compiled("text")
    if kernel is None or len(data) < 2:
        return
    first, room, lines = data[0] % 3, data[1] % 9, data[2:]
    values = np.full((room, sum(COUNTS)), np.nan)
    bounds = [np.cumsum([0, *sizes]) for sizes in (list(map(len, BONES)), COUNTS)]
    order = np.arange(sum(COUNTS))
    read, at, ends = kernel.read_frames(
        lines, 0, first, b"".join(BONES), *bounds, order, np.ones(len(order)), values, 0
    )
    assert np.isfinite(values[:read]).all()
    assert 0 <= at <= len(lines)
    assert ends == lines.count(b"\n", 0, at)


NUMBERS = (
    "0 1 -1 -0 1e999 1e-320 nan -inf 1_0 0x10 9007199254740993 1.5e-015 99999999 1e22 1e-23 "
    "18446744073709551617 98765432109876543210987 .0000000000000000000000000000001"
)

ENTRIES = {
    "scanner": Entry((scanned_rows, scanned_frames), "root thigh a"),
    "bvh": Entry(
        (motion("take.bvh"),),
        "HIERARCHY ROOT JOINT End Site { } OFFSET CHANNELS Xposition Yposition Zposition Xrotation "
        "Yrotation Zrotation MOTION Frames: Frame Time:",
        ("bvh",),
    ),
    "amc": Entry(
        (motion("take.amc", ("small.asf", ASF)),),
        ":FULLY-SPECIFIED :DEGREES :RADIANS :SAMPLES-PER-SECOND root thigh shank foot #",
        ("amc-small",),
    ),
    "asf": Entry(
        (motion("small.asf", ("take.amc", AMC)),),
        ":version :name :units :documentation :root :bonedata :hierarchy mass length angle deg rad "
        "order axis position orientation begin end id direction dof limits TX RX XYZ ZYX root # "
        "thigh shank foot",
    ),
    "trc": Entry(
        (motion("take.trc"),),
        "PathFileType DataRate CameraRate NumFrames NumMarkers Units mm Frame# Time X1 NaN null",
        ("trc",),
    ),
    "csv": Entry(
        (motion("take.csv"),), 'frame joint x y z time seconds .x _y :z NaN , ; "', ("csv",)
    ),
    "keypoints": Entry(
        (motion("take.json"),),
        '"frames" "joints" "names" "rate" "fps" "people" "keypoints" "keypoints_3d" '
        '"pose_keypoints_3d" "positions" null true NaN Infinity [] {} [[ ]] :',
        ("json",),
    ),
    "transcripts": Entry(
        text("take.txt", "labels", "records", "told_again"),
        "WEBVTT --> 00:00:01.000 00:00:01,000 NOTE STYLE <v </v> &amp; &lt; <!DOCTYPE "
        'ANNOTATION_DOCUMENT TIME_ORDER TIME_SLOT_ID="a" TIME_VALUE="1" TIER TIER_ID="a" '
        "ALIGNABLE_ANNOTATION REF_ANNOTATION ANNOTATION_VALUE "
        '"ooTextFile" "TextGrid" "IntervalTier" "TextTier" <exists> xmin xmax '
        '"frame_ann" "seq_ann" "labels" "proc_label" "raw_label" "start_t" "end_t" "feat_p" null',
    ),
    "tables": Entry(
        text("take.txt", "labels", "records", "told_again"),
        'document label start_time end_time group rank cost "document" "label" "start_time" '
        '"end_time" "rank" "cost" "source_start_frame" "source_end_frame" null true NaN , "" \'=',
        ("records-jsonl",),
    ),
    "toml": Entry(
        text(
            "x.toml", "feature_set", "joint_map", "marker_map", "pattern", "scene", "design",
            "parameters", "settings",
        ),
        "name steps is min max times [[template]] [[template.set]] from as value frames seconds "
        "features delta tau keyframes class [[parameter]] joint axes when what distance facing "
        "[[feature]] [feature-set] true false nan inf \"\"\" ''' { } [ ] = * not",
        ("pattern",),
    ),
    "graphs": Entry(
        (*text("g.json", "graph_again"), *text("g.graphml", "graph_again")),
        '"nodes" "edges" "rate" "document" "start_frame" "cost" "path" <graphml <graph <node id= '
        '<edge source= target= <data key= </data> <key attr.name= <!DOCTYPE <!ENTITY <?xml null',
        ("graphml",),
    ),
    "c3d": Entry(
        (motion("take.c3d"),),
        "POINT ANALOG TRIAL USED SCALE RATE FRAMES LONG_FRAMES LABELS LABELS2 UNITS DATA_START "
        "X_SCREEN Y_SCREEN ACTUAL_START_FIELD ACTUAL_END_FIELD mm",
        ("c3d",),
    ),
    "arrays": Entry(
        (motion("take.npz"), npy),
        "PK poses trans betas mocap_framerate positions joints rate unit up made .npy NUMPY descr "
        "fortran_order shape <f4 >f8 |O <U4 (1, True False",
        ("npz",),
    ),
}  # fmt: skip
