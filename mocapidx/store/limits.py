"""What a process may use that reads files of strangers."""

import resource

__all__ = ["limit"]


def limit(kind: int, most: int) -> None:
    """Lower a limit of this process; one that is lower already stays.

    Only the soft limit: who goes beyond one of processor time is told why he ends, by SIGXCPU.

    Parameters
    ----------
    kind : int
        ``RLIMIT_...`` of the module `resource`.
    most : int
        In the unit of that limit.
    """
    soft, hard = resource.getrlimit(kind)
    ends = [end for end in (soft, hard, most) if end != resource.RLIM_INFINITY]
    resource.setrlimit(kind, (min(ends), hard))
