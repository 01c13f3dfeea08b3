"""A small world that every writing command is run in: motion, stores, and what is made of them.

Commands run with the world as their working folder, so that each name in `WRITERS` is short and a
copy of the world that lies in the same place gives the same bytes.
"""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from mocapidx.store.read import open_store
from mocapidx.store.write import writing
from mocapidx.tasks.index import index_files
from tests.made_webs import add_motions, gestures

__all__ = ["WRITERS", "Writer", "copy_world", "make_world"]

KICK = """
[[parameter]]
joint = "rankle"
axes = "y"
when = { max = "height", joint = "rankle" }
"""
EDIT = """
[[template]]
class = "squat"
as = "low squat"
tau = 0.05
"""


@dataclass(frozen=True)
class Writer:
    """A command that writes.

    Attributes
    ----------
    name : str
        What tests call it.
    arguments : str
        Of the program, run in the world.
    writes : tuple of str
        The files, folders and stores that may be other ones afterwards.
    code : int
        Its exit code when all goes well.
    is_optional : bool
        It goes without what can't be written.
    """

    name: str
    arguments: str
    writes: tuple[str, ...]
    code: int = 0
    is_optional: bool = False

    def words(self):
        """The command line, but for the program."""
        return self.arguments.split()


TEMPLATES = "--templates t.mt"
WRITERS = {
    writer.name: writer
    for writer in (
        Writer("index-new", "index takes --store new.store --jobs 1", ("new.store",)),
        Writer("index-more", "index more --store one.store --jobs 1", ("one.store",)),
        Writer(
            "index-changed", "index changed --store grown.store --prune --jobs 1", ("grown.store",)
        ),
        Writer("index-merging", "index more --store many.store --jobs 1", ("many.store",)),
        Writer("remove", "remove one.store --where document=squat/*", ("one.store",)),
        Writer("compact-one", "compact one.store", ("one.store",)),
        Writer("compact-grown", "compact grown.store", ("grown.store",)),
        Writer("compact-many", "compact many.store", ("many.store",)),
        Writer("merge-new", "merge one.store other.store --output new.store", ("new.store",)),
        Writer("merge-into", "merge other.store --output grown.store", ("grown.store",)),
        Writer(
            "reindex", "reindex grown.store --store new.store --feature-set f31", ("new.store",)
        ),
        Writer("repair-index", "verify bad-index.store --repair", ("bad-index.store",)),
        Writer("repair-motion", "verify bad-motion.store --repair", ("bad-motion.store",), code=4),
        Writer(
            "measure",
            "query many.store --example 0-0.bvh --select auto",
            ("many.store/SIGMA",),
            is_optional=True,
        ),
        Writer("web-new", "web build arms.store --output new.web --jobs 1", ("new.web",)),
        Writer("web-more", "web build arms.store --output arms.web --jobs 1", ("arms.web",)),
        Writer(
            "learn-new", "learn-mt one.store --labels-from folder --output new.mt", ("new.mt",)
        ),
        Writer("learn-over", "learn-mt one.store --labels-from folder --output t.mt", ("t.mt",)),
        Writer("template-edit", "template edit t.mt edit.toml --output new.mt", ("new.mt",)),
        Writer(
            "query", "query one.store --example squat/1.bvh --output hits.csv --format csv",
            ("hits.csv",),
        ),
        Writer(
            "retrieve",
            f"retrieve one.store {TEMPLATES} --class squat --profile p.csv --output hits.csv",
            ("hits.csv", "p.csv"),
        ),
        Writer(
            "annotate", f"annotate one.store {TEMPLATES} --output hits.csv --format csv",
            ("hits.csv",),
        ),
        Writer(
            "evaluate", "evaluate squats.jsonl --truth labels.csv --output scores.csv",
            ("scores.csv",),
        ),
        Writer("align", "align takes/squat/1.bvh more/squat/2.bvh --output p.csv", ("p.csv",)),
        Writer("doctor", "doctor takes --output said.csv --format csv", ("said.csv",)),
        Writer(
            "match",
            "match arms.store --web arms.web --query arm0.bvh --graph g.json --output hits.csv",
            ("g.json", "hits.csv"),
        ),
        Writer(
            "export-clips", "export squats.jsonl --root takes --output clips", ("clips",)
        ),
        Writer(
            "export-elan", "export squats.jsonl --store one.store --to eaf --output notes",
            ("notes",),
        ),
        Writer("report", "report one.store squats.jsonl --output r.html", ("r.html",)),
        Writer("plot", "plot matrix one.store --document squat/1.bvh --output m.png", ("m.png",)),
        Writer(
            "blend-fit",
            "blend fit squats.jsonl --root takes --parameter kick.toml --samples 10"
            " --output new.space",
            ("new.space",),
        ),
        Writer("blend-make", "blend make squat.space --at 0.15 --output new.bvh", ("new.bvh",)),
        Writer("man", "man --output pages", ("pages",)),
    )
}  # fmt: skip


