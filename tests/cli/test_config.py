"""Settings from files: the command line goes first, and each value tells where it is from."""

import json
import os

import pytest

TEXT = """
[all]
store = "takes.store"
quiet = true
[info]
documents = true
format = "csv"
[template.show]
class = "squat"
"""


@pytest.fixture
def project(tmp_path, fixtures_store):
    (tmp_path / "deep" / "er").mkdir(parents=True)
    os.symlink(fixtures_store, tmp_path / "takes.store")
    (tmp_path / "mocapidx.toml").write_text(TEXT)
    return tmp_path


def shown(done):
    assert done.returncode == 0, done.stderr
    return {
        (row["command"], row["option"]): row
        for row in map(json.loads, done.stdout.split("\n")[:-1])
    }


def test_a_project_file_above_gives_the_store_and_other_options(mocapidx, project):
    done = mocapidx("info", cwd=project / "deep" / "er")
    assert done.returncode == 0
    assert done.stdout.startswith("document,")


def test_the_command_line_goes_before_the_command_and_this_before_all(mocapidx, project):
    (project / "other.toml").write_text(
        '[all]\nstore = "takes.store"\nformat = "csv"\n[info]\nformat = "jsonl"\n'
    )
    named = ("--config", project / "other.toml", "info")
    assert mocapidx(*named, cwd=project).stdout.startswith("{")
    assert not mocapidx(*named, "--format", "table", cwd=project).stdout.startswith("{")


def test_no_config_takes_nothing_from_files(mocapidx, project):
    done = mocapidx("--no-config", "info", cwd=project)
    assert done.returncode == 2
    assert "Missing argument 'STORE'" in done.stderr


def test_config_show_tells_the_origin_of_each_value(mocapidx, project):
    rows = shown(mocapidx("config", "show", "info", "--format", "jsonl", cwd=project))
    assert rows["info", "STORE"]["value"] == str(project / "takes.store")
    assert rows["info", "STORE"]["origin"] == "[all]"
    assert rows["info", "--format"]["origin"] == "[info]"
    assert rows["info", "--documents"]["value"] is True
    assert rows["info", "--output"]["origin"] == "default"


def test_a_flag_that_turns_off_is_given_by_true(mocapidx, tmp_path):
    (tmp_path / "mocapidx.toml").write_text("[retrieve]\nno-rivals = true\n")
    rows = shown(mocapidx("config", "show", "retrieve", "--format", "jsonl", cwd=tmp_path))
    assert rows["retrieve", "--no-rivals"]["value"] is True
    (tmp_path / "mocapidx.toml").write_text("[retrieve]\nno-rivals = false\n")
    rows = shown(mocapidx("config", "show", "retrieve", "--format", "jsonl", cwd=tmp_path))
    assert rows["retrieve", "--no-rivals"]["value"] is False


def test_config_show_lists_what_is_set_for_which_command(mocapidx, project):
    rows = shown(mocapidx("config", "show", "--format", "jsonl", cwd=project))
    assert rows["template show", "--class"]["value"] == "squat"
    assert rows["index", "--store"]["origin"] == "[all]"
    assert ("info", "--output") not in rows


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[info]\nfoo = 1", "[info]: 'info' has no option '--foo'"),
        ("[info]\ndocuments = 1", "[info]: documents: expected true or false, got '1'"),
        ("[info]\nformat = true", "[info]: format: expected a text or a number, got 'True'"),
        ("[info]\nformat = ['csv']", "[info]: format: expected a text or a number"),
        ("[info]\nformat = 'xml'", "[info]: format: 'xml' is not one of"),
        ("info = 3", "'info' stands in no section; write [all] above it"),
        ("[info", "is not TOML"),
    ],
)
def test_wrong_settings_are_one_line_with_file_section_and_key(mocapidx, tmp_path, text, says):
    (tmp_path / "my.toml").write_text(text)
    done = mocapidx("--config", "my.toml", "info", "x.store", cwd=tmp_path)
    assert done.returncode in (2, 3)
    assert done.stderr.startswith("Error: my.toml: ")
    assert says in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("text", ["[blub]\na = 1", "[all]\nno-such-option = 1"])
def test_config_show_refuses_what_reaches_no_command(mocapidx, tmp_path, text):
    (tmp_path / "mocapidx.toml").write_text(text)
    done = mocapidx("config", "show", cwd=tmp_path)
    assert done.returncode == 2
    assert "no command takes" in done.stderr


def test_an_unknown_command_to_show_is_wrong_usage(mocapidx, tmp_path):
    done = mocapidx("config", "show", "blub", cwd=tmp_path)
    assert done.returncode == 2
    assert "there is no command 'blub'" in done.stderr
