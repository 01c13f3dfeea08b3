"""One writing command, what it makes of the world, and what may be left of that by a fault."""

from tests.faults.faulting import stores_of, tree_of
from tests.faults.world import copy_world

KILLED = ("kill", "torn")


class Attack:
    """One command, its world, and what it makes of it when nothing goes wrong."""

    def __init__(self, writer, pristine, faulting, place):
        self.writer, self.pristine, self.faulting = writer, pristine, faulting
        self.world = place
        self.lay_out()
        self.before, self.stores_before = tree_of(self.world), stores_of(self.world)
        clean = self.run()
        assert clean.code == writer.code, clean.said
        self.calls = clean.calls
        self.after, self.stores_after = tree_of(self.world), stores_of(self.world)
        self.states = [self.stores_before, self.stores_after]
        self.states += [
            self.stores_before_commit(number)
            for number, call in enumerate(self.calls)
            if call.startswith("rename") and call.endswith("/MANIFEST")
        ]

    def lay_out(self):
        """Make the world as it was before."""
        copy_world(self.pristine, self.world)

    def run(self, kind="none", point=-1, *, synced=""):
        words = self.writer.words()
        return self.faulting.run(self.world, words, kind, point, synced)

    def stores_before_commit(self, number):
        self.lay_out()
        self.run("kill", number)
        return stores_of(self.world)

    def judge(self, kind, point):
        """Let the command meet a fault, look at what is there, and run it again."""
        self.lay_out()
        ending = self.run(kind, point)
        self.judge_ending(kind, ending)
        if ending.code == self.writer.code and kind not in KILLED:
            assert self.is_done() or self.writer.is_optional
        self.judge_left(is_killed=kind in KILLED)

    def judge_left(self, *, is_killed):
        """What is there must be as before or as after, and the same command must end it."""
        assert stores_of(self.world) in self.states
        self.judge_files(is_killed, tree_of(self.world))
        again = self.run()
        # What a repair was to find is gone where the fault came after the commit.
        assert again.code in (self.writer.code, 0), again.said
        tree = tree_of(self.world)
        assert tree.items() <= self.after.items()
        assert self.is_done()

    def judge_ending(self, kind, ending):
        if kind in KILLED:
            assert ending.code == 9, ending.said
            return
        assert ending.code in (self.writer.code, 7), ending
        assert "Traceback" not in ending.said
        if ending.code == 7:
            assert ending.said.count("Error: ") == 1
            assert ending.said.splitlines()[-1].startswith("Error: ")

    def is_done(self):
        """Whether all is there that the command makes."""
        return self.without_replaced(tree_of(self.world)) == self.without_replaced(self.after)

    def judge_files(self, is_killed, tree):
        """What is there is as before or as after, but for what only a killed writer leaves."""
        for name, content in tree.items():
            if name.endswith("/MANIFEST"):
                continue  # one of the states
            known = self.before.get(name), self.after.get(name)
            if content not in known:
                assert is_killed, name
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
