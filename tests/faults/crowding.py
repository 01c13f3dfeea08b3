"""Many at one store: ``python -m tests.faults.crowding WORLD SECONDS``.

Writers commit pairs of documents, which nobody may ever see one of; readers ask for all there is;
now and then everything is merged. Each is a process that runs the program in copies of itself
until the time is over. What they did and what was wrong is a line of the standard output.
"""

import itertools
import json
import os
import sys
import time
import traceback
from pathlib import Path

from mocapidx.store.read import open_store
from tests.faults.program import import_program
from tests.faults.warm import main_code, take_streams

WRITERS, READERS = 8, 4
WAIT = "300"  # seconds for the lock; far more than it takes
PAUSE = 0.5  # seconds between two merges
STORE = "all.store"


class Actor:
    """One of the crowd.

    Parameters
    ----------
    world : Path
    name : str
    end : float
        Of the monotonic clock.
    """

    def __init__(self, world, name, end):
        self.world, self.name, self.end = world, name, end
        self.done, self.wrong = 0, []

    def is_late(self):
        return time.monotonic() > self.end

    def run(self, words):
        """Run the program; give what it printed and what it said."""
        out, err = self.world / f"{self.name}.out", self.world / f"{self.name}.err"
        child = os.fork()
        if not child:
            code = 99
            try:
                os.chdir(self.world)
                take_streams(out, err)
                code = main_code(words.split())
                sys.stdout.flush()
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stderr.flush()
                os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        said = err.read_text(errors="replace")
        self.expect(code == 0, f"{words} ended with {code}: {said}")
        return out.read_text(), said

    def expect(self, right, what):
        if not right:
            self.wrong.append(f"{self.name}: {what}")

    def acknowledged(self):
        """Pairs of which a writer has ended well until now."""
        return set((self.world / "acknowledged").read_text().split())

    def expect_pairs(self, names, before):
        """Of each pair both are there or neither, and all that were said to be there are."""
        found = {}
        for name in names:
            pair, _, one = name.rpartition("/")
            found.setdefault(pair, set()).add(one)
        torn = [pair for pair, both in found.items() if both != {"a.bvh", "b.bvh"}]
        self.expect(not torn, f"of {torn[:3]} only one is there")
        lost = before - found.keys()
        self.expect(not lost, f"{len(lost)} pairs are not there, such as {sorted(lost)[:3]}")

    def write(self, most=None):
        for number in itertools.count() if most is None else range(most):
            if self.is_late():
                return
            pair = f"{self.name}/{number:06d}"
            folder = self.world / "takes" / pair
            folder.mkdir(parents=True)
            for one in ("a.bvh", "b.bvh"):
                os.link(self.world / "clip.bvh", folder / one)
            wrong = len(self.wrong)
            self.run(
                f"index takes/{pair} --root takes --store {STORE} --jobs 1 --lock-timeout {WAIT}"
            )
            if len(self.wrong) == wrong:
                with (self.world / "acknowledged").open("a") as file:
                    file.write(f"{pair}\n")
                self.done += 1

    def read(self):
        for way in itertools.cycle((self.query, self.verify, self.list, self.open)):
            if self.is_late():
                return
            before = self.acknowledged()
            names = way()
            if names is not None:
                self.expect_pairs(names, before)
            self.done += 1

    def query(self):
        out, _ = self.run(f"query {STORE} --example clip.bvh --mode exact --format jsonl")
        return {json.loads(line)["document"] for line in out.splitlines()}

    def list(self):
        out, _ = self.run(f"info {STORE} --documents --format jsonl")
        return [json.loads(line)["document"] for line in out.splitlines()]

    def verify(self):
        self.run(f"verify --quick {STORE}")

    def open(self):
        """Hold a snapshot open as a program in Python would, and read every byte of it."""
        try:
            with open_store(self.world / STORE) as snapshot:
                names = [entry.document.name for entry in snapshot.documents()]
                for file in snapshot.files:
                    for dataset in file.datasets:
                        snapshot.array(file, dataset)
        except Exception:
            self.expect(False, traceback.format_exc())
            return None
        return names

    def compact(self):
        while not self.is_late():
            self.run(f"compact {STORE} --lock-timeout {WAIT}")
            self.done += 1
            time.sleep(PAUSE)


def crowd(world, seconds):
    """Start everybody, wait for all, and sum up what they did."""
    import_program()
    (world / "acknowledged").touch()
    first = Actor(world, "first", float("inf"))
    first.write(most=1)  # so that there is a store
    end = time.monotonic() + seconds
    roles = {f"writer{n}": "write" for n in range(WRITERS)}
    roles |= {f"reader{n}": "read" for n in range(READERS)} | {"merger": "compact"}
    for name, role in roles.items():
        if not os.fork():
            actor = Actor(world, name, end)
            try:
                getattr(actor, role)()
            except BaseException:
                actor.wrong.append(f"{name}: {traceback.format_exc()}")
            (world / f"{name}.json").write_text(json.dumps([role, actor.done, actor.wrong]))
            os._exit(0)
    for _ in roles:
        os.wait()
    told = {"write": first.done, "read": 0, "compact": 0, "wrong": first.wrong}
    for name in roles:
        role, done, wrong = json.loads((world / f"{name}.json").read_text())
        told[role] += done
        told["wrong"] += wrong
    return told


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.stdout.write(json.dumps(crowd(Path(sys.argv[1]), float(sys.argv[2]))) + "\n")
