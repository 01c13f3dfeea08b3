"""Time functions and processes side by side, so that a drifting machine spoils no ratio."""

import contextlib
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mocapidx.kernels.choice import VARIABLE, compiled

__all__ = ["Cost", "Growth", "grow", "interleaved", "kernels", "run_process", "seconds_of"]


SPAWN = Path(__file__).with_name("spawn.py")


@dataclass(frozen=True)
class Cost:
    """What a process took: wall time and processor time in seconds, its peak in megabytes."""

    seconds: float
    processor: float
    megabytes: float


@dataclass(frozen=True)
class Growth:
    """Seconds for so many times the work, and the slope of the line through them in log-log."""

    times: tuple[int, ...]
    seconds: tuple[float, ...]

    @property
    def slope(self) -> float:
        """1: as much longer as there is more to do; 0: no longer."""
        return float(np.polyfit(np.log(self.times), np.log(self.seconds), 1)[0])


def seconds_of(function: Callable[[], object]) -> float:
    """Time one call."""
    started = time.perf_counter()
    function()
    return time.perf_counter() - started


def interleaved(functions: Mapping[str, Callable[[], object]], rounds: int = 5) -> dict[str, float]:
    """Time functions in turn, round after round: the median seconds of each.

    One round goes first that isn't counted, in which compilers compile and files are cached.
    """
    for function in functions.values():
        function()
    measured = [
        {name: seconds_of(function) for name, function in functions.items()} for _ in range(rounds)
    ]
    return {name: statistics.median(one[name] for one in measured) for name in functions}


def grow(
    make: Callable[[int], Callable[[], object]], times: Sequence[int], rounds: int = 3
) -> Growth:
    """Time the same job on so many times the work; ``make(n)`` gives it for n times."""
    found = interleaved({str(n): make(n) for n in times}, rounds)
    return Growth(tuple(times), tuple(found[str(n)] for n in times))


@contextlib.contextmanager
def kernels(wanted: str) -> Iterator[None]:
    """Run with the compiled kernels, ``c``, or without, ``numpy``."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = wanted
    compiled.cache_clear()
    try:
        yield
    finally:
        compiled.cache_clear()
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before


def run_process(
    command: Sequence[str | Path],
    output: str | Path = os.devnull,
    environment: Mapping[str, str] | None = None,
) -> Cost:
    """Run a command to its end; its own processor time and memory, not its children's."""
    words = [str(word) for word in command]
    done = subprocess.run(
        [sys.executable, "-S", "-E", str(SPAWN), str(output), *words],
        env={**os.environ, **(environment or {})},
        check=True,
        capture_output=True,
        text=True,
    )
    seconds, processor, kilobytes, code = map(float, done.stdout.split())
    if code not in (0, 5):  # 5: some files were passed over
        raise RuntimeError(f"{' '.join(words)} ended with {code:g}")
    return Cost(seconds, processor, kilobytes / 1024)
