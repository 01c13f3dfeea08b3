"""Every kind of annotation file reads back as it was, by us and by public readers."""

import contextlib
import json
import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mocapidx.errors import FormatError
from mocapidx.transcripts.babel import babel_text
from mocapidx.transcripts.kinds import KINDS, kind_of
from mocapidx.transcripts.spans import NOTHING, Span, Transcript, plain_text, tiers

NASTY = (
    "<script>alert(1)</script>",
    "a\nb\n\nc",
    "tab\there",
    "nul\0",
    "\ud800 lone \udcff",
    "bidi \u202e\u2066",
    "esc \x1b[2J \x9b",
    "=cmd|' /C calc'!A0",
    "../../etc/x",
    "/abs",
    "CON",
    "é" * 150,
    "\ufffe\uffff",
    "00:00:01.000 --> 00:00:02.000",
    'quote " and ""',
    "&lt;&amp;]]>",
    "NOTE",
    "WEBVTT",
    "7",
    "",
    "  ",
    "日本語 Früh",
    "document",
    "walk (2)",
)
OURS = sorted(KINDS)


def written(kind, transcript):
    return babel_text([transcript]) if kind == "babel" else KINDS[kind].write(transcript)


def read(kind, data, stem="stem"):
    assert kind_of(data) is (KINDS[kind] if data else None)
    return KINDS[kind].read(data, "file", stem)


def rows(spans):
    return sorted((span.start, span.end, span.label) for span in spans)


def lines(text):
    """A label as readers give it: one printable line."""
    return " ".join(plain_text(text).split())


@pytest.mark.parametrize("kind", OURS)
@pytest.mark.parametrize("name", NASTY, ids=ascii)
def test_whatever_documents_and_classes_are_called_comes_back(kind, name):
    spans = (Span(0.0, 0.5, "walk"), Span(1.25, 2.0, name), Span(2.0, 3.125, "walk"))
    (found,) = read(kind, written(kind, Transcript(name, spans, 4.0)))
    if kind == "babel":  # JSON holds any text
        assert found.document == name
        assert rows(found.spans)[1] == (1.25, 2.0, " ".join(name.split()))
    else:
        assert found.document == ("stem" if kind == "srt" else plain_text(name))
        assert rows(found.spans)[1] == (1.25, 2.0, lines(name))
    assert [row[2] for row in rows(found.spans)][::2] == ["walk", "walk"]


@pytest.mark.parametrize("kind", OURS)
@given(
    st.lists(
        st.tuples(st.integers(0, 10**6), st.integers(1, 10**5), st.sampled_from("abc")), max_size=12
    )
)
@settings(max_examples=30, deadline=None, suppress_health_check=list(HealthCheck))
def test_spans_come_back_to_the_millisecond_however_they_overlap(kind, given_spans):
    spans = tuple(Span(s / 1000, (s + n) / 1000, label) for s, n, label in given_spans)
    (found,) = read(kind, written(kind, Transcript("d", spans)))
    assert rows(found.spans) == rows(spans)
    assert written(kind, Transcript("d", spans)) == written(kind, Transcript("d", spans))


def test_frames_at_30_hz_come_back_as_the_same_frames():
    spans = tuple(Span(n / 30, (n + 1) / 30, "x") for n in range(0, 3000, 7))
    for kind in OURS:
        (found,) = read(kind, written(kind, Transcript("d", spans)))
        assert [round(span.start * 30) for span in found.spans] == list(range(0, 3000, 7))


def test_what_overlaps_lies_on_tiers_of_its_own():
    spans = [
        Span(0, 2, "a"),
        Span(1, 3, "a"),
        Span(2, 3, "a"),
        Span(0, 1, "a (2)"),
        Span(0, 9, "b"),
    ]
    laid = {
        name: [(s.start, s.end) for s in own]
        for name, own in tiers(Transcript("d", tuple(spans)), taken=["b"])
    }
    assert laid == {
        "a": [(0, 2), (2, 3)],
        "a (2)": [(1, 3)],
        "a (2) (2)": [(0, 1)],
        "b (2)": [(0, 9)],
    }


