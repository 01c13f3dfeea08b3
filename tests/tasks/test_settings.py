import os

import pytest

from mocapidx.errors import FormatError
from mocapidx.tasks.settings import SETTINGS_NAME, find_settings, read_settings


def test_the_nearest_file_above_counts(tmp_path):
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (tmp_path / SETTINGS_NAME).write_text("")
    assert find_settings(inner) == tmp_path / SETTINGS_NAME
    (tmp_path / "a" / SETTINGS_NAME).write_text("")
    assert find_settings(inner) == tmp_path / "a" / SETTINGS_NAME


def test_what_others_or_folders_are_called_so_does_not_count(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / SETTINGS_NAME).write_text("")
    (tmp_path / "a" / SETTINGS_NAME).mkdir()
    assert find_settings(tmp_path / "a") == tmp_path / SETTINGS_NAME
    assert find_settings(tmp_path, owners=frozenset({os.getuid() + 1})) is None


def test_sections_are_named_by_the_words_of_their_command(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("[all]\njobs = 2\n[template]\n[template.show]\nclass = 'x'\nnumbers = [1, 2]\n")
    assert read_settings(path).sections == {
        "all": {"jobs": 2},
        "template": {},
        "template show": {"class": "x", "numbers": [1, 2]},
    }


@pytest.mark.parametrize(("text", "says"), [("a = 1", "'a' stands in no section"), ("a", "TOML")])
def test_what_is_no_settings_file_is_refused(tmp_path, text, says):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(FormatError, match=says):
        read_settings(tmp_path / "a.toml")
