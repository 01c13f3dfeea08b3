"""Small stores of made-up documents."""

import hashlib
from pathlib import Path

import numpy as np

from mocapidx.store import schema
from mocapidx.store.manifest import Document, StoreSettings
from mocapidx.store.read import open_store
from mocapidx.store.write import Batch, writing

SETTINGS = StoreSettings(
    rate=30.0,
    feature_set_name="tiny",
    feature_set_digest="ab" * 32,
    feature_set_text="name = 'tiny'\n",
)


def make_document(name, frames, **changes):
    """A record that says `frames` and makes the rest up from the name."""
    values = {
        "name": name,
        "root": "/takes",
        "path": None,
        "digest": hashlib.blake2b(name.encode(errors="surrogatepass"), digest_size=16).hexdigest(),
        "size": 1000 + frames,
        "mtime_ns": 1_700_000_000_000_000_000,
        "frames": frames,
        "source_frames": 4 * frames,
        "source_rate": 120.0,
        "rig": {"unit": 0.0254, "untrusted": 0},
    }
    return Document(**{**values, **changes})


def make_batch(frames_by_name, *, poses=True, seed=0, **changes):
    """Random words and poses; each frame is a run, which is all the store cares for."""
    random = np.random.default_rng([seed, *frames_by_name.values()])
    documents = tuple(make_document(n, t, **changes) for n, t in frames_by_name.items())
    words = [random.integers(0, 1 << 39, t, dtype=np.uint64) for t in frames_by_name.values()]
    arrays = {schema.FRAME_WORDS.path: words}
    if poses:
        arrays[schema.POSES.path] = [
            random.normal(size=(t, 24, 3)).astype(np.float32) for t in frames_by_name.values()
        ]
    rows = sum(frames_by_name.values()) + len(documents)
    for part in schema.PARTS:
        arrays[schema.RUN_STARTS[part].path] = np.arange(rows, dtype=np.uint32)
        arrays[schema.RUN_WORDS[part].path] = random.integers(0, 1 << 12, rows, dtype=np.uint32)
    index = random.bytes(300)
    return Batch(documents, arrays, index, 100)


def store_bytes(path):
    """Every file of a store but its lock, by its name."""
    return {
        str(place.relative_to(path)): place.read_bytes()
        for place in sorted(Path(path).rglob("*"))
        if place.is_file() and place.name != "LOCK"
    }


def make_store(path):
    """Write a store of two segment files with five documents."""
    with writing(path, command="test", create=SETTINGS) as writer:
        writer.commit(make_batch({"a/walk.amc": 40, "a/jog.amc": 25, "b/kick.amc": 31}))
        writer.commit(make_batch({"c.bvh": 12, "d \udc80\x1b.bvh": 7}, seed=1))
    return path


def names_of(path):
    """The live documents of a store, sorted."""
    with open_store(path) as snapshot:
        return sorted(entry.document.name for entry in snapshot.documents())


def read_everything(path):
    """All that a reader can ask of a store; every byte that it uses is checked on the way."""
    with open_store(path) as snapshot:
        found = [snapshot.manifest]
        for file in snapshot.files:
            found += [snapshot.array(file, name).tobytes() for name in sorted(file.datasets)]
            found.append(snapshot.index_head(file))
    return found
