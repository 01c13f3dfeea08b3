"""Stop commands at random moments, and judge what they leave by what a clean run makes.

The judge stands outside: it knows the bytes that a run which nobody stops has on disk after each
of its commits, and reads a store as `json` and files alone.
"""

import hashlib
import json
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass

from mocapidx.store.read import open_store
from mocapidx.store.write import writing
from mocapidx.tasks.index import IndexOptions, index_files
from tests.faults.faulting import ROOT, stores_of, tree_of
from tests.faults.warm import BATCH
from tests.made_webs import add_motions, gestures

__all__ = ["LONG_RUNS", "Course", "Ending", "Warm", "make_archive", "names_in"]

LABELS = ("kickFrontRight", "squat", "punchLeft", "clapAboveHead", "jog", "hopBothLegs")
NOTHING = "interrupted; nothing was written"
WHOLE = "interrupted; what was written is whole"
POLITE = (signal.SIGTERM, signal.SIGINT)


@dataclass(frozen=True)
class LongRun:
    """A command that commits several times, or works long for its one commit.

    Attributes
    ----------
    words : str
        The command line, run in the archive.
    target : str
        The store or file that it makes another one of.
    stopped : str
        A pattern of what it says when it is stopped and had begun.
    spread : bool
        Whether it takes ``--jobs``.
    """

    words: str
    target: str
    stopped: str = NOTHING
    spread: bool = True


DOCUMENTS = r"stopped after \d+ documents?; run again to continue"
PAIRS = r"stopped after \d+ pairs?; run again to continue"
MERGES = r"stopped after \d+ of \d+ merges; run again to continue"
CLASSES = "--labels-from folder --class squat --class punchLeft --class jog"
LATER = "stopped; run again to continue"
LONG_RUNS = {
    "index-new": LongRun("index takes --store new.store", "new.store", DOCUMENTS),
    "index-changed": LongRun("index changed --store grown.store --prune", "grown.store", DOCUMENTS),
    "learn-new": LongRun(f"learn-mt one.store {CLASSES} --output new.mt", "new.mt"),
    "learn-over": LongRun(f"learn-mt one.store {CLASSES} --output old.mt", "old.mt"),
    "compact": LongRun("compact grown.store", "grown.store", MERGES, spread=False),
    "web-new": LongRun("web build arms.store --output new.web", "new.web", PAIRS),
    "web-more": LongRun("web build arms.store --output arms.web", "arms.web", PAIRS),
    "merge-new": LongRun(
        "merge one.store other.store --output new.store", "new.store", spread=False
    ),
    "merge-into": LongRun("merge other.store --output grown.store", "grown.store", spread=False),
    "reindex": LongRun(
        "reindex grown.store --store new.store --feature-set f31", "new.store", LATER, spread=False
    ),
}


@dataclass(frozen=True)
class Ending:
    """How a run ended.

    Attributes
    ----------
    code : int or str
        Its exit code, negative by a signal; "hung" if it never ended.
    said : str
        On its standard error.
    acknowledged : int
        How often it told its caller that something is on disk.
    seconds : float
        From its start to its end.
    slow : float
        Seconds from the signal to its end; 0 if it had ended before.
    left : int
        Processes that it started and that did not end with it.
    """

    code: int | str
    said: str
    acknowledged: int
    seconds: float
    slow: float
    left: int


class Warm:
    """A process that runs the program in copies of itself."""

    def __init__(self, work):
        self.work = work
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.faults.warm", work],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=ROOT,
            text=True,
        )

    def run(self, world, words, *, signal=0, delay=0.0, kept=(), program=False):
        """Run a command, and send it a signal after a delay.

        What `kept` names first is copied into the folder named second after every commit. With
        `program` it is the installed one, which commits in large steps and acknowledges nothing.
        """
        job = {
            "world": str(world),
            "words": words,
            "signal": int(signal),
            "delay": delay,
            "kept": [str(place) for place in kept],
            "program": program,
        }
        self.process.stdin.write(json.dumps(job) + "\n")
        self.process.stdin.flush()
        return Ending(**json.loads(self.process.stdout.readline()))

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()


