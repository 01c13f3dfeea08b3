import os

import pytest

from mocapidx.errors import ParameterError, WriteError
from mocapidx.tasks.safe_names import check_place


@pytest.mark.parametrize("name", ["new.csv", "there.csv", "folder", "new folder", "link"])
def test_a_place_that_may_be_written_is_none_to_speak_of(tmp_path, name):
    (tmp_path / "there.csv").touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "folder" / "there.csv")
    check_place(tmp_path / name)


def test_a_missing_folder_is_named(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "none" / "there.csv")
    for name in ("none/new.csv", "link"):
        with pytest.raises(ParameterError, match=f"there is no folder {tmp_path}/none; make it"):
            check_place(tmp_path / name)


def test_it_is_the_folder_that_must_be_open_to_writing(tmp_path, monkeypatch):
    closed = tmp_path / "closed"
    closed.mkdir()
    (tmp_path / "link").symlink_to(closed / "new.csv")
    monkeypatch.setattr(os, "access", lambda path, mode: path != closed)
    for name in ("closed", "closed/new.csv", "link"):
        with pytest.raises(WriteError, match=f"{name}: may not be written; see to its permissions"):
            check_place(tmp_path / name)
    check_place(tmp_path / "new.csv")


def test_a_device_is_no_file_that_is_replaced(monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    check_place(os.devnull)
