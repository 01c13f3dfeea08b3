import io
import os
import resource
import signal
import subprocess

import h5py
import numpy as np
import pytest

from mocapidx.errors import MocapidxError, StoreError
from mocapidx.store import closed, schema, verify
from mocapidx.store.encoding import encode_manifest
from mocapidx.store.manifest import FileRecord, Manifest, SegmentFile, file_digest
from mocapidx.store.read import open_store, read_manifest
from mocapidx.store.verify import check_blocks, check_digests, check_schemas


def test_a_sound_store_has_no_problems(store):
    with open_store(store) as snapshot:
        assert list(check_digests(store, snapshot.files)) == []
        assert list(check_schemas(store, snapshot.files)) == []
        for file in snapshot.files:
            assert list(check_blocks(snapshot, file)) == []


@pytest.mark.parametrize("name", ["000001.h5", "000002.idx"])
def test_any_changed_byte_is_found(store, name):
    victim = store / "segments" / name
    for place in (0, victim.stat().st_size // 2, victim.stat().st_size - 1):
        data = bytearray(victim.read_bytes())
        data[place] ^= 1
        victim.write_bytes(data)
        (problem,) = check_digests(store, read_manifest(store).files)
        assert (problem.name, problem.what) == (name, "it does not match its digest")
        assert problem.only_index == (name == "000002.idx")
        data[place] ^= 1
        victim.write_bytes(data)
    victim.unlink()
    (problem,) = check_digests(store, read_manifest(store).files)
    assert problem.what == "no such file or directory"


def forge(store, change):
    """Change the HDF5 file of the first segment file and give it the right digest again."""
    manifest = read_manifest(store)
    first = manifest.files[0]
    path = store / "segments" / first.names[0]
    change(path)
    data = path.read_bytes()
    record = FileRecord(len(data), file_digest(data).hexdigest())
    forged = SegmentFile(
        first.number, record, first.idx, first.head, first.datasets, first.documents
    )
    (store / "MANIFEST").write_bytes(
        encode_manifest(
            Manifest(manifest.settings, (forged, *manifest.files[1:]), 9, manifest.next_number)
        )
    )


def inside(change):
    """A change that h5py can make to an open file."""

    def apply(path):
        with h5py.File(path, "r+") as file:
            change(file)

    return apply


def replaced(name, make):
    """A change that puts something else in the place of a dataset."""

    def change(file):
        old = file[name][()]
        del file[name]
        make(file, name, old)

    return inside(change)


def soft(file, name, _old):
    file[name] = h5py.SoftLink("/frames/words")


def external(file, name, _old):
    file[name] = h5py.ExternalLink("/etc/passwd", "/frames/words")


def external_storage(file, name, old):
    file.create_dataset(
        name, shape=old.shape, dtype=old.dtype, external=[("/etc/passwd", 0, old.nbytes)]
    )


def virtual(file, name, old):
    layout = h5py.VirtualLayout(shape=old.shape, dtype=old.dtype)
    layout[:] = h5py.VirtualSource("/tmp/other.h5", "x", shape=old.shape)
    file.create_virtual_dataset(name, layout)


def text(file, name, _old):
    file.create_dataset(name, data=["a"] * 3, dtype=h5py.string_dtype())


def compound(file, name, old):
    file.create_dataset(name, shape=old.shape, dtype=[("a", "u4"), ("b", "u4")])


def of_type(dtype):
    """A change that gives a dataset another type."""
    return lambda file, name, old: file.create_dataset(name, shape=old.shape, dtype=dtype)


def unknown_filter(file, name, old):
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_chunk((5,))
    creation.set_filter(32_000, h5py.h5z.FLAG_OPTIONAL, ())
    space = h5py.h5s.create_simple(old.shape)
    h5py.h5d.create(file.id, name.encode(), h5py.h5t.NATIVE_UINT64, space, creation)


def compact(file, name, old):
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_layout(h5py.h5d.COMPACT)
    space = h5py.h5s.create_simple((3,))
    h5py.h5d.create(file.id, name.encode(), h5py.h5t.NATIVE_UINT64, space, creation)


def linked_group(file):
    file.move("frames", "runs/frames")
    file["frames"] = h5py.SoftLink("/runs/frames")


def behind_a_user_block(path):
    data = path.read_bytes()
    path.unlink()
    with h5py.File(path, "w", userblock_size=512):
        pass
    path.write_bytes(path.read_bytes()[:2048] + data)


def committed(file, name, old):
    file["runs/type"] = old.dtype
    file.create_dataset(name, data=old, dtype=file["runs/type"])
    del file["runs/type"]


def moved(file):
    file["copy"] = file["frames/words"][()]
    del file["frames/words"]
    file.move("copy", "frames/words")


CHANGES = {
    "soft link": (replaced("frames/words", soft), "link to somewhere else"),
    "external link": (replaced("frames/words", external), "link to somewhere else"),
    "external storage": (replaced("frames/words", external_storage), "another file"),
    "virtual": (replaced("frames/words", virtual), "not contiguous"),
    "chunks": (
        replaced("frames/words", lambda f, n, old: f.create_dataset(n, data=old, chunks=(5,))),
        "not contiguous",
    ),
    "filter": (
        replaced("frames/words", lambda f, n, old: f.create_dataset(n, data=old, compression=4)),
        "not contiguous",
    ),
    "strings": (replaced("runs/mix/words", text), "another type"),
    "compound": (replaced("runs/mix/words", compound), "another type"),
    "object references": (replaced("runs/mix/words", of_type(h5py.ref_dtype)), "another type"),
    "region references": (
        replaced("runs/mix/words", of_type(h5py.regionref_dtype)),
        "another type",
    ),
    "lists of any length": (
        replaced("runs/mix/words", of_type(h5py.vlen_dtype("u4"))),
        "another type",
    ),
    "other end first": (replaced("frames/words", of_type(">u8")), "another type"),
    "unknown filter": (replaced("frames/words", unknown_filter), "not contiguous"),
    "compact": (replaced("frames/words", compact), "not contiguous"),
    "linked group": (inside(linked_group), "frames is a link to somewhere else"),
    "user block": (behind_a_user_block, "has a user block"),
    "committed type": (replaced("runs/mix/words", committed), "another type"),
    "other type": (
        replaced("frames/words", lambda f, n, old: f.create_dataset(n, data=old.astype("i8"))),
        "another type",
    ),
    "other shape": (
        replaced("frames/words", lambda f, n, old: f.create_dataset(n, data=old[:-1])),
        "has the shape",
    ),
    "moved": (inside(moved), "lies at byte"),
    "huge": (
        replaced(
            "frames/words", lambda f, n, old: f.create_dataset(n, (1 << 50,), "u8", chunks=True)
        ),
        "not contiguous",
    ),
    "group": (replaced("frames/words", lambda f, n, old: f.create_group(n)), "another kind"),
    "missing": (inside(lambda f: f.__delitem__("frames/words")), "has 1 members, expected 2"),
    "one more": (
        inside(lambda f: f.create_dataset("frames/more", data=np.arange(3))),
        "has 3 members, expected 2",
    ),
    "renamed": (inside(lambda f: f.move("meta", "beta")), "meta is missing"),
    "attribute": (inside(lambda f: f["frames/words"].attrs.create("a", 1)), "has attributes"),
    "attribute of the file": (inside(lambda f: f.attrs.create("a", 1)), "has attributes"),
    "not HDF5": (lambda path: path.write_bytes(b"x" * 40_000), "not a readable HDF5 file"),
}


@pytest.mark.parametrize(("change", "message"), CHANGES.values(), ids=CHANGES)
def test_an_hdf5_file_of_another_schema_with_right_digests_is_named(store, change, message):
    with h5py.File(store.parent / "other.h5", "w") as other:
        other["x"] = np.zeros(3)
    forge(store, change)
    files = read_manifest(store).files
    assert list(check_digests(store, files)) == []
    (problem,) = check_schemas(store, files)
    assert message in problem.what
    assert problem.name == "000001.h5"


def test_a_reader_takes_only_bytes_of_the_digests_from_a_forged_file(store):
    with open_store(store) as snapshot:
        expected = snapshot.array(snapshot.files[0], "frames/words")
    forge(store, replaced("frames/words", external))
    with open_store(store) as snapshot:
        try:
            found = snapshot.array(snapshot.files[0], "frames/words")
        except StoreError:
            return
        np.testing.assert_array_equal(found, expected)


def test_a_child_that_dies_is_a_problem_of_its_file_alone(store, monkeypatch):
    files = read_manifest(store).files
    real, asked = verify._ask_child, []

    def die_once(path, waiting):
        asked.append(len(waiting))
        return ([], "exit status -11") if len(asked) == 1 else real(path, waiting)

    monkeypatch.setattr(verify, "_ask_child", die_once)
    (problem,) = check_schemas(store, files)
    assert (problem.number, problem.what) == (1, "HDF5 breaks on it (exit status -11)")
    assert asked == [2, 1]


def end_as_told(monkeypatch, output, code):
    """Let the child that opens files end so."""
    done = subprocess.CompletedProcess([], code, output, b"")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: done)


