"""The last words of a command that was stopped and has not said itself what it leaves."""

from mocapidx.durable import has_written

__all__ = ["WHOLE", "farewell"]

WHOLE = "interrupted; what was written is whole"


def farewell() -> str:
    """Say what a stop leaves.

    Returns
    -------
    str
        Whether this process has put files in place, or was about to.
    """
    return WHOLE if has_written() else "interrupted; nothing was written"
