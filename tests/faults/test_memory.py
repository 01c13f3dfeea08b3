"""Stores that are larger than the memory that a command may have."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from mocapidx.tasks.index import index_files
from tests.faults import frugal
from tests.faults.faulting import stores_of
from tests.faults.killing import names_in
from tests.faults.large import multiply_store

PROGRAM = Path(sys.executable).parent / "mocapidx"
SHORT, FULL = 300_000_000, 2_000_000_000  # bytes of the store
LIMITS_SHORT, LIMITS_FULL = (256,), (512, 256, 128)  # megabytes; the first is enough
CLASSES = "--class squat --class jog"
COMMANDS = {
    "info": "info big.store",
    "query": "query big.store --example more/jog/1.bvh --format jsonl",
    "auto": "query big.store --example more/jog/1.bvh --select auto --top 20",
    "retrieve": "retrieve big.store --templates t.mt --class squat --top 20",
    "annotate": "annotate big.store --templates t.mt --output hits.csv --format csv",
    "index": "index more --store big.store --jobs 1",
    "merge": "merge big.store small.store --output merged.store",
    "verify": "verify big.store",
    "compact": "compact big.store",
}
LONG = {
    "reindex": "reindex big.store --store other.store --feature-set f31",
    "learn": f"learn-mt small.store --labels-from folder {CLASSES} --background big.store"
    " --output learned.mt --jobs 1",
}


def make_world(world, fixtures, size):
    """Fill a folder with a store that is as large as it is asked for, and a few takes."""
    for label in ("jog", "squat"):
        (world / "more" / label).mkdir(parents=True)
        for number in (1, 2):
            clip = fixtures / f"bvh/{label}/ann_{label}_00{number}.bvh"
            shutil.copy(clip, world / "more" / label / f"{number}.bvh")
    index_files([world / "more", fixtures / "bvh/ann_take.bvh"], world / "small.store")
    learn = f"learn-mt small.store --labels-from folder {CLASSES} --output t.mt"
    subprocess.run([PROGRAM, *learn.split()], cwd=world, check=True, capture_output=True)
    multiply_store(world / "small.store", world / "big.store", size)
    return world


def copy_with_links(world, place):
    """Lay the world out anew; files of stores, which nobody changes, are other names of them."""
    linked = ("h5", "idx")
    shutil.copytree(
        world,
        place,
        copy_function=lambda a, b: (os.link if a.endswith(linked) else shutil.copy2)(a, b),
    )
    return place


def run(world, words, megabytes):
    """Run a command with so much memory."""
    out, err = world.parent / "out", world.parent / "err"
    command = [sys.executable, "-S", "-E", frugal.__file__, f"{megabytes}000000", out, err]
    done = subprocess.run(
        [*command, PROGRAM, *words.split()], cwd=world, check=True, capture_output=True, text=True
    )
    code, peak, seconds = json.loads(done.stdout)
    return code, peak // 1_000_000, seconds, err.read_text(errors="replace")


def ends_in_one_line(said):
    line = said.splitlines()[-1] if said else ""
    return line.startswith("Error: ") and said.count("Error: ") == 1 and "Traceback" not in said


def names_in_big(stores):
    return set(names_in(stores["big.store"][0]))


def test_a_store_larger_than_the_memory_is_served_or_left_whole(
    fixtures_dir, tmp_path, is_full, reported
):
    pristine = make_world(tmp_path / "pristine", fixtures_dir, FULL if is_full else SHORT)
    limits = LIMITS_FULL if is_full else LIMITS_SHORT
    for megabytes in limits:
        wrong = []
        world = copy_with_links(pristine, tmp_path / f"{megabytes}")
        before = stores_of(world)
        for name, words in (COMMANDS | (LONG if is_full else {})).items():
            code, peak, seconds, said = run(world, words, megabytes)
            after = stores_of(world)
            enough = megabytes == limits[0] and name in COMMANDS
            # What is committed before a command gives up stays.
            whole = before.items() <= after.items() and ends_in_one_line(said)
            right = names_in_big(before) <= names_in_big(after)
            right &= code == 0 or (whole and not enough)
            what = f"{megabytes} MB, {name}: exit code {code}, peak {peak} MB, {seconds:.1f} s"
            reported(f"memory {what}", 1, int(not right))
            if not right:
                wrong.append(f"{what}\n{said[-500:]}")
            before = after
        shutil.rmtree(world)
        assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong)
    shutil.rmtree(pristine)
