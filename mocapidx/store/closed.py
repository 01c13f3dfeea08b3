"""Check that an HDF5 file holds what the format says and nothing else; run in a process of its own.

HDF5 can be made to crash, hang or eat memory by a file, so `mocapidx.store.verify` starts this
module as a child with limits. Only known names are looked up, each link's kind before what it
leads to, and no data is read.
"""

import json
import os
import resource
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from mocapidx.store import schema
from mocapidx.store.hdf5 import h5a, h5d, h5f, h5g, h5l, h5o, h5t
from mocapidx.store.limits import limit

__all__ = ["MEMORY", "SECONDS", "check_closed", "main"]

MEMORY: Final = 2 << 30
SECONDS: Final = 20


def check_closed(path: Path, datasets: Mapping[str, tuple[tuple[int, ...], int]]) -> str | None:
    """Compare an HDF5 file with the closed schema.

    Parameters
    ----------
    path : Path
        The file.
    datasets : mapping of str to (shape, offset)
        What it should hold.

    Returns
    -------
    str or None
        The first thing that is wrong.
    """
    try:
        file = h5f.open(os.fsencode(path), h5f.ACC_RDONLY)
    except (OSError, RuntimeError) as exc:
        return f"not a readable HDF5 file: {str(exc).splitlines()[0][:200]}"
    try:
        if file.get_create_plist().get_userblock():
            return "has a user block"
        return _check_group(file, "", datasets)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as exc:
        return f"HDF5 refuses a part of it: {str(exc).splitlines()[0][:200]}"
    finally:
        file.close()


def _check_group(
    file: Any, prefix: str, datasets: Mapping[str, tuple[tuple[int, ...], int]]
) -> str | None:
    group = h5g.open(file, f"/{prefix}".encode())
    names = sorted(
        {path[len(prefix) :].split("/")[0] for path in datasets if path.startswith(prefix)}
    )
    if h5a.get_num_attrs(group):
        return f"/{prefix} has attributes"
    if group.get_num_objs() != len(names):
        return f"/{prefix} has {group.get_num_objs()} members, expected {len(names)}"
    for name in names:
        path = prefix + name
        if not group.links.exists(name.encode()):
            return f"{path} is missing"
        if group.links.get_info(name.encode()).type != h5l.TYPE_HARD:
            return f"{path} is a link to somewhere else"
        expected = h5o.TYPE_DATASET if path in datasets else h5o.TYPE_GROUP
        if h5o.get_info(group, name.encode()).type != expected:
            return f"{path} is of another kind"
        if path in datasets:
            fault = _check_dataset(file, path, *datasets[path])
        else:
            fault = _check_group(file, f"{path}/", datasets)
        if fault:
            return fault
    return None


def _check_dataset(file: Any, path: str, shape: tuple[int, ...], offset: int) -> str | None:
    dataset = h5d.open(file, path.encode())
    plist, kind = dataset.get_create_plist(), dataset.get_type()
    if plist.get_layout() != h5d.CONTIGUOUS:
        return f"{path} is not contiguous"
    if plist.get_nfilters():
        return f"{path} has filters"
    if plist.get_external_count():
        return f"{path} keeps its data in another file"
    if h5a.get_num_attrs(dataset):
        return f"{path} has attributes"
    if kind.committed() or not kind.equal(h5t.py_create(schema.COLUMNS[path].dtype)):
        return f"{path} has another type than {schema.COLUMNS[path].dtype}"
    if dataset.shape != shape:
        return f"{path} has the shape {dataset.shape}, expected {shape}"
    if dataset.get_offset() != offset:
        return f"{path} lies at byte {dataset.get_offset()}, expected {offset}"
    return None


def main() -> None:
    """Check the files that standard input names and print what is wrong, a line of JSON each.

    An empty line before them says that whatever happens now is the doing of the files.
    """
    limit(resource.RLIMIT_AS, MEMORY)
    limit(resource.RLIMIT_CPU, SECONDS)
    limit(resource.RLIMIT_CORE, 0)
    question = json.load(sys.stdin)
    sys.stdout.write("\n")
    sys.stdout.flush()
    for path, datasets in question:
        known = {name: (tuple(shape), offset) for name, (shape, offset) in datasets.items()}
        sys.stdout.write(json.dumps(check_closed(Path(path), known)) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
