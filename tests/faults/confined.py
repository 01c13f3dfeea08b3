"""Run the program again and again where writing is hard: ``python -m tests.faults.confined``.

A job is a line of the standard input, the name of one of the `JOBS` and its arguments; the answer
is a line of the standard output. What is mounted is mounted in a namespace of this process, so
that nobody else sees it and nothing of it is left. As in `served`, each run is a copy of a process
that has imported the program.
"""

import ctypes
import fcntl
import json
import os
import resource
import sys
from pathlib import Path

from tests.faults.program import be_program, import_program

NEW_MOUNTS, NEW_USERS = 0x20000, 0x10000000
READ_ONLY, REMOUNT, PRIVATE = 0x1, 0x20, 0x4000 | 0x40000
CAPABILITIES = 0x20080522
SAID = 1 << 20

system = ctypes.CDLL(None, use_errno=True)


def own_mounts():
    """Go where mounts are this process's own; tell whether that is allowed."""
    user, group = os.getuid(), os.getgid()
    if system.unshare(NEW_MOUNTS):
        if system.unshare(NEW_MOUNTS | NEW_USERS):
            return False
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"{user} {user} 1")
        Path("/proc/self/gid_map").write_text(f"{group} {group} 1")
    return system.mount(None, b"/", None, PRIVATE, None) == 0


def mount(folder, options, flags=0):
    """Mount a file system in memory, or give the one that is there other limits."""
    if system.mount(b"tmpfs", os.fsencode(folder), b"tmpfs", flags, options.encode()):
        raise OSError(ctypes.get_errno(), f"{folder}: mounting with {options} failed")


def remount(folder, options, read_only=False):
    mount(folder, options, REMOUNT | (READ_ONLY if read_only else 0))


def run(world, words, *, file_size=None, powerless=False, stdout=os.devnull):
    """Run the program in a copy of this process; give its exit code and what it said."""
    read, write = os.pipe()
    # A pipe is no file, so what is said is said whatever the limit for files.
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, SAID)
    child = os.fork()
    if not child:
        os.chdir(world)
        nothing = os.open(os.devnull, os.O_RDONLY)
        out = os.open(stdout, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for place, file in enumerate((nothing, out, write)):
            os.dup2(file, place)
        if powerless:
            give_up_power()
        if file_size is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))
        be_program(words)
    os.close(write)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with open(read, "rb") as said:
        return code, said.read().decode(errors="replace")


def give_up_power():
    """Let permissions hold for root, too."""
    header, nothing = (ctypes.c_uint32 * 2)(CAPABILITIES, 0), (ctypes.c_uint32 * 6)()
    if system.capset(header, nothing):
        os._exit(98)


JOBS = {"own_mounts": own_mounts, "mount": mount, "remount": remount, "run": run}


def serve():
    import_program()
    for line in sys.stdin:
        job, arguments, options = json.loads(line)
        sys.stdout.write(json.dumps(JOBS[job](*arguments, **options)) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    serve()
