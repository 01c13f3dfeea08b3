"""Stores that an enemy made: refused in one line, at once, and nothing outside them is opened."""

import contextlib
import hashlib
import json
import os
import shutil
import struct
import sys
import time
from pathlib import Path

import pytest

from mocapidx.errors import StoreError
from mocapidx.index.postings import ENTRY, HEADER, MAGIC, PART
from mocapidx.store.manifest import file_digest
from mocapidx.store.read import read_manifest
from mocapidx.store.schema import FORMAT
from mocapidx.store.sealed import SEAL
from mocapidx.store.sigma import read_sigma, sigma_fault
from mocapidx.store.templates import read_templates
from mocapidx.store.web import read_web
from mocapidx.synthesis.file import load_space
from mocapidx.tasks.compact import compact_store
from mocapidx.tasks.index import index_files
from mocapidx.tasks.info import document_info, store_info
from mocapidx.tasks.merge import merge_stores
from mocapidx.tasks.query import query_store
from mocapidx.tasks.verify import verify_store
from mocapidx.templates.file import load_templates
from tests.fuzz.forging import digested, tree_of, with_index, with_tree

AT_ONCE = 0.1
"""Seconds of processor time in which any hostile store is refused."""

HEARD = []
"""Paths that this process opens while somebody listens; a hook can't be taken away again."""


@pytest.fixture(scope="session", autouse=True)
def hook():
    def hear(event, arguments):
        if LISTENING and event == "open" and isinstance(arguments[0], (str, bytes, os.PathLike)):
            HEARD.append(os.fsdecode(arguments[0]))

    sys.addaudithook(hear)


LISTENING = []


@contextlib.contextmanager
def nothing_outside(folder):
    """Fail if a file is opened that lies neither in the folder nor among our own."""
    HEARD.clear()
    LISTENING.append(True)
    try:
        yield
    finally:
        LISTENING.clear()
    ours = (str(folder), sys.prefix, sys.base_prefix, str(Path(__file__).parents[2]))
    outside = [path for path in HEARD if not path.startswith(ours)]
    assert outside == []


def sparse(path, size=1 << 30):
    path.unlink(missing_ok=True)
    with path.open("wb") as file:
        file.truncate(size)


def with_body(make):
    def apply(store):
        (store / "MANIFEST").write_bytes(digested(make(json.dumps(tree_of(store)).encode())))

    return apply


def first_file(change):
    return with_tree(lambda tree: change(tree["files"][0]))


def instead(name, make):
    """Something else in the place of a file or a folder."""

    def apply(store):
        place = store / name
        outside = store.parent / f"outside-{place.name}"
        place.rename(outside)
        make(place, outside)

    return apply


def set_of(key, value):
    return lambda entry: entry.__setitem__(key, value)


def words_of(entry):
    return entry["datasets"]["frames/words"]


def head_field(place, pattern, *values):
    def change(data, head_size):
        packed = struct.pack(pattern, *values)
        return data[:place] + packed + data[place + len(packed) :], head_size

    return with_index(change)


def only_list(blob, count):
    """An index whose parts have one list each: these bytes, said to be so many numbers."""

    def change(data, head_size):
        entry = (
            struct.pack("<III", 5, count, len(blob))
            + hashlib.blake2b(blob, digest_size=16).digest()
        )
        runs, at, head = [], len(MAGIC) + HEADER.size, b""
        for _ in range(3):
            name, of_part, lists = PART.unpack_from(data, at)
            runs.append((name, of_part))
            at += PART.size + lists * ENTRY.itemsize
        for name, of_part in runs:
            head += PART.pack(name, of_part, 1) + entry
        size = len(MAGIC) + HEADER.size + len(head)
        return MAGIC + HEADER.pack(size, 3) + head + 3 * blob, size

    return with_index(change)


def full_bitmap():
    """A roaring bitmap of half a megabyte that stands for all four milliard numbers."""
    cookie = struct.pack("<I", 12347 | 65535 << 16) + b"\xff" * 8192
    keys = b"".join(struct.pack("<HH", key, 0xFFFF) for key in range(65536))
    offsets = b"".join(struct.pack("<I", 0) for _ in range(65536))
    return cookie + keys + offsets + struct.pack("<HHH", 1, 0, 0xFFFF) * 65536


