"""JSON of strangers is read only where it is what mocapidx may have written."""

import json

import pytest

from mocapidx.errors import StoreError
from mocapidx.store.encoding import encode_manifest
from mocapidx.store.json_text import (
    ALWAYS_ALLOWED,
    from_json,
    is_mostly_brackets,
    to_json,
    with_lists,
)
from mocapidx.store.manifest import Document, FileRecord, Manifest, SegmentFile, StoreSettings


def test_text_of_names_and_numbers_is_read():
    tree = {"names": [f"[take] {number}" for number in range(1000)], "sizes": list(range(1000))}
    assert from_json(json.dumps(tree).encode()) == tree


@pytest.mark.parametrize("text", [b"NaN", b"[-Infinity]", b"[1", b"\xff", b"", b"1" * 5000])
def test_what_is_no_json_is_refused(text):
    with pytest.raises(ValueError, match=r"."):
        from_json(text)


@pytest.mark.parametrize("piece", [b"{}", b"[]", b"[[]]", b'{"a":0}'])
def test_text_that_is_mostly_brackets_is_refused_unread(piece):
    text = b"[" + b",".join([piece] * ALWAYS_ALLOWED)
    with pytest.raises(ValueError, match="mostly brackets"):
        from_json(text)  # it is not even closed


def test_lists_are_added_as_if_all_were_written_at_once():
    whole = {"a": 1, "b": [{"x": "\ud800"}, {}], "c": []}
    parts = {"b": map(to_json, whole["b"]), "c": ()}
    assert with_lists(to_json({"a": 1}), **parts) == to_json(whole)
    assert from_json(to_json(whole)) == whole


def test_numbers_without_end_are_not_written():
    with pytest.raises(StoreError, match="a number without end"):
        to_json([float("inf")])


def test_lists_in_lists_without_end_are_not_written():
    nested = []
    for _ in range(100_000):
        nested = [nested]
    with pytest.raises(StoreError, match="too many lists in lists"):
        to_json(nested)


def test_a_store_of_names_that_no_reader_takes_is_not_written():
    settings = StoreSettings(30.0, "f39", "0" * 64, "")
    record = FileRecord(1, "0" * 64)
    document = Document("[" * 200, "/", None, "", 1, 1, 1, 1, 1.0, {})
    file = SegmentFile(1, record, record, record, {}, (document,) * 2000)
    with pytest.raises(StoreError, match="more brackets than a reader takes"):
        encode_manifest(Manifest(settings, (file,)))
    assert is_mostly_brackets(b"[" * (ALWAYS_ALLOWED + 1))
