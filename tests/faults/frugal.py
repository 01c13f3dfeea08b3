"""Run a command with so much memory: ``python -S -E tests/faults/frugal.py BYTES OUT ERR COMMAND``.

Prints its exit code, its peak in bytes and its processor seconds. A process of its own that
loads little, since a child inherits the peak of the process that it was forked from.
"""

import json
import os
import resource
import sys


def main():
    limit, out, err, *words = sys.argv[1:]
    child = os.fork()
    if not child:
        # What is allocated counts, and not files that are mapped and can be dropped at any time.
        resource.setrlimit(resource.RLIMIT_DATA, (int(limit), int(limit)))
        for place, name in ((1, out), (2, err)):
            os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), place)
        os.execv(words[0], words)
    _, status, used = os.wait4(child, 0)
    code, seconds = os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime
    print(json.dumps([code, used.ru_maxrss * 1024, seconds]))


if __name__ == "__main__":
    main()