AT = len(MAGIC)
FIRST = AT + HEADER.size
HOSTILE = {
    "a manifest of 1 GB": lambda store: sparse(store / "MANIFEST"),
    "no JSON": with_body(lambda body: b"\x80" + body),
    "an empty manifest": with_body(lambda body: b""),
    "nested deeply": with_body(lambda body: b"[" * 1_000_000),
    "objects nested deeply": with_body(lambda body: b'{"a":' * 300_000),
    "a huge whole number": with_body(
        lambda body: body.replace(b'"next": 3', b'"next": 1' + b"0" * 9999)
    ),
    "a huge rate": with_body(lambda body: body.replace(b'"rate": 30.0', b'"rate": 1e999')),
    "a rate of not a number": with_body(lambda body: body.replace(b'"rate": 30.0', b'"rate": NaN')),
    "a rig without end": with_body(
        lambda body: body.replace(b'"rigs": [{', b'"rigs": [{"odd": 1e999, ')
    ),
    "half a surrogate for a format": with_tree(set_of("format", "\ud800")),
    "a newer format": with_tree(set_of("version", 99)),
    "a segment outside": first_file(set_of("number", "../../outside")),
    "a negative segment": first_file(set_of("number", -1)),
    "a segment of many digits": first_file(set_of("number", 10**13)),
    "a segment twice": with_tree(lambda tree: tree["files"].append(tree["files"][0])),
    "a document twice": with_tree(
        lambda tree: tree["files"][1]["documents"]["name"].__setitem__(
            0, tree["files"][0]["documents"]["name"][0]
        )
    ),
    "fifty thousand documents": first_file(
        lambda entry: [column.extend(column * 50_000) for column in entry["documents"].values()]
    ),
    "frames without end": first_file(
        lambda entry: entry["documents"]["frames"].__setitem__(0, 2**62)
    ),
    "a shape without end": first_file(lambda entry: words_of(entry)["shape"].__setitem__(0, 2**50)),
    "a shape below zero": first_file(lambda entry: words_of(entry)["shape"].__setitem__(0, -1)),
    "a place without end": first_file(lambda entry: words_of(entry).__setitem__("offset", 2**62)),
    "a place below zero": first_file(lambda entry: words_of(entry).__setitem__("offset", -8)),
    "a file without end": first_file(lambda entry: entry["h5"].__setitem__("size", 2**60)),
    "an index without end": first_file(lambda entry: entry["idx"].__setitem__("size", 2**60)),
    "a head without end": first_file(lambda entry: entry["head"].__setitem__("size", 2**60)),
    "no digest for a block": first_file(lambda entry: words_of(entry).__setitem__("blocks", "")),
    "a manifest that is a link": instead("MANIFEST", lambda place, out: place.symlink_to(out)),
    "a manifest that is a pipe": instead("MANIFEST", lambda place, out: os.mkfifo(place)),
    "a manifest that is a folder": instead("MANIFEST", lambda place, out: place.mkdir()),
    "a manifest that is a device": instead("MANIFEST", lambda p, out: p.symlink_to("/dev/zero")),
    "segments elsewhere": instead("segments", lambda place, out: place.symlink_to(out)),
    "segments that are a file": instead("segments", lambda place, out: place.write_bytes(b"")),
    "a segment elsewhere": instead(
        "segments/000001.h5", lambda place, out: place.symlink_to("../../outside-000001.h5")
    ),
    "a segment that is a pipe": instead("segments/000001.h5", lambda place, out: os.mkfifo(place)),
    "an index elsewhere": instead(
        "segments/000001.idx", lambda place, out: place.symlink_to("/etc/passwd")
    ),
    "an index that is a pipe": instead("segments/000001.idx", lambda p, out: os.mkfifo(p)),
    "a link in a circle": instead(
        "segments/000001.idx", lambda place, out: place.symlink_to("000001.idx")
    ),
    "no index": instead("segments/000001.idx", lambda place, out: None),
    "an index of 1 GB": lambda store: sparse(store / "segments/000001.idx"),
    "a head that says it is longer": head_field(AT, "<Q", 2**60),
    "parts without end": head_field(AT + 8, "<I", 2**32 - 1),
    "no parts": head_field(AT + 8, "<I", 0),
    "lists without end": head_field(FIRST + 20, "<I", 2**32 - 1),
    "another part": head_field(FIRST, "<16s", b"middle"),
    "other runs": head_field(FIRST + 16, "<I", 2**32 - 1),
    "a list without end": head_field(FIRST + PART.size + 8, "<I", 2**32 - 1),
    "an empty index": with_index(lambda data, size: (b"", 0)),
    "a bitmap of all numbers": only_list(full_bitmap(), 9),
    "a bitmap cut off": only_list(full_bitmap()[:9000], 9),
    "a bitmap of nonsense": only_list(b"\xff" * 50, 9),
    "no bitmap": only_list(b"", 9),
    "one number too many": only_list(b"\0" * 12, 2),
    "half a number": only_list(b"\0" * 6, 2),
    "a number beyond all runs": only_list(b"\xff" * 4, 1),
}  # fmt: skip


