"""Every call of every writing command that changes files, ended before, torn, or failing."""

import random

import pytest

from tests.faults.served import KINDS
from tests.faults.world import WRITERS

FEW = 2  # of each command in a short run
SMALL = "index-more"  # of this one every point is tried in a short run


@pytest.mark.parametrize("name", WRITERS)
def test_a_command_that_meets_a_fault_changes_all_or_nothing(name, attacked, is_full, reported):
    attack = attacked(name)
    points = [
        (kind, point)
        for point, call in enumerate(attack.calls)
        for kind in KINDS[1:]
        if kind != "short" or call.startswith("write")
    ]
    if not is_full and name != SMALL:
        points = random.Random(name).sample(points, min(FEW, len(points)))
    wrong = []
    for kind, point in points:
        try:
            attack.judge(kind, point)
        except AssertionError as exc:
            wrong.append(f"{kind} at call {point}, {attack.calls[point]}: {exc}")
    reported(f"faults {name}", len(points), len(wrong))
    assert not wrong, f"{len(wrong)} of {len(points)}:\n" + "\n".join(wrong[:5])
