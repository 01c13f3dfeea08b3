"""Go on in a child with limits: what breaks or exhausts the child doesn't break its parent."""

import os
import resource
from typing import Final

from mocapidx.errors import Interrupted, StoreError

__all__ = ["MEMORY", "SECONDS", "in_limited_child"]

MEMORY: Final = 2 << 30
"""Bytes of address space."""
SECONDS: Final = 600
"""Seconds of processor time."""


def in_limited_child(memory: int = MEMORY, seconds: int = SECONDS) -> int | None:
    """Fork; the child gets limits and goes on, the parent waits for its end.

    To be called before there are threads, and before anything of a store or a file is read.

    Parameters
    ----------
    memory : int
        Bytes of address space that the child may have.
    seconds : int
        Seconds of processor time that it may take.

    Returns
    -------
    None
        In the child.
    int
        In the parent: the child's exit code.

    Raises
    ------
    StoreError
        In the parent, if the child crashed, ran out of memory or out of time.
    Interrupted
        In the parent, after the child got the same signal and ended.
    """
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        return None
    try:
        code = _ending(child)
    except Interrupted as exc:
        os.kill(child, exc.signal_number)
        code = _ending(child)
        if code == 128 + exc.signal_number:  # the child has said what was done
            return code
        raise
    if code < 0 or code == 1:
        fate = "failed" if code == 1 else f"was ended by signal {-code}"
        raise StoreError(
            f"the process that was to read untrusted files {fate}: they are damaged, or need more "
            f"than {memory >> 30} GiB of memory or {seconds} s; nothing was changed"
        )
    return code


def _ending(child: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