def asked(store):
    """Everything that readers do with a store."""
    store_info(store)
    for file in read_manifest(store).files:
        document_info(store, file.documents[0].name)
    query_store(store, steps_of=("F20", "0"), mode="exact")
    report = verify_store(store, quick=True)
    report = report if report.problems else verify_store(store)
    if report.problems:
        raise StoreError(report.problems[0])


def refused(work):
    """Give the error of what must be refused, and the least time that this took of three."""
    times = []
    for _ in range(3):
        begin = time.process_time()
        with pytest.raises(StoreError) as caught:
            work()
        times.append(time.process_time() - begin)
    assert caught.value.exit_code == 4
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 600
    return caught.value, min(times)


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_store_is_refused_in_one_line_at_once(kind, store):
    HOSTILE[kind](store)
    with nothing_outside(store):
        _, seconds = refused(lambda: asked(store))
    assert seconds < AT_ONCE


def crowded(piece):
    """A manifest with a list of a million of something small."""
    return f'{{"format":"{FORMAT}","segments":[{",".join([piece] * 1_000_000)}]}}'.encode()


@pytest.mark.parametrize("piece", ["{}", "[[]]", '{"a":0}'])
def test_a_manifest_of_a_million_objects_is_refused_unread(piece, store):
    (store / "MANIFEST").write_bytes(digested(crowded(piece)))
    error, seconds = refused(lambda: store_info(store))
    assert "not JSON as mocapidx writes it" in str(error)
    assert seconds < AT_ONCE


@pytest.mark.parametrize("piece", ['"ab"', "1.5", "0"])
def test_a_manifest_of_a_million_values_takes_no_longer_than_to_parse_it(piece, store):
    body = crowded(piece)
    (store / "MANIFEST").write_bytes(digested(body))
    _, seconds = refused(lambda: store_info(store))
    begin = time.process_time()
    json.loads(body)
    assert seconds < AT_ONCE + 2 * (time.process_time() - begin)


def test_a_program_says_the_same(store, mocapidx):
    HOSTILE["a bitmap of all numbers"](store)
    done = mocapidx("verify", store)
    assert done.returncode == 4
    assert "000001.idx" in done.stderr
    HOSTILE["segments elsewhere"](store)
    for command in (["info", store], ["query", store, "--scene", "kick-then-punch"]):
        done = mocapidx(*command)
        assert done.returncode == 4, done
        assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("make", [sparse, os.mkfifo, lambda place: place.symlink_to("/etc/passwd")])
def test_a_hostile_sigma_is_no_sigma(store, make):
    (store / "SIGMA").unlink()
    make(store / "SIGMA")
    with nothing_outside(store):
        assert read_sigma(store) is None
        assert sigma_fault(store).isprintable()


def sealed(image, table, size=None, magic=b"mocapidx-mt-seal"):
    text = table if isinstance(table, bytes) else json.dumps(table).encode()
    body = image + text + struct.pack("<Q", len(text) if size is None else size)
    return body + file_digest(body).digest() + magic


