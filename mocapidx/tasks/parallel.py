"""Map a function over many items: here, or in processes that die with us.

Each worker has a pipe of its own, and nobody else holds either end. One that dies, or is killed
in the middle of a result, is noticed by the end of its pipe; no lock or queue is left behind.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, Final, TypeAlias

from mocapidx.errors import MocapidxError

__all__ = ["MapFunction", "deaf", "mapping"]

MapFunction: TypeAlias = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]
"""The shape of the built-in ``map``: results come in the order of the items."""

AHEAD: Final = 4
"""Items a worker that are under way or done before their turn; bounds the waiting results."""

STOP_SIGNALS: Final = frozenset({signal.SIGINT, signal.SIGTERM, signal.SIGHUP})


@contextmanager
def mapping(jobs: int) -> Iterator[MapFunction]:
    """Give a map function that works in `jobs` processes; one job: in this one.

    Parameters
    ----------
    jobs : int
        Processes, from 1; no more are started than there are items.

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
    under_way: list[Generator[Any, None, None]] = []

    def apply(function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
        under_way.append(_results(function, items, jobs))
        return under_way[-1]

    try:
        yield apply
    finally:
        with deaf():
            for results in under_way:
                results.close()


def _results(
    function: Callable[[Any], Any], items: Iterable[Any], jobs: int
) -> Generator[Any, None, None]:
    """Yield the results in the order of the items."""
    numbered = enumerate(items)
    workers: list[_Worker] = []
    idle: list[_Worker] = []
    busy: dict[Connection, tuple[_Worker, int]] = {}
    done: dict[int, tuple[bool, Any]] = {}
    turn = 0
    resource_tracker.ensure_running()  # it would take our signal mask away from the first worker
    try:
        while True:
            while len(busy) < jobs and len(busy) + len(done) < jobs * AHEAD:
                number, item = next(numbered, (-1, None))
                if number < 0:
                    break
                if not idle:
                    with deaf():  # not one may be started and then forgotten
                        workers.append(_Worker(function))
                        idle.append(workers[-1])
                worker = idle.pop()
                worker.send(item)
                busy[worker.pipe] = worker, number
            for pipe in wait(list(busy), 0 if turn in done else None) if busy else ():
                worker, number = busy.pop(pipe)  # type: ignore[call-overload]
                done[number] = worker.receive()
                idle.append(worker)
            if turn in done:
                good, result = done.pop(turn)
                turn += 1
                if not good:
                    raise result
                yield result
            elif not busy:
                return
    finally:
        with deaf():
            for worker in workers:
                worker.end()


class _Worker:
    """A process that applies a function to one item after another."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        context = multiprocessing.get_context("spawn")
        with deaf():
            self.pipe, theirs = context.Pipe()
            self.process: SpawnProcess = context.Process(target=_work, args=(function, theirs))
            try:
                self.process.start()
            except OSError as exc:
                raise MocapidxError(
                    f"a worker process could not be started ({(exc.strerror or '').lower()}); "
                    "run again with fewer --jobs"
                ) from exc
            theirs.close()

    def send(self, item: Any) -> None:
        with _mourned():
            self.pipe.send(item)

    def receive(self) -> tuple[bool, Any]:
        """Return whether it went well, and the result or else the exception."""
        with _mourned():
            good, result = self.pipe.recv()
            return good, result

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


@contextmanager
def _mourned() -> Iterator[None]:
    try:
        yield
    except (EOFError, OSError) as exc:
        raise MocapidxError(
            "a worker process died, perhaps for want of memory; run again with fewer --jobs"
        ) from exc


@contextmanager
def deaf() -> Iterator[None]:
    """Put off the signals that stop us; processes started here never hear them.

    Ctrl-C and a lost terminal reach every process of the group. We stop the others ourselves.
    """
    held: list[int] = []
    handlers = {}
    if threading.current_thread() is threading.main_thread():  # where handlers run
        for number in STOP_SIGNALS:
            if signal.getsignal(number) not in (None, signal.SIG_IGN):
                handlers[number] = signal.signal(number, lambda number, _: held.append(number))
    # The mask is for the children; here a signal would just take another of our threads.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for held_number in held:
            signal.raise_signal(held_number)


def _work(function: Callable[[Any], Any], pipe: Connection) -> None:
    """Answer items until nobody sends any; runs in a worker."""
    threading.Thread(target=_follow_parent, daemon=True).start()
    with contextlib.suppress(EOFError, OSError):
        while True:
            item = pipe.recv()
            try:
                answer = True, function(item)
            except Exception as exc:
                exc.add_note(traceback.format_exc())
                answer = False, exc
            pipe.send(answer)


def _follow_parent() -> None:
    """End this worker when its parent is gone, however that came about."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
