"""Give commands to a process that runs each with a fault, and look at what they leave."""

import hashlib
import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = Path(__file__).with_name("faultpoints.c")


def build_library(folder):
    """Compile the library that makes calls fail; None where there is no compiler."""
    library = folder / "faultpoints.so"
    command = [os.environ.get("CC", "cc"), "-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror"]
    try:
        subprocess.run([*command, "-o", library, SOURCE, "-ldl"], check=True)
    except FileNotFoundError:
        return None
    return library


@dataclass(frozen=True)
class Ending:
    """How a command ended: its exit code, the calls that change files, what it said."""

    code: int
    calls: list
    said: str


class Faulting:
    """A process that runs the program with faults."""

    def __init__(self, library, work):
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.faults.served", work],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "LD_PRELOAD": str(library), "OPENBLAS_NUM_THREADS": "1"},
            cwd=ROOT,
            text=True,
        )

    def run(self, world, words, kind="none", point=-1, synced=""):
        job = [str(world), words, kind, point, str(synced)]
        self.process.stdin.write(json.dumps(job) + "\n")
        self.process.stdin.flush()
        return Ending(*json.loads(self.process.stdout.readline()))

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()


def tree_of(world):
    """Every file below a folder but the text of locks, by its name; and every folder."""
    found = {}
    for folder, folders, files in os.walk(world):
        where = os.path.relpath(folder, world)
        found.update({os.path.normpath(f"{where}/{name}/"): "folder" for name in folders})
        for name in files:
            if name != "LOCK":
                place = os.path.normpath(f"{where}/{name}")
                found[place] = hashlib.blake2b(Path(folder, name).read_bytes()).hexdigest()
    return found


def stores_of(world):
    """What the manifest of each store names, with the bytes that are there under these names.

    Reads the manifest as `json` and the files as bytes: nothing of the program's own readers.
    """
    found = {}
    for manifest in sorted(Path(world).glob("*.store/MANIFEST")):
        line, _, body = manifest.read_bytes().partition(b"\n")
        assert hashlib.blake2b(body, digest_size=len(line) // 2).hexdigest().encode() == line
        named = {}
        for number, records in named_files(json.loads(body)):
            for suffix, record in records.items():
                data = (manifest.parent / f"segments/{number:06d}.{suffix}").read_bytes()
                digest = hashlib.blake2b(data, digest_size=32).hexdigest()
                assert digest == record["digest"] or manifest.parent.name.startswith("bad-")
                named[f"{number:06d}.{suffix}"] = digest
        found[manifest.parent.name] = (body, named)
    return found


def named_files(manifest):
    for file in manifest["files"]:
        yield file["number"], {suffix: file[suffix] for suffix in ("h5", "idx")}
