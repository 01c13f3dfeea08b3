"""A process with limits that reads damaged files: ``python -m tests.fuzz.limited SEEDS WORK``.

Each line of the standard input is a job: a kind of file, the number of the first mutant and how
many. Each mutant's number goes to the standard output before it is read, so that whoever listens
knows which one ended the process, and after it what was wrong, if anything was.
"""

import contextlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import traceback
import warnings
from pathlib import Path

from mocapidx.errors import MocapidxError
from tests.fuzz.targets import TARGETS, without_waiting

MEMORY = 1 << 30
SECONDS = 5
LONGEST = 1500  # characters of a message


def main():
    seeds, work = map(Path, sys.argv[1:3])
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("error")
    without_waiting()
    for line in sys.stdin:
        name, first, count = json.loads(line)
        attack = Attack(TARGETS[name], seeds, work / name)
        for number in range(first, first + count):
            say(number)
            # Time of the processor, since the machine may be busy; and an end to what only waits.
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            signal.alarm(24 * SECONDS)
            wrong = attack.judge(number)
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.alarm(0)
            if wrong is not None:
                say(wrong)
        say("done")


def say(what):
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


class Attack:
    """Files of one kind, damaged one after the other."""

    def __init__(self, target, seeds, work):
        self.target, self.work = target, work
        self.beside = seeds / f"{target.name}.beside"
        self.seeds = [path.read_bytes() for path in sorted((seeds / target.name).iterdir())]
        self.answers = [self.answer_of(seed) for seed in self.seeds] if target.sealed else []

    def answer_of(self, seed):
        return self.target.read(self.lay_out(seed))

    def lay_out(self, data):
        """Write a file, and what has to stand beside it, where it belongs."""
        if not self.work.exists() or self.target.attack:
            shutil.rmtree(self.work, ignore_errors=True)
            if self.beside.exists():
                shutil.copytree(self.beside, self.work)
            else:
                self.work.mkdir(parents=True)
        place = self.work / self.target.place
        if not self.target.attack:
            place.write_bytes(data)
        return place

    def make(self, number):
        """Make mutant `number`; it is the same in every process."""
        rng = random.Random(f"{self.target.name} {number}")
        which = number % len(self.seeds)
        if self.target.attack:
            place = self.lay_out(b"")
            self.target.attack(place, rng, number)
            return which, place
        return which, self.lay_out(self.target.mutant(self.seeds[which], self.seeds, rng))

    def judge(self, number):
        """Read a mutant and say what is wrong about how that went, if anything is."""
        which, place = self.make(number)
        try:
            with contextlib.redirect_stderr(None):
                answer = self.target.read(place)
        except MocapidxError as exc:
            text = str(exc)
            if not text.isprintable() or len(text) > LONGEST:
                return f"a message of {len(text)} characters: {text[:300]!r}"
            return None
        except BaseException as exc:
            return "".join(traceback.format_exception(exc)[-6:])
        is_whole = not self.target.attack and place.read_bytes() == self.seeds[which]
        if self.target.sealed and not is_whole:
            expected = self.answers[which].replace("sound\n", "found\n", 1)
            if answer != expected:
                return f"silently another answer, or not found: {answer[:300]!r}"
        return None


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