def make_archive(archive, fixtures, warm):
    """Fill a folder with what `LONG_RUNS` start from."""

    def run(words):
        done = warm.run(archive, words.split())
        assert done.code == 0, done.said

    archive.mkdir()
    for label in LABELS:
        for number in (1, 2):
            clip = fixtures / f"bvh/{label}/ann_{label}_00{number}.bvh"
            for folder, name in (("takes", f"{number}"), ("changed", f"{number + 1}")):
                target = archive / folder / label / f"{name}.bvh"
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(clip, target)
    small_steps = IndexOptions(batch_bytes=BATCH)
    index_files([archive / "changed"], archive / "grown.store", small_steps)
    with writing(archive / "grown.store", command="test") as writer:
        writer.commit(None, remove=["jog/2.bvh"])
    with open_store(archive / "grown.store") as snapshot:
        assert len(snapshot.files) > 3
    shutil.rmtree(archive / "changed")
    shutil.copytree(archive / "takes", archive / "changed")
    shutil.rmtree(archive / "changed/squat")
    index_files([archive / "takes"], archive / "one.store")
    shutil.copytree(archive / "takes/jog", archive / "other/more")
    index_files([archive / "other"], archive / "other.store", small_steps)
    arms = list(gestures(4).items())
    add_motions(archive / "arms.store", dict(arms[:2]))
    run("web build arms.store --output arms.web --jobs 1")
    add_motions(archive / "arms.store", dict(arms[2:]))
    run("learn-mt one.store --labels-from folder --class jog --output old.mt --jobs 1")
    return archive


