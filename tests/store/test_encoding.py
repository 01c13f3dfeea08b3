import dataclasses
import json
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import StoreError
from mocapidx.store import encoding, schema
from mocapidx.store.encoding import decode_manifest, encode_manifest
from mocapidx.store.manifest import Dataset, FileRecord, Manifest, SegmentFile, file_digest
from tests.made_store import SETTINGS, make_document

PLACE = Path("takes.store/MANIFEST")


def made_file(number, frames_by_name, **changes):
    """A segment file as a manifest has it; there are no such bytes."""
    documents = tuple(make_document(n, t, **changes) for n, t in frames_by_name.items())
    frames = sum(frames_by_name.values())
    datasets, offset = {}, 1000
    for path, column in schema.COLUMNS.items():
        rows = {"meta": 500}.get(path, frames if "frames/" in path else frames + len(documents))
        size = rows * column.row_bytes
        blocks = "cd" * 16 * -(-size // schema.BLOCK)
        datasets[path] = Dataset((rows, *column.trailing), offset, blocks)
        offset += size
    record = FileRecord(300, "12" * 32)
    head = FileRecord(100, "34" * 32)
    return SegmentFile(number, FileRecord(offset, "56" * 32), record, head, datasets, documents)


MANIFEST = Manifest(
    SETTINGS,
    (made_file(1, {"a": 3, "b": 90_000}), made_file(4, {"c": 1}, root="/other", path="x/c")),
    generation=7,
    next_number=5,
)


def signed(tree):
    body = tree if isinstance(tree, bytes) else json.dumps(tree).encode()
    return file_digest(body).hexdigest().encode() + b"\n" + body


def tree_of(manifest=MANIFEST):
    return json.loads(encode_manifest(manifest).partition(b"\n")[2])


def test_a_manifest_comes_back_as_it_was():
    assert decode_manifest(encode_manifest(MANIFEST), PLACE) == MANIFEST
    empty = Manifest(SETTINGS)
    assert decode_manifest(encode_manifest(empty), PLACE) == empty


@given(
    st.lists(st.text(st.characters(exclude_characters="\0"), min_size=1), min_size=1, unique=True),
    st.dictionaries(st.text(), st.none() | st.integers(-99, 99) | st.text()),
)
@settings(max_examples=60, deadline=None)
def test_names_and_rigs_may_hold_anything(names, rig):
    file = made_file(1, dict.fromkeys(names, 2), rig=rig, root="/\udc80\x1b", path="\ud800")
    manifest = Manifest(SETTINGS, (file,), 1, 2)
    data = encode_manifest(manifest)
    assert decode_manifest(data, PLACE) == manifest
    assert data.isascii()


def test_rigs_and_roots_that_documents_share_are_written_once():
    file = made_file(1, {f"take {i:05}.amc": 900 for i in range(1000)})
    data = encode_manifest(Manifest(SETTINGS, (file,), 1, 2))
    assert data.count(b'"untrusted"') == 1
    assert len(data) < 200 * 1000


def test_a_dead_document_may_share_its_name():
    first = made_file(1, {"a": 3}, live=False)
    manifest = Manifest(SETTINGS, (first, made_file(2, {"a": 4})), 2, 3)
    decoded = decode_manifest(encode_manifest(manifest), PLACE)
    assert [entry.file.number for entry in decoded.documents()] == [2]


def test_places_leave_one_position_free_between_documents():
    placed = list(made_file(1, {"a": 3, "b": 5, "c": 2}).placed())
    assert [entry.frame_offset for entry in placed] == [0, 3, 8]
    assert [entry.first for entry in placed] == [0, 4, 10]


def test_any_changed_byte_is_noticed():
    data = encode_manifest(MANIFEST)
    for place in range(0, len(data), 7):
        changed = data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]
        with pytest.raises(StoreError, match="digest does not match"):
            decode_manifest(changed, PLACE)


