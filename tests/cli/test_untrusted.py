"""``--untrusted``: what breaks the process that reads is exit code 4 and one line."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mocapidx.errors import StoreError
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


COMMANDS = {
    "index": ("index", "{clips}/squat", "--root", "{clips}", "--jobs", "2", "--quiet", "--store"),
    "verify": ("verify", "{store}", "--quick"),
    "verify in full": ("verify", "{store}"),
    "query": ("query", "{store}", "--steps-of", "F20", "0 1 0", "--format", "csv", "--output"),
    "web": ("web", "build", "{store}", "--where", "document = *squat*", "--quiet", "--output"),
    "plot": ("plot", "lists", "{store}", "--output"),
    "merge": ("merge", "{store}", "--quiet", "--output"),
    "doctor": ("doctor", "{clips}/squat", "--format", "jsonl", "--output"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_what_a_command_writes_is_what_it_writes_without(
    name, mocapidx, fixtures_store, fixtures_dir, tmp_path
):
    places = {"store": fixtures_store, "clips": fixtures_dir / "clips"}
    arguments = [word.format(**places) for word in COMMANDS[name]]
    results = []
    for way in ([], ["--untrusted"]):
        place = tmp_path / f"made{len(results)}.png"
        output = [place] if arguments[-1] in ("--output", "--store") else []
        done = mocapidx(*way, *arguments, *output)
        assert done.returncode == 0, done.stderr
        files = [place, *place.rglob("*")]
        wrote = [p.read_bytes() for p in sorted(files) if p.is_file() and p.name != "LOCK"]
        said = (done.stdout + done.stderr).replace(place.name, "made.png")
        results.append((said if output == [] else "", wrote))
    assert results[0] == results[1]
    assert any(results[0])


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


@pytest.mark.parametrize("work", [crash, hang])
def test_crashes_and_hangs_are_damage(work):
    with pytest.raises(
        StoreError, match=r"the process that was to read untrusted files .* damaged"
    ):
        ending_of(work, seconds=1)


def grow():
    return len(b"x" * (3 << 30))


def test_what_the_child_could_not_do_is_damage():
    assert ending_of(grow) == 4


def test_an_exit_code_goes_through():
    assert ending_of(lambda: os._exit(3)) == 3


WAITING = """
import os, sys, time
from mocapidx.tasks import untrusted
from mocapidx_cli import main, group
untrusted.MEMORY = 1 << 30
def work(**_):
    open(sys.argv[2], "w").close()
    {work}
group.mocapidx.main = work
main.main()
"""


def started(work, tmp_path, before=""):
    """The program, doing something else than a command, in a group of its own."""
    begun = tmp_path / "begun"
    process = subprocess.Popen(
        [sys.executable, "-c", before + WAITING.format(work=work), "--untrusted", begun],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    end = time.monotonic() + 30
    while not begun.exists() and process.poll() is None:
        assert time.monotonic() < end
        time.sleep(0.01)
    return process


def is_gone(group):
    """Whether no process of a group is left; one may take a moment to end."""
    for _ in range(500):
        if not any(belongs(place, group) for place in Path("/proc").glob("[0-9]*/stat")):
            return True
        time.sleep(0.01)
    return False


def belongs(place, group):
    try:
        state, _, own = place.read_text().rsplit(")", 1)[1].split()[:3]
    except OSError:
        return False
    return int(own) == group and state != "Z"


CLEANS = (
    "\n    try:\n        time.sleep(60)\n    finally:\n        time.sleep(0.5); print('cleaned')"
)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["one", "group"])
def test_a_stop_reaches_the_child_once_whoever_gets_it(number, send, tmp_path):
    process = started(CLEANS, tmp_path)
    send(process.pid, number)
    output, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert output == "cleaned\n"
    assert said == "Error: interrupted; nothing was written\n"
    assert is_gone(process.pid)


def test_a_stop_that_comes_when_the_child_is_done_changes_nothing(tmp_path):
    process = started(
        "\n    try:\n        time.sleep(60)\n    except BaseException:\n        sys.exit(0)",
        tmp_path,
    )
    os.kill(process.pid, signal.SIGTERM)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (0, "")


def test_a_child_that_a_stop_ends_before_it_can_speak_has_written_whole_files(tmp_path):
    work = "\n    try: time.sleep(60)\n    except BaseException: os.kill(os.getpid(), 9)"
    process = started(work, tmp_path)
    os.kill(process.pid, signal.SIGTERM)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert said == "Error: interrupted; what was written is whole\n"


STOPPED_BESIDE = """
import os, signal
{name} = os.{name}
def stopped(*arguments):
    result = {name}(*arguments)
    if result and not stops:
        stops.append(signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGTERM)
    return result
stops = []
os.{name} = stopped
"""


@pytest.mark.parametrize("name", ["fork", "waitid"])
def test_a_stop_while_the_child_is_made_or_has_ended_reaches_both(name, tmp_path):
    work = "time.sleep(60)" if name == "fork" else "sys.exit(3)"
    process = started(work, tmp_path, before=STOPPED_BESIDE.format(name=name))
    _, said = process.communicate(timeout=60)
    if name == "fork":
        assert process.returncode == 128 + signal.SIGTERM
        assert said.startswith("Error: interrupted; ")
    else:
        assert (process.returncode, said) == (3, "")
    assert is_gone(process.pid)


def test_a_second_stop_ends_both_at_once(tmp_path):
    process = started(
        "\n    while True:\n        try: time.sleep(60)\n        except: pass", tmp_path
    )
    os.kill(process.pid, signal.SIGTERM)
    time.sleep(1)
    os.kill(process.pid, signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert is_gone(process.pid)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems don't tell a child")
def test_a_parent_that_is_killed_takes_the_child_with_it(tmp_path):
    process = started("time.sleep(60)", tmp_path)
    process.kill()
    process.communicate(timeout=60)
    assert is_gone(process.pid)


def test_want_of_memory_is_exit_4_and_one_line(tmp_path):
    process = started("len(b'x' * (3 << 30))", tmp_path)
    output, said = process.communicate(timeout=60)
    assert (process.returncode, output) == (4, "")
    assert said.startswith("Error: out of memory; ")
    assert said.count("\n") == 1


@pytest.mark.parametrize("limit", ["-v 1500000", "-t 300", "-S -v 1500000"])
def test_limits_that_are_lower_already_stay(limit, fixtures_store):
    program = Path(sys.executable).parent / "mocapidx"
    for command in ("info", "verify"):
        words = f'ulimit {limit}; exec "$0" --untrusted {command} "$1"'
        done = subprocess.run(
            ["sh", "-c", words, program, fixtures_store],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert done.returncode == 0, done.stderr


def test_the_flag_after_a_value_that_looks_like_a_command_is_refused(mocapidx, fixtures_store):
    done = mocapidx("--config", "info", "--untrusted", "info", fixtures_store)
    assert done.returncode == 2
    assert done.stderr.startswith("Error: --untrusted must be the first option")
