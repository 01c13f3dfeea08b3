import errno
import fcntl
import os
import signal
import subprocess
import sys
import time

import pytest

from mocapidx.errors import LockedError, WriteError
from mocapidx.store.lock import locked

HOLDER = """
import sys, time
from pathlib import Path
from mocapidx.store.lock import locked
with locked(Path(sys.argv[1]), command="index"):
    print("held", flush=True)
    time.sleep(float(sys.argv[2]))
"""


@pytest.fixture
def holder(tmp_path):
    """Start another process that holds the lock for some seconds."""
    started = []

    def start(seconds):
        process = subprocess.Popen(
            [sys.executable, "-c", HOLDER, str(tmp_path), str(seconds)], stdout=subprocess.PIPE
        )
        started.append(process)
        assert process.stdout.readline() == b"held\n"
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()


def test_a_second_writer_is_told_who_holds_the_lock(tmp_path, holder):
    process = holder(60)
    with (
        pytest.raises(LockedError, match=rf"`index` \(pid {process.pid} on .*, since \d\d:\d\d\)"),
        locked(tmp_path, command="compact"),
    ):
        pass


def test_a_second_writer_waits_as_long_as_it_was_told(tmp_path, holder):
    holder(0.4)
    with locked(tmp_path, command="compact", timeout=20):
        pass
    holder(60)
    begin = time.monotonic()
    with pytest.raises(LockedError), locked(tmp_path, command="compact", timeout=0.2):
        pass
    assert 0.2 <= time.monotonic() - begin < 5


def test_a_dead_holder_never_blocks(tmp_path, holder):
    process = holder(60)
    process.send_signal(signal.SIGKILL)
    process.wait()
    with locked(tmp_path, command="compact"):
        assert "compact" in (tmp_path / "LOCK").read_text()


def test_children_do_not_inherit_the_lock(tmp_path):
    with locked(tmp_path, command="index"):
        child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        with locked(tmp_path, command="compact"):
            pass
    finally:
        child.communicate(b"\n")


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOTSUP])
def test_a_file_system_without_locks_is_never_written_in_silence(tmp_path, monkeypatch, number):
    def refuse(*_args):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.raises(LockedError, match="--no-lock"), locked(tmp_path, command="index"):
        pass
    with locked(tmp_path, command="index", use_lock=False):
        pass


def test_what_stands_in_the_file_cannot_steer_a_terminal(tmp_path):
    with (tmp_path / "LOCK").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.write("\x1b[2J evil\n\u202e" + "x" * 1000)
        file.flush()
        with pytest.raises(LockedError) as caught, locked(tmp_path, command="index"):
            pass
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 500


def test_a_lock_file_that_cannot_be_made_is_a_write_error(tmp_path):
    (tmp_path / "LOCK").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(WriteError), locked(tmp_path, command="index"):
        pass
    assert not (tmp_path / "elsewhere").exists()


def test_a_lock_file_of_somebody_else_is_locked_all_the_same(tmp_path, monkeypatch):
    (tmp_path / "LOCK").touch()
    real_open = os.open

    def open_mine(path, flags, *args, **options):
        if str(path).endswith("LOCK") and flags & os.O_RDWR:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)
        return real_open(path, flags, *args, **options)

    monkeypatch.setattr(os, "open", open_mine)
    with (
        locked(tmp_path, command="index"),
        pytest.raises(LockedError, match="is being written by another command"),
        locked(tmp_path, command="index"),
    ):
        pass
