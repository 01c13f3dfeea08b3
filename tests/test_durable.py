import errno
import fcntl
import os
import stat
from pathlib import Path
from types import SimpleNamespace

import pytest

from mocapidx import durable
from mocapidx.durable import durable_replace, make_folder, replace_file, sync_folder
from mocapidx.errors import ParameterError, WriteError


def failing(number, message="made to fail"):
    def fail(*_args, **_kwargs):
        raise OSError(number, message)

    return fail


@pytest.fixture
def target(tmp_path):
    path = tmp_path / "out.txt"
    path.write_bytes(b"before")
    return path


def names(folder):
    return sorted(place.name for place in folder.iterdir())


@pytest.mark.parametrize(
    "content",
    [b"", b"after", [b"af", memoryview(b"ter")], (b"x" for _ in range(3)), [b"y" * 40_000_000]],
    ids=["empty", "bytes", "pieces", "generator", "large"],
)
def test_the_new_content_is_there_and_nothing_else(target, content):
    content = list(content) if not isinstance(content, bytes) else content
    durable_replace(target, content)
    assert target.read_bytes() == (content if isinstance(content, bytes) else b"".join(content))
    assert names(target.parent) == ["out.txt"]


def test_a_file_keeps_its_permissions_and_a_link_stays_a_link(target, tmp_path):
    target.chmod(0o600)
    link = tmp_path / "link"
    link.symlink_to(target)
    durable_replace(link, b"after")
    assert link.is_symlink()
    assert target.read_bytes() == b"after"
    assert stat.S_IMODE(target.stat().st_mode) == 0o600


def test_everything_is_synced_before_the_rename_and_the_folder_after_it(target, monkeypatch):
    order = []
    fsync, rename = os.fsync, os.rename
    monkeypatch.setattr(
        os,
        "fsync",
        lambda fd: (order.append(stat.S_IFMT(os.fstat(fd).st_mode)), fsync(fd)),
    )
    monkeypatch.setattr(os, "rename", lambda *a: (order.append("rename"), rename(*a)))
    durable_replace(target, b"after")
    assert order == [stat.S_IFREG, "rename", stat.S_IFDIR]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_a_full_disk_is_one_line_with_the_room_that_is_missing(target, monkeypatch, number):
    monkeypatch.setattr(os, "write", failing(number))
    with pytest.raises(WriteError) as caught:
        durable_replace(
            target, b"x" * 2_500_000, subject="takes.store", unchanged="store as it was"
        )
    message = str(caught.value)
    assert message.startswith("no space left on /")
    assert "for takes.store: needed about 3 MB, " in message
    assert message.endswith("; store as it was")
    assert "\n" not in message
    assert target.read_bytes() == b"before"
    assert names(target.parent) == ["out.txt"]


def test_what_is_needed_is_rounded_up_and_what_is_free_down(target, monkeypatch):
    def disk(*_args):
        return SimpleNamespace(f_bavail=3, f_frsize=4096)

    monkeypatch.setattr(os, "write", failing(errno.ENOSPC))
    monkeypatch.setattr(os, "statvfs", disk)
    with pytest.raises(WriteError, match=r"needed about 13 kB, free 12 kB; .* is unchanged"):
        durable_replace(target, b"x" * 12_300)
    with pytest.raises(WriteError, match=r"needed at least 13 kB, free 12 kB; .* is not there"):
        durable_replace(target.with_name("new"), (b"x" * 100 for _ in range(123)))


def test_a_disk_that_has_room_but_no_more_names_says_so(target, monkeypatch):
    def refuse(path, *_args):
        raise OSError(errno.ENOSPC, "No space left on device", path)

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(WriteError, match=r"but no room for one more file \(inodes\)"):
        durable_replace(target, b"after")