@pytest.mark.parametrize(
    ("output", "code", "what"),
    [
        (b"", 1, r"could not start \(exit status 1\)"),
        (b"\nnull\n", -signal.SIGKILL, "was killed"),
    ],
)
def test_a_child_that_ends_for_other_reasons_says_nothing_of_files(
    store, monkeypatch, output, code, what
):
    end_as_told(monkeypatch, output, code)
    with pytest.raises(MocapidxError, match=f"{what}.*; nothing is known about them"):
        list(check_schemas(store, read_manifest(store).files))


def test_a_child_that_gets_no_time_says_nothing_of_files(store, monkeypatch):
    monkeypatch.setattr(verify, "TIMEOUT", -1.999)
    with pytest.raises(MocapidxError, match="gave no answer; nothing is known"):
        list(check_schemas(store, read_manifest(store).files))


def test_a_child_that_needs_too_long_is_a_problem_of_its_file(store, monkeypatch):
    end_as_told(monkeypatch, b"\n", -signal.SIGXCPU)
    problems = list(check_schemas(store, read_manifest(store).files))
    assert [problem.what for problem in problems] == ["HDF5 breaks on it (exit status -24)"] * 2


def test_files_are_asked_about_in_bounded_numbers(store, monkeypatch):
    monkeypatch.setattr(verify, "TOGETHER", 1)
    real, asked = verify._ask_child, []

    def counting(path, files):
        asked.append(len(files))
        return real(path, files)

    monkeypatch.setattr(verify, "_ask_child", counting)
    assert not list(check_schemas(store, read_manifest(store).files))
    assert asked == [1, 1]


