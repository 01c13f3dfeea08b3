"""Many writers and readers at one store, all at a time."""

import json
import os
import shutil
import subprocess
import sys

from tests.faults.crowding import STORE
from tests.faults.faulting import ROOT, stores_of
from tests.faults.killing import names_in

SHORT, FULL = 20, 3600  # seconds
ROUND = 60  # seconds after which a new store is begun, since one that grows gets slow
PATIENCE = 600  # seconds for the last commands


def run_crowd(world, clip, seconds):
    world.mkdir()
    shutil.copy(clip, world / "clip.bvh")
    done = subprocess.run(
        [sys.executable, "-m", "tests.faults.crowding", world, str(seconds)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=seconds + PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_eight_writers_and_four_readers_lose_nothing(fixtures_dir, tmp_path, is_full, reported):
    """TORTURE_SECONDS says how long they go on, in place of an hour or a few seconds."""
    left = float(os.environ.get("TORTURE_SECONDS", FULL if is_full else SHORT))
    commits, reads, merges, wrong = 0, 0, 0, []
    while left > 0:
        world = tmp_path / "world"
        told = run_crowd(world, fixtures_dir / "bvh/jog/ann_jog_001.bvh", min(left, ROUND))
        commits, reads = commits + told["write"], reads + told["read"]
        merges, wrong = merges + told["compact"], wrong + told["wrong"]
        pairs = (world / "acknowledged").read_text().split()
        expected = sorted(f"{pair}/{one}.bvh" for pair in pairs for one in "ab")
        found = names_in(stores_of(world)[STORE][0])
        if found != expected:
            wrong.append(f"{len(found)} documents, not {len(expected)}")
        shutil.rmtree(world)
        left -= ROUND
    reported("crowd commits", commits, len(wrong))
    reported("crowd reads", reads, len(wrong))
    reported("crowd merges", merges, len(wrong))
    assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong[:5])
    assert commits > 1
    assert reads > 1
