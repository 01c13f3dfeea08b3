"""Fuzz readers of files, guided by coverage: ``python -m tests.fuzz.guided ENTRY... --seconds N``.

Without an ENTRY all of `tests.fuzz.entries` have their turn. What libFuzzer learns stays in
``build/fuzz/ENTRY/corpus``, what it finds in ``build/fuzz/ENTRY/found``; a further run goes on from
there. With kernels that ``make fuzz`` builds, sanitizers watch the compiled scanners, and the
branches in them count as those in Python do.
"""

import argparse
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

from tests.fuzz.entries import CORPUS, ENTRIES, NUMBERS

ROOT = Path(__file__).parents[2]
HEADER = ("entry", "seconds", "executions", "edges", "features", "findings")
PROGRESS = re.compile(r"^#(\d+)\s+\w+\s+cov: (\d+) ft: (\d+)", re.M)
# Short histories of what was set free: else most of the time goes into them.
SANITIZERS = (
    "detect_leaks=0:alloc_dealloc_mismatch=0:malloc_context_size=2:quarantine_size_mb=1"
    ":thread_local_quarantine_size_kb=64"
)
KEPT = "Test unit written to"
MOST_ENDS = 20  # of the process, where files end it
# Of time by the clock, and the machine may be busy: what is slow `tests.fuzz.watched` finds.
LIMITS = ("-timeout=100", "-rss_limit_mb=2048", "-malloc_limit_mb=512", "-detect_leaks=0")
LONGEST = 4096  # bytes of a file


def main():
    arguments = parsed()
    if importlib.util.find_spec("atheris") is None:
        sys.exit("fuzzing needs atheris: pip install -e '.[test,fuzz]'")
    if arguments.kernels and not list(arguments.kernels.glob("mocapidx/kernels/_text.*")):
        sys.exit(f"{arguments.kernels}: no kernels here; 'make fuzz' builds them")
    names, failed = arguments.entry or ENTRIES, False
    if arguments.keep:
        for name in names:
            keep_few(name, arguments.work / name, arguments.kernels)
        return
    print(*HEADER, sep="\t", flush=True)
    for name in names:
        row = fuzz(name, arguments.work / name, arguments.kernels, arguments.seconds)
        print(*row, sep="\t", flush=True)
        if arguments.report:
            with arguments.report.open("a") as file:
                print(*row, sep="\t", file=file)
        failed |= row[-1] > 0
    sys.exit(failed)


def parsed():
    parser = argparse.ArgumentParser(description="Fuzz readers of files, guided by coverage.")
    parser.add_argument("entry", nargs="*", help=f"of {', '.join(ENTRIES)}; default: all, in turn")
    parser.add_argument("--seconds", type=int, default=60, help="for each")
    parser.add_argument("--kernels", type=Path, help="folder of a package that has sanitizers")
    parser.add_argument("--work", type=Path, default=ROOT / "build/fuzz", help="folder to work in")
    parser.add_argument("--report", type=Path, help="add a row for each to this table")
    parser.add_argument(
        "--keep", action="store_true",
        help="fuzz nothing; keep the fewest files that reach all that is reached until now",
    )  # fmt: skip
    arguments = parser.parse_args()
    for name in arguments.entry:
        if name not in ENTRIES:
            parser.error(f"no such entry: {name}; there are {', '.join(ENTRIES)}")
    return arguments


def fuzz(name, place, kernels, seconds):
    """Fuzz for so many seconds; give a row as `HEADER` has it.

    What ends the process does not end the run.
    """
    for folder in (place / "corpus", place / "found"):
        folder.mkdir(parents=True, exist_ok=True)
    words = [*ENTRIES[name].words.split(), *NUMBERS.split()]
    escaped = (word.replace("\\", "\\\\").replace('"', '\\"') for word in words)
    (place / "words").write_text("".join(f'"{word}"\n' for word in escaped))
    begin = time.monotonic()
    executions = edges = features = 0
    ends = 0
    while (left := seconds - (time.monotonic() - begin)) > 1 and ends < MOST_ENDS:
        ends += 1
        code, log = watch(
            name, place, kernels, f"-max_total_time={int(left)}", f"-dict={place / 'words'}",
            f"-max_len={LONGEST}", place / "corpus", CORPUS / name,
        )  # fmt: skip
        steps = PROGRESS.findall(log)
        if steps:
            executions += int(steps[-1][0])
            edges, features = max(edges, int(steps[-1][1])), max(features, int(steps[-1][2]))
        if code and KEPT not in log:
            sys.exit(f"{name}: fuzzing ended with code {code}:\n{log[-2000:]}")
    found = [path for path in (place / "found").iterdir() if path.suffix != ".txt"]
    return name, round(time.monotonic() - begin), executions, edges, features, len(found)


def watch(name, place, kernels, *options):
    """Run libFuzzer in a process of its own; give its code and what it printed."""
    variables = {
        "PYTHONPATH": os.pathsep.join(map(str, filter(None, (kernels, ROOT)))),
        "OPENBLAS_NUM_THREADS": "1",
    }
    if kernels:
        atheris = Path(importlib.util.find_spec("atheris").origin)
        variables |= {
            "LD_PRELOAD": str(atheris.parents[1] / "asan_with_fuzzer.so"),
            "ASAN_OPTIONS": SANITIZERS,
            "UBSAN_OPTIONS": "print_stacktrace=1",
            "PYTHONMALLOC": "malloc",
            "MOCAPIDX_KERNELS": "c",
        }
    found = place / "found"
    command = [
        sys.executable, "-P", "-m", "tests.fuzz.watched", name, found,
        f"-artifact_prefix={found}/", *LIMITS, *options,
    ]  # fmt: skip
    with (place / "log").open("w+b") as log:
        code = subprocess.call(command, env=os.environ | variables, stdout=log, stderr=log)
        log.seek(0)
        return code, log.read().decode(errors="replace")


def keep_few(name, place, kernels):
    """Let the corpus that is kept be the fewest, smallest files that reach every edge."""
    few = place / "few"
    shutil.rmtree(few, ignore_errors=True)
    few.mkdir(parents=True)
    code, log = watch(
        name, place, kernels, "-merge=1", "-use_counters=0", few, CORPUS / name, place / "corpus"
    )
    if code or not list(few.iterdir()):
        sys.exit(f"{name}: merging ended with code {code}:\n{log[-2000:]}")
    shutil.rmtree(CORPUS / name)
    shutil.copytree(few, CORPUS / name)


if __name__ == "__main__":
    main()