@pytest.mark.parametrize("call", ["write", "fsync", "rename"])
def test_a_failing_disk_leaves_the_file_as_it_was(target, monkeypatch, call):
    monkeypatch.setattr(os, call, failing(errno.EIO))
    with pytest.raises(WriteError, match=r"input/output error .* is unchanged"):
        durable_replace(target, b"after")
    assert target.read_bytes() == b"before"
    assert names(target.parent) == ["out.txt"]


def test_a_failed_sync_is_never_tried_again(target, monkeypatch):
    calls = []
    monkeypatch.setattr(os, "fsync", lambda fd: (calls.append(fd), failing(errno.EIO)()))
    with pytest.raises(WriteError):
        durable_replace(target, b"after")
    assert len(calls) == 1


def test_a_folder_that_cannot_be_synced_leaves_it_open_what_is_saved(target, monkeypatch):
    monkeypatch.setattr(durable, "sync_folder", failing(errno.EIO))
    with pytest.raises(WriteError, match="may or may not be saved; running again is safe"):
        durable_replace(target, b"after")
    assert target.read_bytes() == b"after"


def test_a_file_system_without_folder_sync_is_taken_as_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", failing(errno.EINVAL))
    sync_folder(tmp_path)
    monkeypatch.setattr(os, "fsync", failing(errno.EIO))
    with pytest.raises(OSError, match="made to fail"):
        sync_folder(tmp_path)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, MemoryError, ValueError])
def test_whatever_stops_it_the_temporary_file_goes(target, stop):
    def chunks():
        yield b"half"
        assert len(names(target.parent)) == 2
        raise stop

    with pytest.raises(stop):
        durable_replace(target, chunks())
    assert target.read_bytes() == b"before"
    assert names(target.parent) == ["out.txt"]


@pytest.mark.parametrize(("module", "call"), [(os, "open"), (fcntl, "flock"), (os, "fstat")])
def test_a_stop_right_after_a_call_leaves_no_temporary_file(target, monkeypatch, module, call):
    real = getattr(module, call)

    def stopped(*args, **options):
        done = real(*args, **options)
        if names(target.parent) != ["out.txt"]:
            monkeypatch.undo()
            raise KeyboardInterrupt(done)
        return done

    monkeypatch.setattr(module, call, stopped)
    with pytest.raises(KeyboardInterrupt):
        durable_replace(target, b"after")
    assert target.read_bytes() == b"before"
    assert names(target.parent) == ["out.txt"]


@pytest.mark.parametrize("number", [errno.EACCES, errno.EROFS, errno.EPERM])
def test_a_place_that_may_not_be_written_is_a_write_error(target, monkeypatch, number):
    monkeypatch.setattr(os, "open", failing(number, "Read-only file system"))
    with pytest.raises(WriteError, match=r"out.txt: may not be written \(read-only file system\)"):
        durable_replace(target, b"after")


def test_a_wrong_path_is_a_parameter_error(tmp_path):
    with pytest.raises(ParameterError, match="there is no folder"):
        durable_replace(tmp_path / "none" / "out.txt", b"")
    with pytest.raises(ParameterError, match="is a folder, expected a file"):
        durable_replace(tmp_path, b"")


