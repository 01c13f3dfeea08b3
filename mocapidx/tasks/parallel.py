"""Map a function over many items: here, or in processes that die with us."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeAlias

from mocapidx.errors import MocapidxError

__all__ = ["MapFunction", "mapping"]

MapFunction: TypeAlias = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]
"""The shape of the built-in ``map``: results come in the order of the items."""

QUEUED_PER_WORKER = 4  # enough to keep workers busy, few enough to bound the waiting results


@contextmanager
def mapping(jobs: int) -> Iterator[MapFunction]:
    """Give a map function that works in `jobs` processes; one job: in this one.

    Parameters
    ----------
    jobs : int
        Processes, from 1.

    Yields
    ------
    callable
        Like ``map``; what runs ahead of the consumer is bounded.

    Raises
    ------
    MocapidxError
        If a worker process dies.
    """
    if jobs == 1:
        yield map
        return
    with _deaf():
        executor = ProcessPoolExecutor(
            jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_follow_parent
        )
    try:
        yield lambda function, items: _ordered(executor, function, items, jobs)
        executor.shutdown()
    except BrokenProcessPool as exc:
        raise MocapidxError(
            "a worker process died, perhaps for want of memory; run again with fewer --jobs"
        ) from exc
    finally:
        for child in multiprocessing.active_children():
            child.kill()
        executor.shutdown(wait=False, cancel_futures=True)


def _ordered(
    executor: ProcessPoolExecutor,
    function: Callable[[Any], Any],
    items: Iterable[Any],
    jobs: int,
) -> Iterator[Any]:
    waiting: deque[Future[Any]] = deque()
    for item in items:
        waiting.append(_submit(executor, function, item))
        if len(waiting) > jobs * QUEUED_PER_WORKER:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def _submit(
    executor: ProcessPoolExecutor, function: Callable[[Any], Any], item: Any
) -> Future[Any]:
    with _deaf():  # the first ones start the workers
        return executor.submit(function, item)


@contextmanager
def _deaf() -> Iterator[None]:
    """Block the signals that stop us; processes started here inherit that.

    Ctrl-C and a lost terminal reach every process of the group. We stop the others ourselves.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _follow_parent() -> None:
    """End this worker when its parent is gone, however that came about."""

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