def test_a_newer_format_asks_for_an_upgrade_whatever_else_it_holds():
    tree = {"format": "mocapidx-store", "version": 2, "anything": []}
    with pytest.raises(StoreError, match=r"written by a newer mocapidx .*; upgrade$"):
        decode_manifest(signed(tree), PLACE)


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"null",
        b"[]",
        b"{}",
        b"\xff\xfe",
        b"{" * 100_000,
        b"[" * 100_000 + b"]" * 100_000,
        b'{"format":' * 50_000,
        b'{"format":"mocapidx-store","version":' + b"9" * 5000 + b"}",
        b'{"format":"mocapidx-store","version":NaN}',
        b'{"format":"mocapidx-store","version":1e999}',
        b'{"format":"mocapidx-store","version":true}',
    ],
    ids=lambda body: repr(body[:30]),
)
def test_hostile_json_is_one_line(body):
    with pytest.raises(StoreError) as caught:
        decode_manifest(signed(body), PLACE)
    assert str(caught.value).startswith("takes.store/MANIFEST: ")
    assert "\n" not in str(caught.value)


def places_in(tree, path=()):
    """Every place in a tree of JSON."""
    yield path
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from places_in(value, (*path, key))
    elif isinstance(tree, list):
        for index, value in enumerate(tree):
            yield from places_in(value, (*path, index))


def put(tree, path, value):
    for key in path[:-1]:
        tree = tree[key]
    tree[path[-1]] = value


PLACES = [path for path in places_in(tree_of()) if path]
ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-2, 2),
    st.integers(),
    st.sampled_from([2**31, 2**32, 2**63, 2**64, -(2**63), 10**400, 1e308, 0.0, -1.5]),
    st.text(max_size=5),
    st.sampled_from(
        ["../../../etc/passwd", "a\0b", "", "ab" * 32, "AB" * 32, "<u8", "\u0662" * 64]
    ),
    st.lists(st.integers(0, 3) | st.none() | st.text(max_size=2), max_size=4),
    st.dictionaries(st.sampled_from(["size", "digest", "name", "meta"]), st.integers(), max_size=3),
)


@given(st.lists(st.tuples(st.sampled_from(PLACES), ODD), min_size=1, max_size=3))
@settings(max_examples=600, deadline=None)
def test_a_manifest_with_right_digest_and_wrong_content_is_refused_or_agrees_with_itself(changes):
    tree = tree_of()
    for path, value in changes:
        try:
            put(tree, path, value)
        except (KeyError, IndexError, TypeError):
            continue  # an earlier change took the place away
    try:
        manifest = decode_manifest(signed(tree), PLACE)
    except StoreError:
        return
    for file in manifest.files:
        assert all(schema.SEGMENT_NAME.fullmatch(name) for name in file.names)
        for path, dataset in file.datasets.items():
            rows = dataset.shape[0]
            assert dataset.offset + rows * schema.COLUMNS[path].row_bytes <= file.h5.size
            assert rows == file.frames or not path.startswith("frames/")
    assert decode_manifest(encode_manifest(manifest), PLACE) == manifest


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("files", 0, "documents", "name", 1), "a", "stands twice"),
        (("files", 0, "number"), 4, "not in order"),
        (("files", 0, "documents", "frames", 0), 4, "rows for"),
        (("files", 0, "documents", "root", 0), 9, "out of range"),
        (("files", 0, "documents", "rate"), [], None),
        (("files", 0, "datasets", "meta", "offset"), 10**9, "not lie within its file"),
        (("files", 0, "datasets", "frames/words", "dtype"), ">u8", "another dtype"),
        (("files", 0, "datasets", "frames/words", "blocks"), "ab", "one digest a block"),
        (("files", 0, "datasets", "../x"), {}, "not the datasets"),
        (("files", 0, "head", "size"), 10**6, "larger than the index"),
        (("rate",), 0.0, "a rate is not between"),
        (("rate",), 1e308, "a rate is not between"),
        (("next",), 10**13, "out of range"),
    ],
)
def test_what_contradicts_itself_is_named(path, value, message):
    tree = tree_of()
    put(tree, path, value)
    if message is None:
        decode_manifest(signed(tree), PLACE)
    else:
        with pytest.raises(StoreError, match=message):
            decode_manifest(signed(tree), PLACE)


def test_a_manifest_over_the_limit_is_not_written(monkeypatch):
    monkeypatch.setattr(schema, "MANIFEST_LIMIT", 1000)
    with pytest.raises(StoreError, match="over the limit"):
        encode_manifest(MANIFEST)


def test_every_field_of_a_document_is_checked():
    assert set(encoding.COLUMN_TYPES) == {
        entry.name for entry in dataclasses.fields(make_document("a", 1))
    }
    assert sys.getrecursionlimit() < 100_000