def test_a_device_or_a_pipe_is_never_renamed_over(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(ParameterError, match="no regular file"):
        durable_replace(pipe, b"after")
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_name_as_long_as_a_file_system_allows_is_no_trouble(tmp_path):
    path = tmp_path / ("n" * 255)
    durable_replace(path, b"after")
    assert path.read_bytes() == b"after"


def test_the_folder_that_is_named_is_the_one_that_is_missing(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nowhere" / "file")
    for path in (tmp_path / "link", tmp_path / "nowhere" / "file"):
        with pytest.raises(ParameterError, match=f"there is no folder {tmp_path / 'nowhere'};"):
            durable_replace(path, b"x")
    if Path("/proc").is_dir():
        with pytest.raises(WriteError, match="/proc/x: could not be written"):
            durable_replace(Path("/proc/x"), b"x")


@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_what_a_killed_writer_left_goes_with_the_next_one(target, tmp_path):
    child = os.fork()
    if not child:
        durable_replace(target, (os._exit(9) if n else b"half" for n in range(2)))
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    assert target.read_bytes() == b"before"
    assert len(names(tmp_path)) == 2
    durable_replace(target, b"after")
    assert target.read_bytes() == b"after"
    assert names(tmp_path) == ["out.txt"]


def test_what_another_writer_is_writing_stays(target, tmp_path):
    def chunks():
        yield b"the "
        durable_replace(target, b"between")
        assert target.read_bytes() == b"between"
        assert len(names(tmp_path)) == 2
        yield b"last"

    durable_replace(target, chunks())
    assert target.read_bytes() == b"the last"
    assert names(tmp_path) == ["out.txt"]


def test_a_folder_that_cannot_be_synced_is_not_made(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", failing(errno.EIO))
    with pytest.raises(WriteError, match="nothing was made"):
        make_folder(tmp_path / "new")
    assert names(tmp_path) == []


def test_a_file_that_another_writer_is_about_to_take_away_is_not_written(
    target, tmp_path, monkeypatch
):
    usual, opened = tmp_path / "out.txt.mocapidx.tmp", os.open
    rivals = []

    def locked_by_a_rival(path, flags, *mode, **options):
        descriptor = opened(path, flags, *mode, **options)
        if flags & os.O_CREAT and not rivals:
            rivals.append(opened(path, os.O_RDONLY))
            fcntl.flock(rivals[0], fcntl.LOCK_EX)
        return descriptor

    monkeypatch.setattr(os, "open", locked_by_a_rival)
    durable_replace(target, b"after")
    assert target.read_bytes() == b"after"
    assert usual.exists()  # the rival's to remove; written, it could have become the target
    os.close(rivals[0])


def test_a_stop_after_the_rename_takes_nothing_of_another_writer(target, tmp_path, monkeypatch):
    usual, rename = tmp_path / "out.txt.mocapidx.tmp", os.rename

    def stopped(*places):
        rename(*places)
        usual.write_bytes(b"another's")
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "rename", stopped)
    with pytest.raises(KeyboardInterrupt):
        durable_replace(target, b"after")
    assert target.read_bytes() == b"after"
    assert usual.read_bytes() == b"another's"


def test_a_stranger_beside_that_cannot_be_locked_is_left_alone(target, tmp_path):
    strange = tmp_path / "out.txt.mocapidx.tmp"
    strange.symlink_to(tmp_path / "elsewhere")
    durable_replace(target, b"after")
    assert target.read_bytes() == b"after"
    assert strange.is_symlink()
    assert not (tmp_path / "elsewhere").exists()


def test_without_locks_of_files_nothing_is_taken_for_abandoned(target, tmp_path, monkeypatch):
    left = tmp_path / "out.txt.mocapidx.tmp"
    left.write_bytes(b"somebody's")
    monkeypatch.setattr(fcntl, "flock", failing(errno.ENOLCK))
    durable_replace(target, b"after")
    assert target.read_bytes() == b"after"
    assert left.read_bytes() == b"somebody's"


def test_small_pieces_are_written_together(target, monkeypatch):
    written, write = [], os.write
    monkeypatch.setattr(
        os, "write", lambda fd, data: (written.append(len(data)), write(fd, data))[1]
    )
    durable_replace(target, [b"a line\n"] * 300_000)
    assert target.read_bytes() == b"a line\n" * 300_000
    assert len([size for size in written if size]) == 3


def test_what_a_second_writer_left_is_removed_by_the_next_one(target, tmp_path):
    usual, second = (tmp_path / f"out.txt.mocapidx{n}.tmp" for n in ("", 2))
    with usual.open("wb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        opened = []
        replace_file(target, (opened.extend(names(tmp_path)) or b"" for _ in range(1)))
        assert second.name in opened
        second.write_bytes(b"of a killed one")
    durable_replace(target, b"after")
    assert names(tmp_path) == ["out.txt"]