EXAMPLE = Transcript(
    "takes/ann <1>.amc",
    (
        Span(0.0, 1.5, "walk & run"),
        Span(1.0, 2.25, "walk & run"),
        Span(2.5, 3.0, 'say "hop"'),
        Span(3.0, 4.0, "<script>\n\x1b\udcff\u202e"),
    ),
    5.0,
)
EXPECTED = [
    (0.0, 1.5, "walk & run"),
    (1.0, 2.25, "walk & run"),
    (2.5, 3.0, 'say "hop"'),
    (3.0, 4.0, "<script>\\n\\x1b\\xff\\u202e"),
]


def test_a_public_reader_reads_our_elan_files(tmp_path):
    pympi = pytest.importorskip("pympi")
    path = tmp_path / "a.eaf"
    path.write_bytes(KINDS["eaf"].write(EXAMPLE))
    eaf = pympi.Elan.Eaf(str(path))
    found = [
        (start / 1000, end / 1000, text)
        for tier in eaf.get_tier_names()
        for start, end, text in eaf.get_annotation_data_for_tier(tier)
    ]
    assert sorted(found) == EXPECTED
    assert dict(eaf.properties)["mocapidx-document"] == EXAMPLE.document
    assert set(eaf.get_tier_names()) == {
        *("walk & run", "walk & run (2)", 'say "hop"'),
        "<script>\\n\\x1b\\xff\\u202e",
    }


def test_we_read_elan_files_of_a_public_writer(tmp_path):
    pympi = pytest.importorskip("pympi")
    eaf = pympi.Elan.Eaf(author="x")
    eaf.add_tier("motion")
    for start, end, label in EXPECTED[::2]:
        eaf.add_annotation("motion", int(1000 * start), int(1000 * end), label)
    eaf.to_file(str(tmp_path / "a.eaf"))
    (found,) = read("eaf", (tmp_path / "a.eaf").read_bytes())
    assert rows(found.spans) == EXPECTED[::2]


def test_a_public_reader_reads_our_textgrids(tmp_path):
    praatio = pytest.importorskip("praatio")
    from praatio import textgrid

    path = tmp_path / "a.TextGrid"
    path.write_bytes(KINDS["textgrid"].write(EXAMPLE))
    assert praatio
    grid = textgrid.openTextgrid(str(path), includeEmptyIntervals=False)
    assert grid.tierNames[0] == "document"
    found = [
        (entry.start, entry.end, entry.label)
        for name in grid.tierNames[1:]
        for entry in grid.getTier(name).entries
    ]
    assert sorted(found) == EXPECTED
    assert grid.getTier("document").entries[0].label == EXAMPLE.document
    assert grid.maxTimestamp == 5.0


