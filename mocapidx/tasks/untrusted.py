"""Go on in a child with limits: what breaks or exhausts the child doesn't break its parent."""

import ctypes
import os
import resource
import select
import signal
import sys
from contextlib import suppress
from functools import partial
from types import FrameType
from typing import Final

from mocapidx.errors import Interrupted, StoreError
from mocapidx.store.limits import limit
from mocapidx.tasks.farewell import WHOLE

__all__ = ["MEMORY", "SECONDS", "in_limited_child"]

MEMORY: Final = 2 << 30
"""Bytes of address space."""
SECONDS: Final = 600
"""Seconds of processor time."""
PATIENCE: Final = 0.2
"""Seconds in which the child hears of a signal that reaches both of us."""
PR_SET_PDEATHSIG: Final = 1  # of Linux's prctl
STOP_SIGNALS: Final = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)


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
        In the parent: the child's exit code; 4 where the child has said that something failed
        that should not, such as a lack of memory.

    Raises
    ------
    StoreError
        In the parent, if the child crashed or ran out of time.
    Interrupted
        In the parent, if the child got the same signal and could not say what was done.
    """
    heard, hears = os.pipe()
    os.set_blocking(hears, False)
    # A stop between here and there would leave the child alone.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    parent = os.getpid()
    child = os.fork()
    if not child:
        _die_with(parent)
        limit(resource.RLIMIT_AS, memory)
        limit(resource.RLIMIT_CPU, seconds)
        limit(resource.RLIMIT_CORE, 0)
        signal.set_wakeup_fd(hears, warn_on_full_buffer=False)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        return None
    os.close(hears)
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        code = _ending(child)
    except Interrupted as exc:
        for number in STOP_SIGNALS:
            signal.signal(number, partial(_end_both, child))
        # Ctrl-C reaches us both; a second signal would end the child before it has cleaned up.
        if not select.select([heard], [], [], PATIENCE)[0]:
            os.kill(child, exc.signal_number)
        code = _ending(child)
        if code < 0:  # else the child has said what was done
            raise Interrupted(exc.signal_number, WHOLE) from exc
    finally:
        os.close(heard)
    if code < 0:
        raise StoreError(
            f"the process that was to read untrusted files was ended by signal {-code}: they are "
            f"damaged, or need more than {memory >> 30} GiB of memory or {seconds} s; what was "
            "saved is whole"
        )
    return StoreError.exit_code if code == 1 else code  # it has said why


def _ending(child: int) -> int:
    # Not reaped: after a stop at any moment the ending is still there to be asked for again.
    ended = os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)
    assert ended is not None  # we have waited
    return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status


def _die_with(parent: int) -> None:
    """Be killed when the parent is, if the system can do that."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(128 + signal.SIGKILL)


def _end_both(child: int, number: int, frame: FrameType | None) -> None:
    """End at once, as after a second signal; nobody is left behind."""
    with suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL)
    os._exit(128 + number)