def listed(**changes):
    meta = {"dtype": "|u1", "shape": [2], "offset": 8}
    matrix = {"dtype": "<f8", "shape": [1, 1], "offset": 10, **changes}
    return {
        "format": "mocapidx-templates",
        "version": 1,
        "datasets": {"meta": meta, "matrices/0000": matrix},
    }


def sealed_meta(text):
    meta = {"dtype": "|u1", "shape": [len(text)], "offset": 8}
    return sealed(b"\x89HDF\r\n\x1a\n" + text, {**listed(), "datasets": {"meta": meta}})


IMAGE = b"\x89HDF\r\n\x1a\n{}" + b"\0" * 8
SEALED = {
    "a table without end": sealed(IMAGE, listed(), size=2**64 - 1),
    "a table of nonsense": sealed(IMAGE, b"[" * 1_000_000),
    "a shape without end": sealed(IMAGE, listed(shape=[2**28, 2**28])),
    "a shape that wraps": sealed(IMAGE, listed(shape=[2**32, 2**32])),
    "a place below zero": sealed(IMAGE, listed(offset=-8)),
    "a place without end": sealed(IMAGE, listed(offset=2**63)),
    "objects": sealed(IMAGE, listed(dtype="|O")),
    "many arrays": sealed(
        IMAGE,
        {**listed(), "datasets": {f"matrices/{n:04d}": {} for n in range(200_000)}},
    ),
    "a few too many arrays": sealed(
        IMAGE,
        {**listed(), "datasets": {f"matrices/{n:04d}": {} for n in range(20_000)}},
    ),
    "a meta of nonsense": sealed_meta(b"[" * 1_000_000),
    "a meta of many objects": sealed_meta(b"[" + b"{}," * 1_000_000 + b"0]"),
    "a meta that is a number": sealed_meta(b"1" * 4000),
    "only a seal": SEAL.pack(0, file_digest(struct.pack("<Q", 0)).digest(), b"mocapidx-mt-seal"),
}


@pytest.mark.parametrize("kind", SEALED)
def test_a_hostile_template_file_is_refused_in_one_line(kind, tmp_path):
    path = tmp_path / "t.mt"
    path.write_bytes(SEALED[kind])
    with nothing_outside(tmp_path):
        _, seconds = refused(lambda: read_templates(path))
    assert seconds < AT_ONCE


@pytest.mark.parametrize("size", [200 << 20, 1 << 30])
@pytest.mark.parametrize("read", [load_templates, read_web, load_space])
def test_a_file_of_nothing_but_size_is_refused_unread(read, size, tmp_path):
    path = tmp_path / "x"
    sparse(path, size)
    _, seconds = refused(lambda: read(path))
    assert seconds < AT_ONCE


@pytest.mark.parametrize("read", [load_templates, read_web, load_space])
def test_what_is_no_file_is_not_waited_for(read, tmp_path):
    path = tmp_path / "x"
    os.mkfifo(path)
    refused(lambda: read(path))


@pytest.mark.parametrize("command", ["verify", "repair", "compact", "index", "merge", "info"])
@pytest.mark.parametrize("has_manifest", [True, False])
def test_segments_that_are_those_of_another_store_stay(
    store, seeds, fixtures_dir, tmp_path, command, has_manifest
):
    enemy = tmp_path / "enemy.store"
    enemy.mkdir()
    if has_manifest:
        with_tree(lambda tree: tree.update(files=[], rigs=[]))(store)
        shutil.copy(store / "MANIFEST", enemy)
    victim = shutil.copytree(seeds / "take.store", tmp_path / "victim.store")
    (enemy / "segments").symlink_to(victim / "segments")
    before = {place.name: place.read_bytes() for place in (victim / "segments").iterdir()}
    commands = {
        "verify": lambda: verify_store(enemy),
        "repair": lambda: verify_store(enemy, repair=True),
        "compact": lambda: compact_store(enemy),
        "index": lambda: index_files([fixtures_dir / "bvh/jog"], enemy),
        "merge": lambda: merge_stores([seeds / "take.store"], enemy),
        "info": lambda: store_info(enemy),
    }
    with pytest.raises(StoreError, match=r"a symbolic link|no store here"):
        commands[command]()
    assert before == {p.name: p.read_bytes() for p in (victim / "segments").iterdir()}
