"""Files that once broke a reader stay here: ``fixtures/hostile/KIND/*``, read on every run."""

import warnings
from pathlib import Path

import pytest

from mocapidx.errors import MocapidxError
from tests.fuzz.limited import Attack
from tests.fuzz.targets import TARGETS

KEPT = sorted(
    path for path in (Path(__file__).parents[2] / "fixtures/hostile").glob("*/*") if path.is_file()
)


@pytest.mark.parametrize("path", KEPT, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_what_broke_a_reader_once_does_not_again(path, seeds, tmp_path):
    target = TARGETS[path.parent.name]
    place = Attack(target, seeds, tmp_path / "work").lay_out(path.read_bytes())
    message = ""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            target.read(place)
        except MocapidxError as exc:
            message = str(exc)
    assert message.isprintable()
    assert len(message) < 600


def test_there_are_some():
    assert KEPT
