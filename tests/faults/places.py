"""Places where writing is hard: disks without room or without free names, closed folders."""

import json
import os
import subprocess
import sys
from pathlib import Path

from tests.faults.faulting import Ending
from tests.faults.world import copy_world

ROOT = Path(__file__).parents[2]
PAGE = 4096
PLENTY = "size=256m,nr_inodes=100k"


class Places:
    """A folder that is a small disk of its own where mounting is allowed, and runs in it.

    Attributes
    ----------
    has_disk : bool
        Whether it is one.
    world : Path
        Where worlds are laid out, as the program knows it.
    seen : Path
        The same folder for everybody else.
    elsewhere : Path
        A folder that is never full nor closed; ``../../elsewhere`` from the world.
    """

    def __init__(self, folder):
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.faults.confined"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            cwd=ROOT,
            text=True,
        )
        self.disk = folder / "disk"
        self.disk.mkdir()
        self.elsewhere = folder / "elsewhere"
        self.elsewhere.mkdir()
        self.world = self.disk / "world"
        self.seen = self.world
        self.has_disk = self.do("own_mounts")
        if self.has_disk:
            self.do("mount", str(self.disk), PLENTY)
            self.seen = Path(f"/proc/{self.process.pid}/root{self.world}")

    def do(self, job, *arguments, **options):
        self.process.stdin.write(json.dumps([job, arguments, options]) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def run(self, words, **limits):
        """Run the program in the world, with limits as `tests.faults.confined.run` takes them."""
        code, said = self.do("run", str(self.world), words, **limits)
        return Ending(code, [], said)

    def lay_out(self, world):
        """Put a copy of a world there, and have room again."""
        self.make_room()
        copy_world(world, self.seen)

    def make_room(self):
        if self.has_disk:
            self.do("remount", str(self.disk), PLENTY)
        if self.seen.exists():
            change_modes(self.seen, add=0o200)

    def leave_pages(self, pages):
        """Leave no more free than some pages."""
        disk = os.statvfs(self.seen)
        taken = (disk.f_blocks - disk.f_bfree) * disk.f_frsize // PAGE
        self.do("remount", str(self.disk), f"nr_blocks={taken + pages}")

    def leave_files(self, files):
        """Leave room for some more files and folders, whatever their size."""
        disk = os.statvfs(self.seen)
        self.do("remount", str(self.disk), f"nr_inodes={disk.f_files - disk.f_ffree + files}")

    def make_read_only(self):
        self.do("remount", str(self.disk), PLENTY, read_only=True)

    def close_folders(self):
        """Take everybody's permission to change what is in any folder."""
        change_modes(self.seen, remove=0o222)

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()


def change_modes(world, *, add=0, remove=0):
    for folder, _, _ in os.walk(world):
        os.chmod(folder, os.stat(folder).st_mode & 0o777 & ~remove | add)
