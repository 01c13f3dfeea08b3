"""Run the program again and again with a fault each: ``python -m tests.faults.served WORK``.

The library of `faultpoints.c` is loaded before this process, which imports what the commands need
and forks a copy of itself for each job, so that a run costs what the command itself costs. A job
is a line of the standard input: the folder of the world, the words of the command line, the kind
of fault, the call that meets it, and the folder for what is synced, or "". The answer is a line of
the standard output. What the command itself prints goes to the files `out` and `err` in WORK.
"""

import ctypes
import json
import os
import sys
from pathlib import Path

from tests.faults.program import be_program, import_program

KINDS = ("none", "kill", "torn", "full", "broken", "interrupted", "short")


def serve(work):
    library = ctypes.CDLL(None)
    library.faultpoints_calls.restype = ctypes.c_long
    library.faultpoints_line.restype = ctypes.c_char_p
    library.faultpoints_line.argtypes = [ctypes.c_long]
    library.faultpoints_arm.argtypes = [
        ctypes.c_char_p, ctypes.c_int, ctypes.c_long, ctypes.c_char_p,
    ]  # fmt: skip
    import_program()
    for line in sys.stdin:
        world, words, kind, point, synced = json.loads(line)
        child = os.fork()
        if not child:
            run(library, work, world, words, (KINDS.index(kind), point, os.fsencode(synced)))
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        calls = library.faultpoints_calls()
        lines = [library.faultpoints_line(number).decode() for number in range(calls)]
        answer = [code, lines, (work / "err").read_text(errors="replace")]
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


def run(library, work, world, words, fault):
    """Be the program, until it ends."""
    os.chdir(world)
    nothing = os.open(os.devnull, os.O_RDONLY)
    out, err = (
        os.open(work / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC) for name in ("out", "err")
    )
    for place, file in enumerate((nothing, out, err)):
        os.dup2(file, place)
    library.faultpoints_arm(os.fsencode(world), *fault)
    be_program(words)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
