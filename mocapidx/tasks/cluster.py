"""Map a function over many items on a Dask cluster; the one module that knows Dask.

The shape is that of `mocapidx.tasks.parallel`: results come in the order of the items, what runs
ahead of the consumer is bounded, and the client alone writes. A task that a lost worker had is
given to another one; what a task raises is raised here. An item may say its `weight` in bytes,
by which small ones travel together, and the `path` of the file that its worker has to see.
"""

import logging
import os
import re
import socket
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from multiprocessing import resource_tracker
from typing import Any, Final

from mocapidx.errors import MocapidxError, ParameterError
from mocapidx.printable import count, shown
from mocapidx.tasks.parallel import MapFunction, deaf

__all__ = ["cluster_mapping"]

LOCAL: Final = re.compile(r"local:([1-9][0-9]{0,3})", re.ASCII)
ADDRESS: Final = re.compile(r"(?!local:)(?:[a-z]+://)?[^\s/]+:[0-9]{1,5}", re.ASCII)

AHEAD: Final = 3
"""Tasks a thread of the cluster that are under way or done before their turn."""

TASK_BYTES: Final = 4 << 20
"""Small items travel together until they weigh as much, so that a task outweighs its message."""

MOST_ITEMS: Final = 64
CONNECT_SECONDS: Final = 10
PATIENCE: Final = 30
"""Seconds without a result after which we look whether there is any worker left."""

LOOK_SECONDS: Final = 2.0
"""Seconds after which we look how many threads there are: queues start workers one by one."""

SETTINGS: Final = {
    "distributed.comm.timeouts.connect": f"{CONNECT_SECONDS}s",
    "distributed.comm.retry.count": 2,
    "distributed.scheduler.allowed-failures": 3,
    "distributed.admin.log-length": 100,
    "distributed.admin.large-graph-warning-threshold": "1TB",
    # Nothing lies about in a worker that could be moved to disk; one that is over its limit is
    # ended before the machine suffers, but never put to sleep with its work.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    # Dask's own choice, MALLOC_TRIM_THRESHOLD_, gives each array's memory back at once: half the
    # time then goes into getting it again.
    "distributed.nanny.pre-spawn-environ": {"OPENBLAS_NUM_THREADS": 1, "OMP_NUM_THREADS": 1},
    "distributed.worker.profile.enabled": False,
    "distributed.worker.preload": ["import os; os.dup2(os.open(os.devnull, os.O_WRONLY), 2)"],
}
"""Of a cluster on this machine. Its workers have no word: some of theirs come as they end."""

CHATTY: Final = ("distributed", "tornado", "asyncio")
"""What they have to say we say in one line."""


