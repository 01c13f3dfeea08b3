"""Make a large store of a small one, quickly."""

import hashlib
from dataclasses import replace

from mocapidx.store.read import open_store
from mocapidx.store.write import writing
from mocapidx.tasks.batch import make_batch
from mocapidx.tasks.index import BATCH_BYTES
from mocapidx.tasks.segment_sources import store_feature_set

__all__ = ["multiply_store"]


def multiply_store(source, target, size):
    """Write the documents of a store again and again, under new names, until there are enough.

    Parameters
    ----------
    source : Path
        A store with poses.
    target : Path
        The store to be made, in segment files as large as those of `index`.
    size : int
        Bytes that it has at least.
    """
    with open_store(source) as snapshot:
        feature_set, settings = store_feature_set(snapshot), snapshot.manifest.settings
        known = []
        for entry in snapshot.documents():
            rows = entry.frame_offset, entry.frame_offset + entry.document.frames
            words, poses = (
                snapshot.array(entry.file, f"frames/{name}", *rows) for name in ("words", "poses")
            )
            known.append((entry.document, words, poses))
    each = sum(words.nbytes + poses.nbytes for _, words, poses in known)
    done = 0
    with writing(target, command="test", create=settings) as writer:
        while done * each < size:
            batch = [
                (renamed(document, number), words, poses)
                for number in range(done, done + max(1, BATCH_BYTES // each))
                for document, words, poses in known
            ]
            documents, words, poses = zip(*batch, strict=True)
            writer.commit(make_batch(documents, words, lambda poses=poses: poses, feature_set))
            done += len(batch) // len(known)


def renamed(document, number):
    name = f"{number:06d}/{document.name}"
    digest = hashlib.blake2b(name.encode(), digest_size=16).hexdigest()
    return replace(document, name=name, digest=digest)
