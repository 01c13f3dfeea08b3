"""Run a command and print its seconds, processor seconds, peak kilobytes and exit code.

A process of its own, since a child inherits the peak of the process that it was spawned by.
"""

import os
import sys
import time


def main() -> None:
    """Take where its output goes and the command from the command line."""
    write = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    actions = [
        (os.POSIX_SPAWN_OPEN, 1, sys.argv[1], write, 0o644),
        (os.POSIX_SPAWN_OPEN, 2, os.devnull, write, 0o644),
    ]
    started = time.perf_counter()
    child = os.posix_spawn(sys.argv[2], sys.argv[2:], os.environ, file_actions=actions)
    _, status, used = os.wait4(child, 0)
    seconds = time.perf_counter() - started
    code = os.waitstatus_to_exitcode(status)
    print(seconds, used.ru_utime + used.ru_stime, used.ru_maxrss, code)


if __name__ == "__main__":
    main()
