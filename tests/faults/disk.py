"""What a disk holds after a power cut: what was synced for sure, the rest perhaps.

A file has the content that it had when it was synced last, one that never was is empty or cut
off. A name is where it was when its folder was synced last; of what happened to names since then,
any part may have reached the disk.
"""

import os
import shutil
from dataclasses import dataclass, field
from pathlib import Path

from tests.faults.world import copy

FOLDER = "folder"


@dataclass(frozen=True)
class Change:
    """Of names in a folder: one that went, one that came with what lies there now."""

    folder: str
    gone: str | None
    come: str | None
    inode: object


@dataclass
class Disk:
    """Names and contents, as the journal of a run changes them.

    Attributes
    ----------
    names : dict
        What lies where, as programs see it.
    sure : dict
        The same after a power cut in which all changes of names that aren't synced are lost.
    content : dict
        For each file, the copy that was made when it was synced last; None if it never was.
    pending : list of Change
        Changes of names that aren't synced.
    """

    names: dict
    sure: dict
    content: dict
    pending: list = field(default_factory=list)

    @classmethod
    def of(cls, world):
        """Take a world in which everything is on the disk."""
        names, content = {"": FOLDER}, {}
        for folder, folders, files in os.walk(world):
            where = os.path.relpath(folder, world)
            names.update({os.path.normpath(f"{where}/{name}"): FOLDER for name in folders})
            for name in files:
                inode = object()
                names[os.path.normpath(f"{where}/{name}")] = inode
                content[inode] = Path(folder, name)
        return cls(names, dict(names), content)

    def follow(self, line, copied):
        """Make one call of the journal; `copied` is where a synced file was copied to."""
        call, path, *target = (os.path.normpath(part) for part in line.split("\t"))
        if call == "open" and path not in self.names:
            inode = object()
            self.content[inode] = None
            self.change(None, path, inode)
        elif call == "mkdir" and path not in self.names:
            self.change(None, path, FOLDER)
        elif call == "rename":
            self.change(path, target[0], self.names[path])
        elif call == "link":
            self.change(None, target[0], self.names[path])
        elif call in ("unlink", "rmdir") and path in self.names:
            self.change(path, None, None)
        elif call == "fsync":
            self.sync("" if path == "." else path, copied)

    def change(self, gone, come, inode):
        found = Change(os.path.dirname(come or gone), gone, come, inode)
        assert gone is None or os.path.dirname(gone) == found.folder
        apply(self.names, found)
        self.pending.append(found)

    def sync(self, path, copied):
        inode = self.names[path]
        if inode is not FOLDER:
            self.content[inode] = copied
            return
        for found in [found for found in self.pending if found.folder == path]:
            apply(self.sure, found)
            self.pending.remove(found)

    def lay_out(self, place, kept, lost):
        """Write what is left if the changes `kept` reached the disk; unsynced files hold `lost`."""
        names = dict(self.sure)
        for found in kept:
            apply(names, found)
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        for name, inode in sorted(names.items()):
            path = place / name
            if not path.parent.is_dir():
                continue  # the folder that it was made in is lost
            if inode is FOLDER:
                path.mkdir(exist_ok=True)
            elif self.content[inode] is None:
                path.write_bytes(lost)
            else:
                copy(self.content[inode], path)


def apply(names, change):
    if change.gone is not None:
        names.pop(change.gone, None)
    if change.come is not None:
        names[change.come] = change.inode
