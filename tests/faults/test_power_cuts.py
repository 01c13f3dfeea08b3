"""The power fails after each call of each writing command, on a disk that keeps what was synced."""

import itertools
import random

import pytest

from tests.faults.disk import Disk
from tests.faults.faulting import tree_of
from tests.faults.world import WRITERS

FEW = 1  # cuts of each command in a short run
CHANCES, FEW_CHANCES = 16, 4  # what may have reached the disk


def kept_of(pending, rng, chances):
    """Parts of the changes that may have reached the disk: any where there are few changes."""
    if 2 ** len(pending) <= chances:
        return [
            list(part)
            for size in range(len(pending) + 1)
            for part in itertools.combinations(pending, size)
        ]
    in_order = [pending[: rng.randrange(len(pending))] for _ in range(chances // 2)]
    at_random = [[each for each in pending if rng.random() < 0.5] for _ in range(chances // 2)]
    return [[], list(pending), *in_order, *at_random]


@pytest.mark.parametrize("name", WRITERS)
def test_the_power_fails_at_any_moment(name, attacked, is_full, reported, pristine, tmp_path):
    attack, rng, tried, wrong = attacked(name), random.Random(name), set(), []
    synced = tmp_path / "synced"
    synced.mkdir()
    attack.lay_out()
    done = attack.run(synced=synced)
    assert done.code == attack.writer.code, done.said
    disk, last = Disk.of(pristine), len(done.calls)
    chances = CHANCES if is_full else FEW_CHANCES
    cuts = range(last + 1) if is_full else {*rng.sample(range(last), min(FEW, last)), last}
    for cut in range(last + 1):
        if cut:
            disk.follow(done.calls[cut - 1], synced / str(cut - 1))
        for kept in kept_of(disk.pending, rng, chances) if cut in cuts else ():
            for lost in (b"", b"lost"):
                disk.lay_out(attack.world, kept, lost)
                tree = frozenset(tree_of(attack.world).items())
                if tree in tried and cut < last:
                    continue
                tried.add(tree)
                try:
                    assert attack.is_done() or cut < last, "what was done is lost"
                    attack.judge_left(is_killed=True)
                except AssertionError as exc:
                    wrong.append(f"after {done.calls[:cut][-1:]}, {kept}: {exc}")
    reported(f"power cuts {name}", len(tried), len(wrong))
    assert not wrong, f"{len(wrong)} of {len(tried)}:\n" + "\n".join(wrong[:5])
