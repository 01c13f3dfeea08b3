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
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from queue import SimpleQueue
from typing import Any, Final, TypeAlias

from mocapidx.errors import MocapidxError

__all__ = ["MapFunction", "deaf", "mapping"]

MapFunction: TypeAlias = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]
"""The shape of the built-in ``map``: results come in the order of the items."""

AHEAD: Final = 4
"""Items a worker that are under way or done before their turn; bounds the waiting results."""

DEPTH: Final = 2
"""Items that a worker is sent before it has answered: it never waits for the next one."""

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
    done: dict[int, tuple[bool, Any]] = {}
    turn = under_way = 0
    resource_tracker.ensure_running()  # it would take our signal mask away from the first worker
    try:
        while True:
            while under_way < jobs * DEPTH and under_way + len(done) < jobs * AHEAD:
                number, item = next(numbered, (-1, None))
                if number < 0:
                    break
                if all(worker.turns for worker in workers) and len(workers) < jobs:
                    with deaf():  # not one may be started and then forgotten
                        workers.append(_Worker(function))
                worker = min(workers, key=lambda worker: len(worker.turns))
                worker.send(number, item)
                under_way += 1
            busy = {worker.pipe: worker for worker in workers if worker.turns}
            for pipe in wait(list(busy), 0 if turn in done else None) if busy else ():
                number, good, result = busy[pipe].receive()  # type: ignore[index]
                done[number] = good, result
                under_way -= 1
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
        self.turns: deque[int] = deque()  # what it has been sent and has not answered
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

    def send(self, number: int, item: Any) -> None:
        with _mourned():
            self.pipe.send(item)
        self.turns.append(number)

    def receive(self) -> tuple[int, bool, Any]:
        """Return which item it was, whether it went well, and the result or else the exception."""
        with _mourned():
            good, result = self.pipe.recv()
        return self.turns.popleft(), good, result

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
    items: SimpleQueue[tuple[Any, ...]] = SimpleQueue()
    threading.Thread(target=_receive, args=(pipe, items), daemon=True).start()
    with contextlib.suppress(OSError, MemoryError):  # our end says enough to our parent
        while received := items.get():
            try:
                answer = True, function(*received)
            except Exception as exc:
                exc.add_note(traceback.format_exc())
                answer = False, exc
            pipe.send(answer)


def _receive(pipe: Connection, items: "SimpleQueue[tuple[Any, ...]]") -> None:
    """Take items as they come, so that who sends one never waits for who sends a large result."""
    try:
        with contextlib.suppress(EOFError, OSError, MemoryError):
            while True:
                items.put((pipe.recv(),))
    finally:
        items.put(())


def _follow_parent() -> None:
    """End this worker when its parent is gone, however that came about."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