@contextmanager
def cluster_mapping(scheduler: str) -> Iterator[MapFunction]:
    """Give a map function that works on a cluster.

    Parameters
    ----------
    scheduler : str
        The address of a Dask scheduler, such as ``tcp://head:8786``, whose workers have this
        version of mocapidx and see the same files under the same names; or ``local:N``, N
        processes on this machine.

    Yields
    ------
    callable
        Like ``map``.

    Raises
    ------
    ParameterError
        If `scheduler` is neither, Dask is not installed, nothing answers there, or its workers
        can't do this work.
    MocapidxError
        If the scheduler is lost, or all workers are, or a task's workers die again and again.
    """
    local = LOCAL.fullmatch(scheduler)
    if not local and not ADDRESS.fullmatch(scheduler):
        raise ParameterError(
            f"'{shown(scheduler)}' is no scheduler; give an address such as tcp://head:8786, "
            "or local:N for N processes here"
        )
    try:
        import dask
        import distributed
    except ImportError as exc:
        raise ParameterError(
            "--scheduler needs Dask; install it with: pip install 'mocapidx[cluster]'"
        ) from exc
    if not local:
        _check_address(scheduler, distributed)
    make_cluster: Any = distributed.LocalCluster
    connect: Any = distributed.Client
    for name in {*CHATTY, *logging.root.manager.loggerDict}:
        if name.partition(".")[0] in CHATTY:  # some of their children have levels of their own
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    under_way: list[Generator[Any, None, None]] = []
    resource_tracker.ensure_running()  # it would take our signal mask away from the first worker
    with dask.config.set(SETTINGS):
        cluster = None
        try:
            # Ctrl-C reaches the whole group; we stop the workers ourselves.
            with deaf(), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of other versions of Dask
                if local:
                    cluster = make_cluster(
                        n_workers=int(local[1]),
                        threads_per_worker=1,
                        dashboard_address="127.0.0.1:0",
                        scheduler_kwargs={"dashboard": False},
                        silence_logs=logging.CRITICAL + 1,
                    )
                client = connect(cluster or scheduler, timeout=CONNECT_SECONDS)
        except BaseException as exc:
            if cluster is not None:
                with deaf():
                    cluster.close()
            if isinstance(exc, OSError) and not local:
                raise ParameterError(
                    f"{shown(scheduler)}: no scheduler answers there ({type(exc).__name__}); "
                    "start one with 'dask scheduler'"
                ) from exc
            if not isinstance(exc, (OSError, RuntimeError)):
                raise
            raise MocapidxError(
                f"{shown(scheduler)}: no cluster could be started here ({shown(exc)}); "
                "--jobs does the same work without one"
            ) from exc

        def apply(function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
            under_way.append(_results(client, scheduler, function, items))
            return under_way[-1]

        try:
            with _explained(scheduler):
                _check_workers(client, scheduler)
            yield apply
        finally:
            with deaf():
                for results in under_way:
                    results.close()
                with suppress(Exception):
                    client.close(timeout=CONNECT_SECONDS)
                if cluster is not None:
                    with suppress(Exception):
                        cluster.close(timeout=CONNECT_SECONDS)


def _check_workers(client: Any, scheduler: str) -> None:
    """Refuse to begin where nobody would work, or somebody with another version."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_SECONDS)
    except TimeoutError as exc:
        raise ParameterError(
            f"{shown(scheduler)}: no worker has joined it; start some with 'dask worker "
            f"{shown(scheduler)}' where mocapidx is installed"
        ) from exc
    for worker, answer in client.run(_own_version, on_error="return").items():
        if answer != _own_version():
            found = "none" if isinstance(answer, BaseException) else f"mocapidx {shown(answer)}"
            raise ParameterError(
                f"{shown(scheduler)}: {_other_version(shown(worker), found, _own_version())}"
            )


def _other_version(worker: str, found: str, wanted: str) -> str:
    return (
        f"the worker {worker} needs mocapidx {wanted} as here, it has {found}; install the same "
        "version where the workers run"
    )


@cache
def _own_version() -> str:
    return version("mocapidx")


@dataclass(frozen=True, slots=True)
class _Answer:
    """The result for an item, or the exception; and where its file was not to be seen."""

    good: bool
    result: Any
    blind: str = ""


def _check_address(scheduler: str, distributed: Any) -> None:
    """Refuse what Dask can't connect to: a client left half made could hold up the next one."""
    try:
        distributed.comm.get_address_host_port(scheduler)
        if scheduler.startswith("tls:"):
            given = distributed.Security().get_connection_args("client")
            if given.get("ssl_context") is None:
                raise ValueError("its configuration has no certificates")
    except ValueError as exc:
        raise ParameterError(
            f"{shown(scheduler)}: Dask can't connect to that ({shown(exc)}); expected an address "
            "such as tcp://HOST:8786"
        ) from exc


def _results(
    client: Any, scheduler: str, function: Callable[[Any], Any], items: Iterable[Any]
) -> Generator[Any, None, None]:
    """Yield the results in the order of the items."""
    tasks = _together(items)
    waiting: deque[tuple[Any, Sequence[Any]]] = deque()
    room, looked = 0, -LOOK_SECONDS
    try:
        while True:
            if time.monotonic() - looked >= LOOK_SECONDS:  # workers come and go
                with _explained(scheduler, waiting):
                    room = AHEAD * max(sum(client.nthreads().values()), 1)
                looked = time.monotonic()
            while len(waiting) < room and (group := next(tasks, None)) is not None:
                with _explained(scheduler):
                    task = client.submit(_work, _own_version(), function, group, pure=False)
                waiting.append((task, group))
            if not waiting:
                return
            with _explained(scheduler, waiting):
                answers = _awaited(client, scheduler, waiting[0][0])
            group = waiting.popleft()[1]
            for item, answer in zip(group, answers, strict=False):  # up to the first that failed
                _check_seen(item, answer)
                if not answer.good:
                    raise answer.result
                yield answer.result
    finally:
        with suppress(Exception):
            client.cancel([task for task, _ in waiting], force=True)


def _awaited(client: Any, scheduler: str, task: Any) -> Sequence[_Answer]:
    """Wait for a task as long as there is somebody who could do it."""
    while True:
        with suppress(TimeoutError):
            answers: Sequence[_Answer] = task.result(timeout=PATIENCE)
            return answers
        if not client.nthreads():
            raise MocapidxError(
                f"{shown(scheduler)}: no worker is left; what was committed stays, start workers "
                "and run again to continue"
            )


def _together(items: Iterable[Any]) -> Iterator[Sequence[Any]]:
    """Group neighbours by the bytes that they weigh; what has no weight goes alone."""
    group: list[Any] = []
    weight = 0
    for item in items:
        group.append(item)
        weight += getattr(item, "weight", TASK_BYTES)
        if weight >= TASK_BYTES or len(group) == MOST_ITEMS:
            yield group
            group, weight = [], 0
    if group:
        yield group


def _work(wanted: str, function: Callable[[Any], Any], items: Sequence[Any]) -> list[_Answer]:
    """Apply a function to some items, up to the first that fails; runs in a worker."""
    if wanted != _own_version():  # it may have joined later
        found = f"mocapidx {_own_version()}"
        raise MocapidxError(_other_version(f"on {socket.gethostname()}", found, wanted))
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    answers: list[_Answer] = []
    for item in items:
        path = getattr(item, "path", None)
        blind = "" if path is None or os.path.lexists(path) else socket.gethostname()
        try:
            answers.append(_Answer(True, function(item), blind))
        except Exception as exc:
            answers.append(_Answer(False, exc, blind))
            break
    return answers


def _check_seen(item: Any, answer: _Answer) -> None:
    """Tell a file that is gone from one that only a worker can't see."""
    if answer.blind and os.path.lexists(item.path):
        raise ParameterError(
            f"{shown(item.path)}: the worker on {shown(answer.blind)} can't see it; workers need "
            "the same files under the same names"
        )


@contextmanager
def _explained(scheduler: str, waiting: Sequence[tuple[Any, Sequence[Any]]] = ()) -> Iterator[None]:
    """Say in one line what became of the cluster."""
    from distributed import CancelledError, KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        yield
    except KilledWorker as exc:
        raise MocapidxError(
            f"workers died again and again over {_named(waiting[0][1])}, perhaps for want of "
            "memory; run again with workers that may use more of it"
        ) from exc
    except (CancelledError, CommClosedError, OSError, TimeoutError) as exc:
        raise MocapidxError(
            f"{shown(scheduler)}: the scheduler was lost; what was committed stays, run again "
            "to continue"
        ) from exc
    except (ImportError, AttributeError) as exc:  # what the task is made of is not there
        raise MocapidxError(
            f"{shown(scheduler)}: {_other_version('that joined', 'not all of it', _own_version())}"
        ) from exc


def _named(items: Sequence[Any]) -> str:
    """Name what a task was about."""
    path = getattr(items[0], "path", None)
    if path is None:
        return "the same work"
    return shown(path) + (f" and {count(len(items) - 1, 'more file')}" if len(items) > 1 else "")
