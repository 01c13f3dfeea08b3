"""``--untrusted``: what breaks the process that reads is exit code 4 and one line."""

import os
import signal

import pytest

from mocapidx.errors import Interrupted, StoreError
from mocapidx.tasks import untrusted
from mocapidx.tasks.untrusted import in_limited_child

# The children do next to nothing, and need none of the test runner's threads.
pytestmark = pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")


def test_a_sound_store_is_read_as_ever(mocapidx, fixtures_store):
    plain = mocapidx("info", fixtures_store, "--documents")
    limited = mocapidx("--untrusted", "info", fixtures_store, "--documents")
    assert (limited.stdout, limited.stderr) == (plain.stdout, plain.stderr)
    assert limited.returncode == 0


@pytest.mark.parametrize("arguments", [["info", "none.store"], ["info"], ["nonsense"]])
def test_errors_are_those_without_it(mocapidx, arguments):
    plain = mocapidx(*arguments)
    limited = mocapidx("--untrusted", *arguments)
    assert (limited.returncode, limited.stderr) == (plain.returncode, plain.stderr)


def ending_of(work, **limits):
    """Do the work in the child and give what the parent sees."""
    code = in_limited_child(**limits)
    if code is None:
        try:
            work()
            os._exit(0)
        except BaseException:
            os._exit(1)
    return code


def crash():
    os.kill(os.getpid(), signal.SIGKILL)


def hang():
    while True:
        pass


def grow():
    return len(b"x" * (3 << 30))


@pytest.mark.parametrize("work", [crash, hang, grow])
def test_crashes_hangs_and_hunger_are_damage(work):
    with pytest.raises(
        StoreError, match=r"the process that was to read untrusted files .* damaged"
    ):
        ending_of(work, seconds=1)


def test_an_exit_code_goes_through():
    assert ending_of(lambda: os._exit(3)) == 3


def test_a_signal_reaches_the_child(monkeypatch):
    endings = []

    def once(child):
        if not endings:
            endings.append(child)
            raise Interrupted(signal.SIGTERM)
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

    monkeypatch.setattr(untrusted, "_ending", once)
    with pytest.raises(Interrupted):
        ending_of(hang)
