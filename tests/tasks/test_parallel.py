import os
import pickle
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mocapidx import errors
from mocapidx.errors import MocapidxError, ParameterError
from mocapidx.store.files import DamagedError
from mocapidx.tasks.parallel import AHEAD, mapping

ROOT = Path(__file__).parents[2]


def double(number):
    return 2 * number


def slow_at_first(number):
    time.sleep(0.2 if number == 0 else 0)
    return number


def complain(number):
    if number == 3:
        raise ParameterError(f"no {number}, please")
    return number


def die(number):
    os.kill(os.getpid(), signal.SIGKILL)


def stay_small(item):
    """Let this process have little more memory than it has now."""
    status = Path("/proc/self/status").read_text()
    most = (int(re.search(r"VmData:\s+(\d+) kB", status)[1]) << 10) + (60 << 20)
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    return len(item)


def answer_at_length(size):
    stay_small("")
    return "x" * size


@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_results_come_in_the_order_of_the_items(jobs):
    with mapping(jobs) as apply:
        assert list(apply(slow_at_first, range(20))) == list(range(20))
        assert list(apply(double, range(5))) == [0, 2, 4, 6, 8]
        assert list(apply(double, ())) == []


def test_only_some_items_are_taken_before_their_turn():
    taken = []
    with mapping(2) as apply:
        results = apply(double, (taken.append(i) or i for i in range(1000)))
        for turn in range(50):
            assert next(results) == 2 * turn
            assert len(taken) <= turn + 1 + 2 * AHEAD


def test_what_an_item_raises_is_raised_at_its_turn_and_tells_where():
    with mapping(2) as apply:
        results = apply(complain, range(10))
        assert [next(results) for _ in range(3)] == [0, 1, 2]
        with pytest.raises(ParameterError, match="no 3, please") as caught:
            next(results)
    assert "in complain" in caught.value.__notes__[0]


@pytest.mark.parametrize(
    ("function", "items"),
    [(stay_small, ["x", "x", "x" * (70 << 20)]), (answer_at_length, [1, 1, 40 << 20])],
)
def test_a_worker_without_memory_for_what_it_is_sent_or_sends_ends_silently(capfd, function, items):
    with (
        mapping(2) as apply,
        pytest.raises(MocapidxError, match=r"a worker process died.*want of memory"),
    ):
        list(apply(function, items))
    assert capfd.readouterr().err == ""


def test_a_worker_that_dies_is_an_error_with_advice():
    with (
        mapping(2) as apply,
        pytest.raises(MocapidxError, match=r"a worker process died.*fewer --jobs"),
    ):
        list(apply(die, range(3)))


def test_leaving_in_the_middle_of_large_results_ends_at_once(tmp_path):
    # A pool of the standard library waits for ever if a worker is killed while it writes.
    script = tmp_path / "leave.py"
    script.write_text(
        "from mocapidx.tasks.parallel import mapping\n"
        "def large(number):\n"
        "    return bytes(1_000_000 if number else 1)\n"
        "if __name__ == '__main__':\n"
        "    for _ in range(2):\n"
        "        with mapping(2) as apply:\n"
        "            next(apply(large, range(100)))\n"
    )
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, script], cwd=ROOT, capture_output=True, text=True, timeout=20
        )
        assert (done.returncode, done.stderr) == (0, "")


def test_every_error_comes_back_from_a_worker_as_it_is():
    kinds = [getattr(errors, name) for name in errors.__all__]
    raised = [kind("what") for kind in kinds if issubclass(kind, MocapidxError)]
    raised.append(DamagedError(Path("a.store"), "000001.h5", "cut off"))
    for exc in raised:
        back = pickle.loads(pickle.dumps(exc))
        assert type(back) is type(exc)
        assert str(back) == str(exc)
        assert vars(back) == vars(exc)
