"""One writing command in a place where writing is hard, and what may be there afterwards."""

import re

from tests.faults.attack import Attack
from tests.faults.faulting import stores_of, tree_of
from tests.faults.places import PAGE

SEVERAL = ("retrieve", "match", "export-clips", "export-elan", "man", "index-merging")
"""Write several files, or commit twice, and keep what was whole when they had to stop."""

WHY = re.compile(
    r"no space left on \S+ for \S+: (needed (about|at least) \d+ [kM]B, )?"
    r"(free \d+ [kM]B(, but no room for one more file \(inodes\); remove some there)?"
    r"|over the limit for the size of a file \(ulimit -f: \d+ [kM]B\))"
    r"; (\S+ is (unchanged|not there)(; \d+ clips? written; run again to continue)?"
    r"|nothing was made"
    r"|store unchanged( \(\d+ documents?\))?"
    r"|what was saved before stays \(\d+ documents?\); run again to continue)"
)


class Cramped(Attack):
    """One command, its world, and what it makes of it where there is room."""

    def __init__(self, writer, pristine, places):
        self.places = places
        self.said = None
        super().__init__(writer, pristine, None, places.seen)
        written = {
            name
            for name, content in self.after.items()
            if content not in ("folder", self.before.get(name)) or name in writer.writes
        }
        sizes = [
            path.stat().st_size for path in map(self.world.joinpath, written) if path.is_file()
        ]
        self.sizes = sorted(sizes)
        self.pages = sum(-(-size // PAGE) for size in sizes)

    def lay_out(self):
        self.places.lay_out(self.pristine)

    def run(self, **limits):
        words = self.writer.words()
        if self.said is not None:
            return self.places.run(words, **limits)
        printed = self.places.elsewhere / "printed"
        ending = self.places.run(words, stdout=str(printed))
        self.said, self.prints = ending.said, printed.stat().st_size > 0
        return ending

    def spoil_inputs(self):
        """Put nonsense into every file that the command only reads."""
        for name, content in self.before.items():
            if content != "folder" and not name.startswith(self.writer.writes):
                (self.world / name).write_bytes(b"nonsense\n")

    def judge(self, **limits):
        """Run the command where there is too little room, and then where there is enough.

        Returns
        -------
        bool
            Whether there was room enough after all.
        """
        ending = self.run(**limits)
        self.places.make_room()
        if ending.code == self.writer.code:
            assert self.is_done() or self.writer.name == "measure"
            return True
        assert ending.code == 7, ending
        *before, last = ending.said.splitlines()
        assert set(before) <= set(self.said.splitlines()), ending.said
        assert last.startswith("Error: ")
        assert WHY.fullmatch(last.removeprefix("Error: ")), last
        self.judge_left()
        again = self.run()
        assert again.code == self.writer.code, again.said
        assert self.is_done()
        return False

    def judge_left(self):
        """All is there that was there before, and nothing else unless it is whole."""
        tree, stores = tree_of(self.world), stores_of(self.world)
        self.judge_files(False, tree)
        for name in self.stores_before:
            manifest, files = self.stores_before[name]
            if self.writer.name in SEVERAL:
                assert files.items() <= stores[name][1].items()
            else:
                assert stores[name] == (manifest, files)
        if self.writer.name not in SEVERAL:
            assert tree.keys() <= self.before.keys(), tree.keys() - self.before.keys()
        lost = self.before.items() - tree.items()
        assert all(self.is_debris(name) for name, _ in lost), lost

    def is_debris(self, name):
        """Whether a killed writer left it."""
        store, _, file = name.partition("/")
        is_segment = file.startswith("segments/")
        named = self.stores_before.get(store, (b"", {}))[1]
        if self.writer.name in SEVERAL and file == "MANIFEST":
            return True
        return name.endswith(".tmp") or (is_segment and file.rpartition("/")[2] not in named)
