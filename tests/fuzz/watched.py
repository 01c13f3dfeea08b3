"""A process that libFuzzer drives: ``python -m tests.fuzz.watched ENTRY FOUND [OPTION...]``.

What it finds goes to the folder FOUND, once for each place in the code, and it goes on. What ends
the process, such as a fault that a sanitizer sees, a hang or too much memory, libFuzzer itself puts
there. Options are those of libFuzzer.
"""

import hashlib
import importlib
import pkgutil
import shlex
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

import atheris

MEMORY = Path("/dev/shm")  # files are written and read thousands of times a second

SECONDS = 3  # of the processor, with sanitizers


def main():
    name, found = sys.argv[1], Path(sys.argv[2])
    judge = instrumented()
    warnings.simplefilter("error")
    work = Path(tempfile.mkdtemp(dir=MEMORY if MEMORY.is_dir() else None))

    def try_one(data):
        begin = time.process_time()
        try:
            judge(name, data, work)
            spent = time.process_time() - begin
            assert spent < SECONDS, f"{spent:.1f} s"
        except Exception as exc:
            keep(found, data, exc)

    try:
        # libFuzzer begins a process of its own to merge, by what it takes for its command.
        command = shlex.join([sys.executable, "-P", "-m", "tests.fuzz.watched", *sys.argv[1:3]])
        atheris.Setup([command, *sys.argv[3:]], try_one)
        atheris.Fuzz()
    finally:
        shutil.rmtree(work, ignore_errors=True)


def instrumented():
    """Import mocapidx with counters in it; give the function that judges."""
    with atheris.instrument_imports(include=["mocapidx"], enable_loader_override=False):
        from mocapidx import formats, kernels
        from tests.fuzz.entries import judge

        # Some are imported only when they are needed, and would then have no counters.
        for package in (formats, kernels):
            for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
                importlib.import_module(module.name)
    return judge


def keep(found, data, exc):
    """Keep what broke a reader, unless there is one already that did so in the same place."""
    frames = traceback.extract_tb(exc.__traceback__)[-3:]
    places = [type(exc).__name__, *(f"{frame.filename}:{frame.lineno}" for frame in frames)]
    path = found / f"exception-{hashlib.md5(' '.join(places).encode()).hexdigest()[:8]}"
    if not path.exists():
        path.write_bytes(data)
        path.with_suffix(".txt").write_text("".join(traceback.format_exception(exc)))


if __name__ == "__main__":
    main()