class Course:
    """A long run that is stopped and run again until it comes to its end.

    Parameters
    ----------
    name : str
        One of `LONG_RUNS`.
    archive : Path
        Where it takes place; but for its target all stays as it is.
    pristine : Path
        What was in the archive before any run.
    warm : Warm
    chance : random.Random
    program : bool
        Whether the installed program is run, and not a copy of a process that has it in memory.
    """

    def __init__(self, name, archive, pristine, warm, chance, program=False):
        self.run, self.archive, self.pristine = LONG_RUNS[name], archive, pristine
        self.warm, self.chance, self.program = warm, chance, program
        self.target = archive / self.run.target
        self.position, self.slowest, self.seconds = 0, 0.0, {}
        shutil.rmtree(archive)
        shutil.copytree(pristine, archive)
        kept = warm.work / "kept"
        kept.mkdir()
        clean = self.go(1, kept=(self.target, kept))
        assert clean.code == 0, clean
        self.after = self.tree()
        self.states = [state_of(self.pristine / self.run.target)]
        self.states += [
            state_of(kept / f"{number}" / self.run.target)
            for number in range(1, clean.acknowledged)
        ]
        self.states.append(state_of(self.target))
        shutil.rmtree(kept)
        self.start_again()

    def start_again(self):
        """Make the target what it was before the first run; nothing of a run is left."""
        self.position, self.debris = 0, frozenset()
        for place in self.archive.glob(f"{self.run.target}*"):
            shutil.rmtree(place) if place.is_dir() else place.unlink()
        source = self.pristine / self.run.target
        if source.exists():
            (shutil.copytree if source.is_dir() else shutil.copy)(source, self.target)

    def go(self, jobs, **options):
        spread = f" --jobs {jobs}" if self.run.spread else ""
        words = f"{self.run.words}{spread}".split()
        return self.warm.run(self.archive, words, program=self.program, **options)

    def stop(self, signal_number, jobs=1):
        """Run it, stop it at a random moment and judge; give whether the signal came in time."""
        if jobs not in self.seconds:
            self.start_again()
            self.seconds[jobs] = self.finish(jobs).seconds
            self.start_again()
        left = 1 - self.position / len(self.states)
        delay = self.chance.uniform(0, left * self.seconds[jobs])
        ending = self.go(jobs, signal=signal_number, delay=delay)
        self.slowest = max(self.slowest, ending.slow)
        self.judge(ending, signal_number)
        return ending.code != 0

    def attack(self, kills, signals, share):
        """Stop it so many times, a share of them with two workers; give what was wrong."""
        wrong = []
        while kills:
            number = self.chance.choice(signals)
            jobs = 2 if self.run.spread and self.chance.random() < share else 1
            try:
                in_time = self.stop(number, jobs)
            except AssertionError as exc:
                wrong.append(f"signal {number:d}, {jobs} jobs: {exc}")
                in_time = True
                self.start_again()
            kills -= in_time
            if not in_time:
                self.start_again()
        return wrong

    def finish(self, jobs=1):
        """Run it to its end, and compare that with the end of a run that nobody stopped."""
        ending = self.go(jobs)
        assert ending.code == 0, ending
        self.judge(ending, 0)
        return ending

    def judge(self, ending, signal_number):
        """Look at what is there, and compare it with what was said."""
        assert ending.code != "hung", ending
        assert not ending.left, f"{ending.left} processes went on: {ending}"
        # A worker whose parent is killed before it has told it what to do ends in this one.
        unborn = signal_number == signal.SIGKILL and ending.said.endswith("Ran out of input\n")
        assert "Traceback" not in ending.said or unborn, ending.said
        state = state_of(self.target)
        assert state in self.states, f"no state of a clean run: {ending}"
        commits = self.states.index(state) - self.position
        # A run that finds everything done says so too.
        told = min(ending.acknowledged, len(self.states) - 1 - self.position)
        if not self.program:
            assert told <= commits <= told + 1, f"{commits} commits: {ending}"
        assert commits >= 0, f"what was there is gone: {ending}"
        self.position += commits
        if ending.code == 0:
            assert self.tree() == self.after, f"not what a clean run makes: {ending}"
        elif signal_number in POLITE:
            self.judge_farewell(ending, signal_number, commits)
        else:
            assert ending.code == -signal.SIGKILL, ending
        debris, self.debris = self.debris, self.temporary()
        if ending.code != -signal.SIGKILL:
            assert self.debris <= debris, f"{self.debris - debris} are left: {ending}"

    def judge_farewell(self, ending, signal_number, commits):
        if ending.code == -signal_number:  # before anybody heard it, or after all was done
            assert not commits or self.position == len(self.states) - 1, ending
            return
        assert ending.code == 128 + signal_number, ending
        line = ending.said.splitlines()[-1].removeprefix("Error: ")
        assert ending.said.count("Error: ") == 1, ending
        assert re.fullmatch(f"{NOTHING}|{WHOLE}|{self.run.stopped}", line), ending
        assert line != NOTHING or not commits, f"{commits} commits: {ending}"
        if number := re.match(r"stopped after (\d+) document", line):
            before, after = (self.states[n] for n in (self.position - commits, self.position))
            there = new_documents(before, after)
            assert int(number[1]) <= there, f"only {there} are there: {ending}"

    def temporary(self):
        """Files that a killed writer left, or that this one did."""
        return frozenset(name for name in tree_of(self.archive) if name.endswith(".tmp"))

    def tree(self):
        """All files, but for replaced ones, which stay for readers until the next commit."""
        named = {
            f"{store}/segments/{name}"
            for store, (_, files) in stores_of(self.archive).items()
            for name in files
        }
        return {
            name: content
            for name, content in tree_of(self.archive).items()
            if name in named or not re.search(r"/segments/\d+\.(h5|idx)$", name)
        }


def names_in(manifest):
    """The live documents of a store, sorted, by the bytes of its manifest."""
    columns = [file["documents"] for file in json.loads(manifest)["files"]]
    return sorted(
        name
        for column in columns
        for name, live in zip(column["name"], column["live"], strict=True)
        if live
    )


def new_documents(before, after):
    """Count the documents in segment files that were not there before."""
    numbers = {file["number"] for file in json.loads(before[0])["files"]} if before else set()
    files = json.loads(after[0])["files"] if after else []
    return sum(len(file["documents"]["name"]) for file in files if file["number"] not in numbers)


def state_of(target):
    """What a reader from outside finds: a store by its manifest, anything else as it is."""
    if target.suffix == ".store":
        return stores_of(target.parent).get(target.name)
    return hashlib.blake2b(target.read_bytes()).hexdigest() if target.exists() else None
