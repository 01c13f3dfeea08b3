"""Reading AMC and BVH against parsers that go line by line, and against the bare bytes."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from bench.corpus import Bench
from bench.measure import grow, interleaved, kernels
from bench.peers import parse_amc_line_by_line, parse_bvh_line_by_line, read_with_bvhio
from bench.table import Row
from mocapidx.formats.amc import find_skeleton
from mocapidx.formats.registry import read_recording

__all__ = ["measure", "repeated_amc", "repeated_bvh"]

LIMIT = "read, count the line ends"


def measure(bench: Bench) -> Iterator[Row]:
    """Time reading the largest AMC and the largest BVH."""
    folder = bench.work / "reading"
    folder.mkdir()
    skeleton = find_skeleton(bench.amc)
    amc = {n: repeated_amc(bench.amc, folder / f"{n}.amc", n) for n in bench.times}
    bvh = {n: repeated_bvh(bench.bvh, folder / f"{n}.bvh", n) for n in bench.times}
    yield from of_kind(
        bench,
        amc,
        lambda path: read_recording(path, skeleton_path=skeleton),
        {"line by line": parse_amc_line_by_line},
    )
    yield from of_kind(
        bench,
        bvh,
        read_recording,
        {"line by line": parse_bvh_line_by_line, "bvhio": read_with_bvhio},
    )


def of_kind(
    bench: Bench,
    files: dict[int, Path],
    read: Callable[[Path], object],
    peers: dict[str, Callable[[Path], object]],
) -> Iterator[Row]:
    """Time both kernels and the peers on one file, and ours on longer ones."""
    path = files[4]  # of the size of a long take
    size = path.stat().st_size / 1e6
    functions: dict[str, Callable[[], object]] = {
        "c": partial(with_kernels, "c", read, path),
        "numpy": partial(with_kernels, "numpy", read, path),
        LIMIT: lambda: path.read_bytes().count(b"\n"),
        **{name: partial(parse, path) for name, parse in peers.items()},
    }
    seconds = interleaved(functions, bench.rounds)
    growth = grow(lambda n: lambda: read(files[n]), bench.times)
    for kernel in ("c", "numpy"):
        for name in peers:
            yield Row(
                f"read {path.suffix[1:].upper()}, {size:.1f} MB, {kernel}: "
                f"{size / seconds[kernel]:.0f} MB/s",
                seconds[kernel],
                name,
                seconds[name],
                LIMIT,
                seconds[LIMIT],
                growth if kernel == "c" else None,
            )


def with_kernels(wanted: str, read: Callable[[Path], object], path: Path) -> object:
    """Read with the compiled kernels or without."""
    with kernels(wanted):
        return read(path)


def repeated_amc(source: Path, target: Path, times: int) -> Path:
    """Write an AMC whose frames are those of another one, again and again."""
    lines = source.read_bytes().splitlines()
    first = next(number for number, line in enumerate(lines) if line.strip() == b"1")
    body, frame = lines[first:], 0
    with target.open("wb") as file:
        file.write(b"\n".join(lines[:first]) + b"\n")
        for _ in range(times):
            for line in body:
                if line.strip().isdigit():
                    frame += 1
                    line = b"%d" % frame
                file.write(line + b"\n")
    return target


def repeated_bvh(source: Path, target: Path, times: int) -> Path:
    """Write a BVH whose frames are those of another one, again and again."""
    head, _, rest = source.read_bytes().partition(b"Frames:")
    count, pace, body = rest.split(b"\n", 2)
    body = body.rstrip() + b"\n"
    frames = b"Frames: %d\n" % (int(count) * times)
    target.write_bytes(head + frames + pace + b"\n" + body * times)
    return target
