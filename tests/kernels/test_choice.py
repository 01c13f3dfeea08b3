import json
import os
from pathlib import Path

import pytest

from mocapidx.errors import ParameterError
from mocapidx.kernels import choice


@pytest.fixture
def chosen(monkeypatch):
    """Choose kernels by the environment for a while."""

    def choose(value):
        monkeypatch.setenv(choice.VARIABLE, value)
        choice.compiled.cache_clear()

    yield choose
    monkeypatch.undo()
    choice.compiled.cache_clear()


def test_numpy_is_forced(chosen):
    chosen("numpy")
    assert choice.compiled("matching") is None
    assert choice.kernels_in_use() == choice.instructions_in_use() == "numpy"


@pytest.mark.parametrize("value", ["", "c"])
def test_compiled_kernels_run_where_they_were_built(value, chosen):
    pytest.importorskip("mocapidx.kernels._matching", reason="the kernels weren't built")
    chosen(value)
    assert choice.compiled("matching").__name__ == "mocapidx.kernels._matching"
    assert choice.instructions_in_use() in {"avx512", "avx2", "ssse3", "portable"}


def test_without_a_compiler_numpy_runs(chosen, monkeypatch):
    monkeypatch.setattr(choice, "KERNELS", ("absent",))
    chosen("")
    assert choice.compiled("absent") is None
    assert choice.kernels_in_use() == "numpy"


def test_some_kernels_may_be_missing(chosen, monkeypatch):
    pytest.importorskip("mocapidx.kernels._matching", reason="the kernels weren't built")
    monkeypatch.setattr(choice, "KERNELS", ("matching", "absent"))
    chosen("")
    assert choice.kernels_in_use() == "c and numpy"


def test_demanded_kernels_that_were_not_built_are_an_error(chosen):
    chosen("c")
    with pytest.raises(ParameterError, match="'absent' wasn't built; install a C compiler"):
        choice.compiled("absent")


def test_an_unknown_choice_is_one_line_and_exit_2(fixtures_store, mocapidx):
    done = mocapidx("info", fixtures_store, env=os.environ | {choice.VARIABLE: "rust"})
    assert done.returncode == 2
    assert done.stderr == f"Error: {choice.VARIABLE} must be 'c' or 'numpy', got 'rust'\n"
    assert done.stdout == ""


def test_info_tells_what_runs(fixtures_store, mocapidx):
    environment = os.environ | {choice.VARIABLE: "numpy"}
    done = mocapidx("info", fixtures_store, "--format", "jsonl", env=environment)
    facts = json.loads(done.stdout)
    assert (facts["kernels"], facts["instructions"]) == ("numpy", "numpy")


def test_every_c_file_is_known_as_a_kernel():
    folder = Path(choice.__file__).parent
    if not list(folder.glob("*.c")):
        pytest.skip("the sources aren't installed")
    assert sorted(choice.KERNELS) == sorted(path.stem for path in folder.glob("*.c"))
