import os
import socket
import time

import pytest

from mocapidx.errors import FormatError
from mocapidx.formats import text
from mocapidx.formats.text import Limits, read_text


def refused(path, limits=None):
    with pytest.raises(FormatError) as caught:
        read_text(path, limits or Limits())
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message.removeprefix(str(path))


def written(tmp_path, data):
    path = tmp_path / "file.bvh"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"a\nb\n", b"a\nb\n"),
        (b"a\r\nb\r\n", b"a\r\nb\r\n"),
        (b"a\rb\r", b"a\nb\n"),
        (b"a\r\nb\rc\nd", b"a\nb\nc\nd"),
        (b"\xef\xbb\xbfa", b"a"),
        ("\ufeffä\n".encode("utf-16-le"), "ä\n".encode()),
        ("\ufeffä\n".encode("utf-16-be"), "ä\n".encode()),
        (b"\xfcber", b"\xfcber"),
        (b"", b""),
    ],
)
def test_text_comes_in_one_form_whatever_system_wrote_it(tmp_path, data, expected):
    assert read_text(written(tmp_path, data), Limits()) == expected


def test_a_broken_utf_16_file_is_named(tmp_path):
    assert "UTF-16" in refused(written(tmp_path, b"\xff\xfea"))


def test_a_missing_file_is_one_line(tmp_path):
    assert refused(tmp_path / "none.bvh") == ": no such file"


def test_a_folder_is_refused(tmp_path):
    assert refused(tmp_path) == ": is a folder, expected a motion file"


def test_a_named_pipe_is_refused_without_opening_it(tmp_path):
    path = tmp_path / "pipe.bvh"
    os.mkfifo(path)
    assert refused(path) == ": is a named pipe, expected a motion file"


def test_a_socket_is_refused(tmp_path):
    path = tmp_path / "s.bvh"
    with socket.socket(socket.AF_UNIX) as server:
        try:
            server.bind(os.path.relpath(path))
        except OSError:
            pytest.skip("no sockets in this folder")
        assert refused(path) == ": is a socket, expected a motion file"


def test_a_device_is_refused(tmp_path):
    path = tmp_path / "device.bvh"
    path.symlink_to("/dev/zero")
    assert refused(path) == ": is a device, expected a motion file"


def test_a_dangling_link_is_refused_by_name(tmp_path):
    path = tmp_path / "link.bvh"
    path.symlink_to(tmp_path / "none")
    assert refused(path) == ": is a symbolic link to a file that is not there"


def test_a_loop_of_links_is_refused(tmp_path):
    path = tmp_path / "link.bvh"
    path.symlink_to(path)
    assert "symbolic links" in refused(path)


def test_a_link_to_a_plain_file_is_followed(tmp_path):
    path = tmp_path / "link.bvh"
    path.symlink_to(written(tmp_path, b"x"))
    assert read_text(path, Limits()) == b"x"


def test_an_unreadable_name_is_refused(tmp_path):
    assert "can't be read" in refused(tmp_path / ("x" * 300))


def test_a_name_with_a_nul_is_refused():
    with pytest.raises(FormatError, match=r"a\\x00b: "):
        read_text(text.Path("a\0b"), Limits())


def test_a_large_file_names_its_limit_and_the_option(tmp_path):
    message = refused(written(tmp_path, b"12345"), Limits(max_file=4))
    assert message == ": has 5 bytes, more than 4; --max-file lifts this limit"


def test_a_line_of_a_gigabyte_is_not_read_whole(tmp_path):
    path = tmp_path / "long.bvh"
    with path.open("wb") as file:
        file.write(b"HIERARCHY\n")
        file.truncate(1 << 30)
    begin = time.process_time()
    assert refused(path) == ":2: line longer than 16 MiB; not a motion file"
    assert time.process_time() - begin < 1


def test_long_files_of_short_lines_are_read_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "CHUNK", 7)
    monkeypatch.setattr(text, "LONGEST_LINE", 10)
    data = b"0123456789\n" * 20 + b"\r0123456789\r"
    assert read_text(written(tmp_path, data), Limits()) == data.replace(b"\r", b"\n")
    assert ":3: line longer" in refused(written(tmp_path, b"a\nb\n" + b"x" * 11))


def test_a_file_that_grows_meanwhile_is_refused(tmp_path, monkeypatch):
    path = written(tmp_path, b"x" * 10)
    read = text._read_bytes

    def grow(*args):
        with path.open("ab") as file:
            file.write(b"more")
        return read(*args)

    monkeypatch.setattr(text, "_read_bytes", grow)
    assert "changed while it was read" in refused(path)


def test_names_that_steer_a_terminal_are_shown_escaped(tmp_path):
    path = tmp_path / "\x1b[31mred\n.bvh"
    with pytest.raises(FormatError) as caught:
        read_text(path, Limits())
    assert "\\x1b[31mred\\n.bvh: no such file" in str(caught.value)
