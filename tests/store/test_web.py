"""Web files that can't be used: what to do is said, so that it can be done."""

import numpy as np
import pytest

from mocapidx.errors import StoreError
from mocapidx.store.web import WebDocument, WebFile, read_web, write_web

TO_DO = " with 'mocapidx web build' (remove it first, or give another --output)"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "arms.web"


def written(path, pieces=(), rate=30.0):
    table = np.array(pieces, dtype=np.int64).reshape(-1, 4)
    write_web(
        path, WebFile(rate, 3, {}, (WebDocument("0" * 32, "a.bvh", 60),), table, memoryview(b"12"))
    )
    return path.read_bytes()


def message(path):
    with pytest.raises(StoreError) as caught:
        read_web(path)
    return str(caught.value)


def test_a_flipped_byte(path):
    data = bytearray(written(path))
    data[40] ^= 1
    path.write_bytes(data)
    assert message(path).endswith(
        "its digest does not match); restore it, or make it again" + TO_DO
    )


@pytest.mark.parametrize("data", [b"", b"something else"])
def test_another_file(path, data):
    path.write_bytes(data)
    assert message(path).endswith("not a match web of mocapidx; make one" + TO_DO)


def test_a_file_cut_off(path):
    path.write_bytes(written(path)[:-1])
    assert message(path).endswith("closed by its seal); make one" + TO_DO)


@pytest.mark.parametrize(
    ("wrong", "what"),
    [({"rate": -1.0}, "its rate is none"), ({"pieces": [0, 1, 0, 0]}, "points outside it")],
)
def test_right_digests_around_what_is_wrong(path, wrong, what):
    written(path, **wrong)
    assert message(path).endswith(f"{what}); make it again" + TO_DO)


def test_where_there_is_none_nothing_has_to_be_removed(path):
    assert message(path).endswith("no match web here; make one with 'mocapidx web build'")
    path.symlink_to("nowhere")  # what a build would not write over either
    assert message(path).endswith(TO_DO)
    path.unlink()
    path.mkdir()
    assert message(path).endswith("is a folder, expected a match web")


def test_a_sound_one_is_read(path):
    written(path, pieces=[0, 0, 0, 2])
    assert bytes(read_web(path).piece(0)) == b"12"
