"""Indexing: frames a second, where the time goes, and memory over many documents."""

import shutil
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from bench.measure import peak_memory
from bench.reading import Row
from mocapidx.features.extract import extract_features
from mocapidx.features.featureset import load_feature_set
from mocapidx.features.words import pack_words
from mocapidx.skeleton.resample import resample_motion
from mocapidx.tasks.index import index_files
from mocapidx.tasks.read import read_take

PROGRAM = str(Path(sys.executable).parent / "mocapidx")
COPIES = 20


def measure(corpus: Any, work: Path) -> Iterator[Row]:
    """Index the clips with one job, then many copies of a folder with memory watched."""
    store = work / "index.store"
    index_files([corpus.clips], store)
    shutil.rmtree(store)
    summary = index_files([corpus.clips], store)
    source = sum_source_frames(store)
    yield (
        f"index {summary.added} clips, one job",
        f"{summary.seconds:.2f} s",
        f"{summary.frames} frames at 30 Hz",
        f"{source / summary.seconds:,.0f} source frames/s",
    )
    shares = stage_seconds(corpus.clips)
    for stage, seconds in shares.items():
        yield f"- {stage}", f"{seconds:.2f} s", "", f"{seconds / summary.seconds:.0%} of it"
    rest = summary.seconds - sum(shares.values())
    yield (
        "- runs, lists, store, the rest",
        f"{rest:.2f} s",
        "",
        f"{rest / summary.seconds:.0%} of it",
    )

    folder = work / "many"
    for copy in range(COPIES):
        shutil.copytree(corpus.many, folder / f"{copy:02d}", copy_function=shutil.copyfile)
        for skeleton in corpus.many.glob("*.asf"):
            shutil.copyfile(skeleton, folder / f"{copy:02d}" / skeleton.name)
    for jobs in (1, 2):
        command = [PROGRAM, "index", str(folder), "--store", str(work / f"many{jobs}.store")]
        started = time.perf_counter()
        peak = peak_memory([*command, "--jobs", str(jobs)])
        seconds = time.perf_counter() - started
        yield f"memory, {COPIES} copies, {jobs} jobs", f"{peak:.0f} MB", f"in {seconds:.0f} s", ""
    shutil.rmtree(folder)


def sum_source_frames(store: Path) -> int:
    """Count the frames of the source files."""
    from mocapidx.store.read import open_store

    with open_store(store) as snapshot:
        return sum(entry.document.source_frames for entry in snapshot.documents())


def stage_seconds(clips: Path) -> dict[str, float]:
    """Time the stages of preparing all clips one by one."""
    feature_set = load_feature_set("f39")
    spent = {"reading and kinematics": 0.0, "resampling": 0.0, "features and words": 0.0}

    def timed(stage: str, function: Callable[[], Any]) -> Any:
        started = time.perf_counter()
        result = function()
        spent[stage] += time.perf_counter() - started
        return result

    for path in sorted(clips.rglob("*.amc")):
        motion = timed("reading and kinematics", lambda path=path: read_take(path).motion)
        motion = timed("resampling", lambda motion=motion: resample_motion(motion, 30.0))
        timed(
            "features and words",
            lambda motion=motion: pack_words(extract_features(motion, feature_set, 30.0)),
        )
    return spent
