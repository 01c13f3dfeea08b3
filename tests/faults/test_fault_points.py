"""Every call of every writing command that changes files, ended before, torn, or failing."""

import random

import pytest

from tests.faults.faulting import stores_of, tree_of
from tests.faults.served import KINDS
from tests.faults.world import WRITERS, copy_world

KILLED = ("kill", "torn")
FEW = 4  # of each command in a short run
SMALL = "index-more"  # of this one every point is tried in a short run


class Attack:
    """One command, its world, and what it makes of it when nothing goes wrong."""

    def __init__(self, writer, pristine, faulting, place):
        self.writer, self.pristine, self.faulting, self.place = writer, pristine, faulting, place
        self.world = copy_world(pristine, place)
        self.before, self.stores_before = tree_of(self.world), stores_of(self.world)
        clean = self.run()
        assert clean.code == writer.code, clean.said
        self.calls = clean.calls
        self.after, self.stores_after = tree_of(self.world), stores_of(self.world)
        self.states = [self.stores_before, self.stores_after]
        self.states += [
            self.stores_before_commit(number)
            for number, call in enumerate(self.calls)
            if call == "rename MANIFEST"
        ]

    def run(self, kind="none", point=-1, again=False):
        return self.faulting.run(self.world, self.writer.words(again=again), kind, point)

    def stores_before_commit(self, number):
        copy_world(self.pristine, self.place)
        self.run("kill", number)
        return stores_of(self.world)

    def judge(self, kind, point):
        """Let the command meet a fault, look at what is there, and run it again."""
        copy_world(self.pristine, self.place)
        ending = self.run(kind, point)
        self.judge_ending(kind, ending)
        tree = tree_of(self.world)
        assert stores_of(self.world) in self.states
        self.judge_files(kind, tree)
        if ending.code == self.writer.code and kind not in KILLED:
            assert self.without_replaced(tree) == self.without_replaced(self.after)
        again = self.run(again=True)
        # What a repair was to find is gone where the fault came after the commit.
        assert again.code in (self.writer.code, 0), again.said
        tree = tree_of(self.world)
        assert tree.items() <= self.after.items()
        assert self.without_replaced(tree) == self.without_replaced(self.after)

    def judge_ending(self, kind, ending):
        if kind in KILLED:
            assert ending.code == 9, ending.said
            return
        assert ending.code in (self.writer.code, 7), ending
        assert "Traceback" not in ending.said
        if ending.code == 7:
            assert ending.said.count("Error: ") == 1
            assert ending.said.splitlines()[-1].startswith("Error: ")

    def judge_files(self, kind, tree):
        """What is there is as before or as after, but for what only a killed writer leaves."""
        for name, content in tree.items():
            if name.endswith("/MANIFEST"):
                continue  # one of the states
            known = self.before.get(name), self.after.get(name)
            if content not in known:
                assert kind in KILLED, name
                assert name.startswith(self.writer.writes), name
                assert name.endswith(".tmp") or "/segments/" in name, name
        lost = (self.before.keys() & self.after.keys()) - tree.keys()
        assert not lost

    def without_replaced(self, tree):
        """Without what stays beside a store until the next commit, for readers."""
        named = {
            f"{store}/segments/{name}"
            for store, (_, files) in self.stores_after.items()
            for name in files
        }
        return {
            name: content
            for name, content in tree.items()
            if "/segments/" not in name or name in named
        }


@pytest.fixture
def attacked(pristine, faulting, tmp_path):
    def make(name):
        return Attack(WRITERS[name], pristine, faulting, tmp_path / "world")

    return make


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
