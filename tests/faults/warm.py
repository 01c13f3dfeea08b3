"""Run the program and end it by a signal at some moment: ``python -m tests.faults.warm WORK``.

This process imports what the commands need and forks a copy of itself for each job, so that a run
costs what the command itself costs. A job is a line of the standard input and its answer one of
the standard output, both as `tests.faults.killing` writes and reads them. What the command says
goes to the file `err` in WORK; what it has acknowledged, a byte for each, to the file `acks`.
"""

import functools
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path

from mocapidx.errors import Interrupted
from mocapidx_cli.main import main
from tests.faults.program import import_program

PROGRAM = Path(sys.executable).parent / "mocapidx"
HANGS = 60  # seconds; far more than any command takes here
BATCH = 20_000  # bytes of words and poses: two or three takes
CELLS = 500  # of grids
BLOCK = 40  # frames of takes that are compared at once
MOST_FILES = 4
MOST_FRAMES = 120  # of merged files: four takes
PER_WORKER = 4


def work_in_small_steps():
    """Let commands commit after a few documents, and start workers for a few items."""
    from mocapidx.tasks import compact, index, reindex, web, web_building

    index.IndexOptions = functools.partial(index.IndexOptions, batch_bytes=BATCH)
    index.MOST_SEGMENT_FILES = MOST_FILES
    index.JOBS_PER_WORKER = PER_WORKER
    compact.MOST_FRAMES = MOST_FRAMES
    reindex.reindex_store = functools.partial(reindex.reindex_store, batch_bytes=BATCH)
    web.WebOptions = functools.partial(web.WebOptions, batch_cells=CELLS)
    web.JOB_CELLS = CELLS
    web_building.BLOCK_FRAMES = BLOCK


def acknowledge(tell):
    """Let everything that says to its caller "this is on disk" say so to us too."""
    from mocapidx.store.write import Writer
    from mocapidx.tasks import learn, web_building

    for place, name in (
        (Writer, "commit"),
        (Writer, "replace"),
        (Writer, "adopt"),
        (web_building, "write_web"),
        (learn, "save_templates"),
    ):
        setattr(place, name, telling(getattr(place, name), tell))


def telling(call, tell):
    @functools.wraps(call)
    def told(*args, **options):
        done = call(*args, **options)
        tell()
        return done

    return told


def tell(acks, kept):
    """Say that something is on disk; where it is wanted, keep a copy of what is there now."""
    os.write(acks, b".")
    if kept:
        target, folder = map(Path, kept)
        copy = folder / f"{os.fstat(acks).st_size}" / target.name
        copy.parent.mkdir()
        (shutil.copytree if target.is_dir() else shutil.copy)(target, copy)


def serve(work):
    import_program()
    work_in_small_steps()
    for line in sys.stdin:
        job = json.loads(line)
        (work / "acks").write_bytes(b"")
        child = start_program(work, job) if job["program"] else start_copy(work, job)
        answer = watch(child, job)
        answer["said"] = (work / "err").read_text(errors="replace")
        answer["acknowledged"] = (work / "acks").stat().st_size
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


def start_program(work, job):
    """Start the installed program, as a shell would; it works in large steps."""
    with (work / "err").open("wb") as err:
        started = subprocess.Popen(
            [PROGRAM, *job["words"]],
            cwd=job["world"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=err,
            start_new_session=True,
        )
    started.returncode = 0  # we wait for it ourselves
    return started.pid


def start_copy(work, job):
    ready, tell_ready = os.pipe()
    child = os.fork()
    if not child:
        os.close(ready)
        be_program(work, job, tell_ready)
    os.close(tell_ready)
    os.read(ready, 1)
    os.close(ready)
    return child


def be_program(work, job, ready):
    """Be the program, until it ends."""
    code = 99
    try:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.setsid()
        os.chdir(job["world"])
        acks = os.open(work / "acks", os.O_WRONLY | os.O_APPEND)
        take_streams(os.devnull, work / "err")
        acknowledge(functools.partial(tell, acks, job["kept"]))
        os.write(ready, b".")
        code = main_code(job["words"])
    except BaseException:
        traceback.print_exc()
    finally:
        try:
            sys.stderr.flush()
        finally:
            os._exit(code)  # even if the signal comes only now


def take_streams(out, err):
    """Let files be the standard streams of this process."""
    writing = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    files = (os.open(os.devnull, os.O_RDONLY), os.open(out, writing), os.open(err, writing))
    for place, file in enumerate(files):
        os.dup2(file, place)
    sys.stdin, sys.stdout, sys.stderr = (os.fdopen(n, m) for n, m in enumerate("rww"))


def main_code(words):
    """Be the program, and give its exit code."""
    sys.argv, code = ["mocapidx", *words], 99
    try:
        try:
            main()
        except SystemExit as exc:
            code = exc.code or 0
    except Interrupted:
        pass  # the program had ended; what is left of it here is ours
    return code


def watch(child, job):
    """Send the signal when it is time, wait for the end, and for that of everybody it started."""
    begin, sent = time.monotonic(), 0.0
    ended = select.poll()
    handle = os.pidfd_open(child)
    ended.register(handle, select.POLLIN)
    if job["signal"] and not ended.poll(1000 * max(job["delay"], 0.0005)):
        sent = time.monotonic()
        os.kill(child, job["signal"])
    hung = not ended.poll(1000 * HANGS)
    end = time.monotonic()
    if hung:
        os.killpg(child, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    os.close(handle)
    return {
        "code": "hung" if hung else code,
        "seconds": end - begin,
        "slow": end - sent if sent else 0.0,
        "left": lasting(child),
    }


def lasting(session):
    """Count the processes of a session that don't end by themselves."""
    give_up = time.monotonic() + HANGS
    while (found := members(session)) and time.monotonic() < give_up:
        time.sleep(0.01)
    for process in found:
        os.kill(process, signal.SIGKILL)
    return len(found)


def members(session):
    found = []
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            of = os.getsid(int(name))
            state = Path(f"/proc/{name}/stat").read_text().rpartition(")")[2].split()[0]
        except (ProcessLookupError, FileNotFoundError):
            continue
        if of == session and state != "Z":
            found.append(int(name))
    return found


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    serve(Path(sys.argv[1]))
