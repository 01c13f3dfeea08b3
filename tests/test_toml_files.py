"""Files that people write: read whole, or refused with one line of the caller's kind."""

import os

import pytest

from mocapidx.errors import FeatureSetError, FormatError
from mocapidx.toml_files import MOST_BYTES, parse_toml, read_toml_text


def test_a_file_is_read_without_its_byte_order_mark(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes("\ufeffname = 'kühn'".encode())
    assert parse_toml(read_toml_text(path), "a.toml") == {"name": "kühn"}


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda path: None, "no such file; make one"),
        (lambda path: path.mkdir(), "is no plain file; make one"),
        (lambda path: os.mkfifo(path), "is no plain file; make one"),
        (lambda path: path.write_bytes(b"a\xff"), "not UTF-8 text at byte 1"),
        (lambda path: path.write_bytes(b"#" * (MOST_BYTES + 1)), "larger than 1 MiB"),
    ],
)
def test_what_is_no_small_text_is_refused_by_name(tmp_path, make, says):
    path = tmp_path / "a\x1b.toml"
    make(path)
    with pytest.raises(FeatureSetError) as caught:
        read_toml_text(path, FeatureSetError, "; make one")
    assert str(caught.value).endswith(says)
    assert "a\\x1b.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a = ", "is not TOML"),
        ("a = 1e", "is not TOML"),
        ("a" * 3000, "line 1 is longer than 2000 characters"),
        ("\n" * (MOST_BYTES + 1), "larger than 1 MiB"),
        ("a = " + "[" * 1900, "nested too deeply|is not TOML"),
    ],
)
def test_what_is_no_toml_is_refused_in_one_line(text, says):
    with pytest.raises(FormatError, match=f"^b.toml: .*({says})") as caught:
        parse_toml(text, "b.toml")
    assert "\n" not in str(caught.value)
