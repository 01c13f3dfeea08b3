"""Map a function over items in a few threads, for work that lets go of the interpreter's lock."""

import itertools
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Final, TypeVar

__all__ = ["map_ahead", "thread_count"]

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST: Final = 4
"""Threads; what is under way is held in memory."""


def thread_count() -> int:
    """Return how many threads are worth starting: one a usable core, four at most."""
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), MOST)
    return min(os.cpu_count() or 1, MOST)


def map_ahead(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Map like the built-in ``map``, with as many items under way as there are threads.

    Parameters
    ----------
    function : callable
        Called in any thread.
    items : iterable
        Taken from in the caller's thread, one more than there are threads ahead; a single item
        starts no thread.

    Yields
    ------
    object
        The results in the order of the items.
    """
    threads, given = thread_count(), iter(items)
    first = list(itertools.islice(given, 2))
    if threads < 2 or len(first) < 2:
        yield from map(function, itertools.chain(first, given))
        return
    # Imported where it pays: a small store is searched in less time.
    from concurrent.futures import Future, ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        ahead: deque[Future[Result]] = deque()
        try:
            for item in itertools.chain(first, given):
                ahead.append(pool.submit(function, item))
                if len(ahead) > threads:
                    yield ahead.popleft().result()
            while ahead:
                yield ahead.popleft().result()
        finally:
            for waiting in ahead:
                waiting.cancel()