def test_the_child_has_limits(monkeypatch):
    limits = {}
    monkeypatch.setattr(resource, "setrlimit", limits.__setitem__)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    with pytest.raises(ValueError, match="Expecting value"):
        closed.main()
    assert limits[resource.RLIMIT_AS][0] == closed.MEMORY
    assert limits[resource.RLIMIT_CPU][0] == closed.SECONDS


def test_blocks_that_are_not_those_of_the_manifest_are_found(store):
    manifest = read_manifest(store)
    first = manifest.files[0]
    wrong = {
        path: type(dataset)(dataset.shape, dataset.offset, "00" * (len(dataset.blocks) // 2))
        for path, dataset in first.datasets.items()
    }
    forged = SegmentFile(first.number, first.h5, first.idx, first.head, wrong, first.documents)
    (store / "MANIFEST").write_bytes(
        encode_manifest(Manifest(manifest.settings, (forged,), 9, manifest.next_number))
    )
    with open_store(store) as snapshot:
        found = list(check_blocks(snapshot, snapshot.files[0]))
    assert {problem.what.split()[0] for problem in found} == set(schema.COLUMNS)


def test_metadata_that_contradict_the_manifest_are_found(store):
    manifest = read_manifest(store)
    settings = manifest.settings
    other = type(settings)(25.0, settings.feature_set_name, settings.feature_set_digest, "")
    (store / "MANIFEST").write_bytes(
        encode_manifest(Manifest(other, manifest.files, 9, manifest.next_number))
    )
    with open_store(store) as snapshot:
        (problem,) = check_blocks(snapshot, snapshot.files[0])
    assert problem.what == "its metadata contradicts the manifest"


def test_hdf5_may_load_no_plug_ins():
    from mocapidx.store import hdf5

    assert hdf5.h5f
    assert os.environ["HDF5_PLUGIN_PRELOAD"] == "::"
