"""The judge of fuzzing sees what it has to see, and the driver says what it needs."""

import importlib.util

import pytest

from mocapidx.errors import FormatError
from mocapidx.formats import bvh
from mocapidx.kernels.choice import compiled
from tests.fuzz import guided
from tests.fuzz.entries import ENTRIES, Entry, judge
from tests.small_files import BVH


def raising(error):
    def read(data, folder):
        raise error

    return read


@pytest.fixture
def entry(monkeypatch):
    """Let one reader be all there is of an entry."""

    def put(reader):
        monkeypatch.setitem(ENTRIES, "mine", Entry((reader,), ""))
        return "mine"

    return put


def test_a_refusal_with_one_line_is_no_finding(entry, tmp_path):
    judge(entry(raising(FormatError("take.bvh:3: no number"))), b"", tmp_path)


@pytest.mark.parametrize(
    "error",
    [
        ValueError("no error of ours"),
        RuntimeWarning("overflow"),
        FormatError("two\nlines"),
        FormatError("\x1b[2J"),
        FormatError("x" * 2000),
    ],
)
def test_whatever_else_comes_out_is_a_finding(entry, tmp_path, error):
    with pytest.raises((type(error), AssertionError)):
        judge(entry(raising(error)), b"", tmp_path)


def test_numbers_that_depend_on_how_a_file_is_read_are_a_finding(monkeypatch, tmp_path):
    if compiled("text") is None:
        pytest.skip("without the kernel both ways are the same")
    judge("bvh", BVH.encode(), tmp_path)
    exact = bvh.parse_numbers

    def inexact(*words):
        values, bad = exact(*words)
        return values * (1 + 1e-15), bad

    monkeypatch.setattr(bvh, "parse_numbers", inexact)
    with pytest.raises(AssertionError, match="in small pieces"):
        judge("bvh", BVH.encode(), tmp_path)


def test_without_the_fuzzer_one_line_says_what_to_install(monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "atheris" else find(name)
    )
    monkeypatch.setattr("sys.argv", ["guided", "bvh"])
    with pytest.raises(
        SystemExit, match=r"^fuzzing needs atheris: pip install -e '\.\[test,fuzz\]'$"
    ):
        guided.main()


def test_kernels_that_were_not_built_are_named(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: True)
    monkeypatch.setattr("sys.argv", ["guided", "bvh", "--kernels", str(tmp_path)])
    with pytest.raises(SystemExit, match="no kernels here; 'make fuzz' builds them"):
        guided.main()