def run(world, arguments, code=0):
    """Run the program as a user would."""
    program = Path(sys.executable).parent / "mocapidx"
    done = subprocess.run(
        [program, *arguments.split()], cwd=world, capture_output=True, text=True, check=False
    )
    assert done.returncode == code, f"{arguments}: {done.stderr}"


def make_world(world, fixtures):
    """Fill a folder with all that `WRITERS` need; `fixtures` is a folder of generated motion."""
    world.mkdir()
    clips = fixtures / "bvh"
    for number, folder in enumerate(("takes", "more"), start=1):
        for label in ("squat", "kickFrontRight"):
            (world / folder / label).mkdir(parents=True)
            shutil.copy(
                clips / label / f"ann_{label}_00{number}.bvh",
                world / folder / label / f"{number}.bvh",
            )
    shutil.copy(clips / "squat/ann_squat_002.bvh", world / "takes/squat/2.bvh")
    shutil.copytree(world / "takes", world / "changed")
    (world / "changed/squat/2.bvh").unlink()
    shutil.copy(clips / "squat/ann_squat_002.bvh", world / "changed/squat/1.bvh")
    for folder, store in (("takes", "one"), ("more", "other")):
        run(world, f"index {folder} --store {store}.store --jobs 1")
    make_grown(world)
    for kind, name in (("h5", "bad-motion"), ("idx", "bad-index")):
        store = shutil.copytree(world / "one.store", world / f"{name}.store")
        flip(store / f"segments/000001.{kind}")
    run(world, "learn-mt one.store --labels-from folder --output t.mt")
    rows = [
        {"rank": n, "document": f"squat/{n}.bvh", "start_time": 0.0, "end_time": 0.5,
         "cost": 0.1 * n, "label": "squat"}
        for n in (1, 2)
    ]  # fmt: skip
    (world / "squats.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (world / "labels.csv").write_text("document,label\nsquat/1.bvh,squat\nsquat/2.bvh,squat\n")
    (world / "kick.toml").write_text(KICK)
    (world / "edit.toml").write_text(EDIT)
    fit = "blend fit squats.jsonl --root takes --parameter kick.toml --samples 10"
    run(world, f"{fit} --output squat.space")
    arms = gestures(3)
    add_motions(world / "arms.store", dict(list(arms.items())[:2]))
    run(world, "web build arms.store --output arms.web --jobs 1")
    add_motions(world / "arms.store", dict(list(arms.items())[2:]))
    return world


def make_grown(world):
    """Stores of several segment files, with buried documents and with what a killed writer left."""
    grown = world / "grown.store"
    run(world, "index takes/squat --store grown.store --root takes --jobs 1")
    run(world, "index takes --store grown.store --jobs 1")
    with writing(grown, command="test") as writer:
        writer.commit(None, remove=["squat/2.bvh"])
    run(world, "index takes --store grown.store --jobs 1")
    (grown / "segments/000099.h5").write_bytes(b"left by a killed writer")
    (grown / "segments/000099.idx.77.tmp").write_bytes(b"left by a killed writer")
    (grown / "MANIFEST.77.tmp").write_bytes(b"left by a killed writer")
    many = world / "many.store"
    takes = sorted((world / "takes").rglob("*.bvh"))
    for number in range(20):
        copied = world / f"takes{number}"
        copied.mkdir()
        for copy_number in range(3):  # enough documents in all for the store's own spread
            take = takes[(number + copy_number) % len(takes)]
            shutil.copy(take, copied / f"{number}-{copy_number}.bvh")
        index_files([copied], many)
        shutil.rmtree(copied)
    with open_store(many) as snapshot:
        assert len(snapshot.files) == 20


def flip(path):
    """Damage a byte in the middle of a file."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def copy_world(world, place):
    """Lay a world out anew, with the times that its files have."""
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(world, place, copy_function=copy)
    return place


def copy(source, target):
    shutil.copyfile(source, target)
    times = os.stat(source)
    os.utime(target, ns=(times.st_atime_ns, times.st_mtime_ns))
