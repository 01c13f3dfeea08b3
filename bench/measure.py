"""Time functions and processes side by side, so that a drifting machine spoils no ratio."""

import os
import resource
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence

__all__ = ["median_seconds", "paired_ratio", "peak_memory", "process_seconds"]


def median_seconds(function: Callable[[], object], runs: int = 5) -> float:
    """Give the median wall time of a call, after one that is not counted."""
    function()
    return statistics.median(_seconds(function) for _ in range(runs))


def paired_ratio(
    ours: Callable[[], object], theirs: Callable[[], object], runs: int = 5
) -> tuple[float, float, float]:
    """Time two functions in turn: median seconds of each, and the median of theirs / ours."""
    ours(), theirs()
    pairs = [(_seconds(ours), _seconds(theirs)) for _ in range(runs)]
    return (
        statistics.median(a for a, _ in pairs),
        statistics.median(b for _, b in pairs),
        statistics.median(b / a for a, b in pairs),
    )


def process_seconds(command: Sequence[str]) -> Callable[[], object]:
    """Make a function that runs a command as a whole process, its output thrown away."""
    return lambda: subprocess.run(command, check=True, capture_output=True)


def peak_memory(command: Sequence[str]) -> float:
    """Run a command and give the greatest resident memory of any of its processes, in MB."""
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        subprocess.run(command, check=True, capture_output=True)
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        os.write(write_end, str(peak).encode())
        os._exit(0)
    os.waitpid(child, 0)
    return int(os.read(read_end, 64)) / 1024


def _seconds(function: Callable[[], object]) -> float:
    started = time.perf_counter()
    function()
    return time.perf_counter() - started