@pytest.mark.parametrize("form", ["short_textgrid", "long_textgrid"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_we_read_textgrids_of_a_public_writer(tmp_path, form, encoding):
    textgrid = pytest.importorskip("praatio.textgrid")
    grid = textgrid.Textgrid()
    grid.addTier(textgrid.IntervalTier("motion", EXPECTED[::2], 0, 9))
    grid.addTier(textgrid.PointTier("marks", [(1.0, "here")], 0, 9))
    path = tmp_path / "a.TextGrid"
    grid.save(str(path), form, includeBlankSpaces=True)
    data = path.read_text(encoding="utf-8").encode(encoding)
    (found,) = read("textgrid", data)
    assert rows(found.spans) == EXPECTED[::2]
    assert found.remarks == ("file: passed over 'marks', a tier of points",)


def test_public_readers_read_our_captions(tmp_path):
    webvtt, srt = pytest.importorskip("webvtt"), pytest.importorskip("srt")
    path = tmp_path / "a.vtt"
    path.write_bytes(KINDS["vtt"].write(EXAMPLE))
    cues = [(cue.start_in_seconds, cue.end_in_seconds, cue.raw_text) for cue in webvtt.read(path)]
    plain = [(c[2].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")) for c in cues]
    assert plain == [row[2] for row in EXPECTED]
    assert b"<script>" not in path.read_bytes()
    blocks = list(srt.parse(KINDS["srt"].write(EXAMPLE).decode("utf-8")))
    assert [(b.start.total_seconds(), b.end.total_seconds(), b.content) for b in blocks] == EXPECTED
    assert [b.index for b in blocks] == [1, 2, 3, 4]


def test_we_read_captions_of_public_writers(tmp_path):
    webvtt, srt = pytest.importorskip("webvtt"), pytest.importorskip("srt")
    from datetime import timedelta

    vtt = webvtt.WebVTT()
    vtt.captions.append(webvtt.Caption("00:01.000", "01:00:02.500", "<v Ann>hop &amp; run</v>"))
    vtt.save(str(tmp_path / "a.vtt"))
    (found,) = read("vtt", (tmp_path / "a.vtt").read_bytes())
    assert rows(found.spans) == [(1.0, 3602.5, "hop & run")]
    text = srt.compose(
        [srt.Subtitle(1, timedelta(seconds=1), timedelta(seconds=2), "hop\nand run")]
    )
    for end in ("\n", "\r\n"):
        (found,) = read("srt", text.replace("\n", end).encode())
        assert rows(found.spans) == [(1.0, 2.0, "hop and run")]


def test_vtt_styles_notes_and_settings_are_no_labels():
    text = (
        "WEBVTT - a title\n\nSTYLE\n::cue { color: red }\n\nNOTE --\nmore\n\n"
        "id\n00:01.000 --> 00:02.000 align:start\n<b>hop</b>\n\n00:03.000 --> 00:04.000\nrun"
    )
    (found,) = read("vtt", text.encode())
    assert rows(found.spans) == [(1.0, 2.0, "hop"), (3.0, 4.0, "run")]


def test_babel_has_the_keys_of_its_release():
    sequences = json.loads(babel_text([EXAMPLE, Transcript("b", ())]))
    assert list(sequences) == ["1", "2"]
    assert sequences["1"]["feat_p"] == EXAMPLE.document
    assert sequences["1"]["dur"] == 5.0
    assert sequences["1"]["frame_ann"]["mul_act"] is True
    label = sequences["1"]["frame_ann"]["labels"][0]
    assert label["act_cat"] == [label["raw_label"]] == [label["proc_label"]] == ["walk & run"]
    assert (label["start_t"], label["end_t"]) == (0.0, 1.5)
    assert sequences["2"]["frame_ann"]["labels"] == []


def test_babel_without_frames_labels_whole_sequences():
    sequence = {
        "babel_sid": 4, "feat_p": "KIT/3/kick.npz", "dur": 3.5, "frame_ann": None,
        "seq_ann": {"labels": [{"raw_label": "kicking", "proc_label": "kick", "act_cat": None}]},
    }  # fmt: skip
    (found,) = read("babel", json.dumps({"4": sequence}).encode())
    assert [(s.start, s.end, s.label) for s in found.spans] == [(None, None, "kick")]
    several = {"frame_anns": [{"labels": [
        {"raw_label": "hop", "proc_label": None, "start_t": 1, "end_t": 2.5}]}]}  # fmt: skip
    (found,) = read("babel", json.dumps({"4": sequence | several}).encode())
    assert rows(found.spans) == [(1.0, 2.5, "hop")]


EAF = KINDS["eaf"].write(EXAMPLE).decode()
GRID = KINDS["textgrid"].write(EXAMPLE).decode()
BOMB = (
    '<?xml version="1.0"?><!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10}">' for n in range(1, 12))
    + "]><ANNOTATION_DOCUMENT>&a11;</ANNOTATION_DOCUMENT>"
).replace("&a0;", "&a;")
OUTSIDE = (
    '<!DOCTYPE x [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    "<ANNOTATION_DOCUMENT>&x;</ANNOTATION_DOCUMENT>"
)
BABEL = '{"1": {"feat_p": "a", "frame_ann": {"labels": [%s]}}}'


@pytest.mark.parametrize(
    ("kind", "text", "complaint"),
    [
        ("eaf", BOMB, "file:1: has a document type"),
        ("eaf", OUTSIDE, "file:1: has a document type"),
        ("eaf", "<html/>", "file:1: not an ELAN file: begins with <html>"),
        ("eaf", EAF[:-40], "not XML"),
        ("eaf", EAF.replace("UTF-8", "EBCDIC-FOO"), "not XML"),
        ("eaf", EAF.replace("milliseconds", "PAL-frames"), "times in PAL-frames"),
        ("eaf", EAF.replace('TIME_VALUE="0"', 'TIME_VALUE="-1"'), "no number of milliseconds"),
        ("eaf", EAF.replace('TIME_VALUE="0"', 'TIME_VALUE="NaN"'), "no number of milliseconds"),
        ("eaf", EAF.replace('TIME_VALUE="0"', f'TIME_VALUE="{"9" * 400}"'), "milliseconds"),
        ("eaf", EAF.replace('TIME_VALUE="0"', 'TIME_VALUE="999000"'), "goes from 999 s to 1.5 s"),
        ("eaf", "<a>" * 200_000, "not an ELAN file"),
        ("textgrid", GRID[:200], "cut off"),
        ("textgrid", GRID.replace("IntervalTier", "OddTier"), "a tier of the kind 'OddTier'"),
        ("textgrid", GRID.replace("size = 5", "size = 1e9"), "how many there are"),
        ("textgrid", GRID.replace("size = 5", 'size = "x"'), "expected a number"),
        ("textgrid", GRID.replace("xmax = 1.5", "xmax = 1e999"), "goes from 0 s to inf s"),
        ("textgrid", GRID.replace("xmin = 2.5", "xmin = nan"), "expected a"),
        ("textgrid", 'File type = "ooTextFile"\nObject class = "Pitch"\n1\n', "not a TextGrid"),
        ("textgrid", 'File type = "ooTextFile"\n' + '"' * 100_001, "not a TextGrid"),
        ("vtt", "WEBVTT\n\nx\nno time\n", "file:4: expected a time"),
        ("vtt", "WEBVTT\n\n00:02.000 --> 00:01.000\nx\n", "goes from 2 s to 1 s"),
        ("vtt", "WEBVTTX\n\n", "not WebVTT"),
        ("srt", "1\n00:00:01,000 --> 00:00:02,000\nx\n\nbad\n\n", "file:5: expected a time"),
        ("babel", BABEL % "7", "neither proc_label nor raw_label"),
        ("babel", BABEL % '{"raw_label": "x", "start_t": "0"}', "no numbers"),
        ("babel", BABEL % '{"raw_label": "x", "start_t": NaN, "end_t": 1}', "not JSON"),
        ("babel", BABEL % f'{{"raw_label": "x", "start_t": 0, "end_t": {"9" * 400}}}', "goes"),
        ("babel", BABEL % ("[" * 100_000), "not JSON"),
        ("babel", '{"1": {"feat_p": 7}}', "expected an object with feat_p"),
        ("babel", '{"feat_p": [1]}', "expected an object with feat_p"),
    ],
)
def test_what_is_wrong_is_one_line(kind, text, complaint):
    with pytest.raises(FormatError, match=complaint) as caught:
        KINDS[kind].read(text.encode(), "file", "stem")
    assert str(caught.value).isprintable()
    assert str(caught.value).startswith("file:")


@pytest.mark.parametrize("kind", OURS)
def test_other_encodings_are_told(kind):
    data = written(kind, EXAMPLE).replace(b"walk", b"w\xfclk")
    with pytest.raises(FormatError, match=r"UTF-8|not XML"):
        KINDS[kind].read(data, "file", "stem")


@pytest.mark.parametrize("kind", OURS)
@given(st.data())
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
def test_damaged_files_are_read_or_refused(kind, data):
    good = bytearray(written(kind, EXAMPLE))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(good) - 1))
        good[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    with contextlib.suppress(FormatError):
        for transcript in KINDS[kind].read(bytes(good), "file", "stem"):
            for span in transcript.spans:
                assert span.start is None or math.isfinite(span.end - span.start)


@pytest.mark.parametrize("data", [b"", b"document,label\na,b\n", b'{"document": "a"}', b"\xff\xfe"])
def test_csv_and_json_lines_are_none_of_these(data):
    assert kind_of(data) is None


def test_a_span_without_letters_has_a_name_elsewhere():
    (found,) = read("textgrid", KINDS["textgrid"].write(Transcript("d", (Span(0, 1, " "),))))
    assert [span.label for span in found.spans] == [NOTHING]
