"""Map a function over many items on a Dask cluster; the one module that knows Dask.

The shape is that of `mocapidx.tasks.parallel`: results come in the order of the items, what runs
ahead of the consumer is bounded, and the client alone writes. A task that a lost worker had is
given to another one; what a task raises is raised here.
"""

import logging
import os
import re
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Final

from mocapidx.errors import MocapidxError, ParameterError
from mocapidx.printable import shown
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
SETTINGS: Final = {
    "distributed.comm.timeouts.connect": f"{CONNECT_SECONDS}s",
    "distributed.comm.retry.count": 2,
    "distributed.scheduler.allowed-failures": 3,
    "distributed.scheduler.worker-ttl": "60s",
    "distributed.admin.log-length": 100,
}


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
        If `scheduler` is neither, Dask is not installed, or nothing answers there.
    MocapidxError
        If the scheduler is lost, or a task's workers die again and again.
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
    make_cluster: Any = distributed.LocalCluster
    connect: Any = distributed.Client
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    under_way: list[Generator[Any, None, None]] = []
    with dask.config.set(SETTINGS):
        cluster = None
        try:
            with deaf():  # Ctrl-C reaches the whole group; we stop the workers ourselves
                if local:
                    cluster = make_cluster(
                        n_workers=int(local[1]),
                        threads_per_worker=1,
                        dashboard_address=None,
                        silence_logs=logging.CRITICAL,
                    )
                client = connect(cluster or scheduler, timeout=CONNECT_SECONDS)
        except (OSError, TimeoutError) as exc:
            raise ParameterError(
                f"{shown(scheduler)}: no scheduler answers there ({type(exc).__name__}); start "
                "one with 'dask scheduler'"
            ) from exc

        def apply(function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
            under_way.append(_results(client, scheduler, function, items))
            return under_way[-1]

        try:
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


def _results(
    client: Any, scheduler: str, function: Callable[[Any], Any], items: Iterable[Any]
) -> Generator[Any, None, None]:
    """Yield the results in the order of the items."""
    tasks = _together(items)
    waiting: deque[Any] = deque()
    try:
        while True:
            with _explained(scheduler):
                room = AHEAD * max(sum(client.nthreads().values()), 1)
                while len(waiting) < room and (group := next(tasks, None)) is not None:
                    waiting.append(client.submit(_work, function, group, pure=False))
                if not waiting:
                    return
                answers = waiting.popleft().result()
            for good, result in answers:
                if not good:
                    raise result
                yield result
    finally:
        with suppress(Exception):
            client.cancel(list(waiting), force=True)


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


def _work(function: Callable[[Any], Any], items: Sequence[Any]) -> list[tuple[bool, Any]]:
    """Apply a function to some items, up to the first that fails; runs in a worker."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    answers: list[tuple[bool, Any]] = []
    for item in items:
        try:
            answers.append((True, function(item)))
        except Exception as exc:
            answers.append((False, exc))
            break
    return answers


@contextmanager
def _explained(scheduler: str) -> Iterator[None]:
    """Say in one line what became of the cluster."""
    from distributed import CancelledError, KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        yield
    except KilledWorker as exc:
        raise MocapidxError(
            "workers died again and again over the same files, perhaps for want of memory; run "
            "again with workers that may use more of it"
        ) from exc
    except (CancelledError, CommClosedError, OSError, TimeoutError) as exc:
        raise MocapidxError(
            f"{shown(scheduler)}: the scheduler was lost; what was committed stays, run again "
            "to continue"
        ) from exc
