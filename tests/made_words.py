"""Small stores of made-up feature words, with their inverted lists."""

import numpy as np

from mocapidx.features.featureset import PARTS, load_feature_set
from mocapidx.features.words import pack_words
from mocapidx.index.build import build_runs
from mocapidx.index.postings import encode_index
from mocapidx.store import schema
from mocapidx.store.manifest import StoreSettings
from mocapidx.store.write import Batch, writing
from tests.made_store import make_document

F39 = load_feature_set("f39")
GESTURES = {"raise": range(0, 8), "kick": range(14, 22), "bow": range(28, 36)}


def gesture(name, rng):
    """Eight features that come one after the other and go in the same order; bool (T, 39)."""
    bits = np.zeros((16, 39), dtype=bool)
    bits[:8, GESTURES[name]] = np.tri(8, dtype=bool)
    bits[8:, GESTURES[name]] = ~np.tri(8, dtype=bool)
    return np.repeat(bits, rng.integers(2, 4, 16), axis=0)


def rest(frames):
    return np.zeros((frames, 39), dtype=bool)


def make_word_store(path, documents, *, untrusted=None, feature_set=F39, rate=30.0, batches=1):
    """Write a store of documents, given as bool (T, 39) by their names."""
    settings = StoreSettings(
        rate, feature_set.name, feature_set.digest, feature_set.text, poses=False
    )
    names = list(documents)
    with writing(path, command="test", create=settings) as writer:
        for some in np.array_split(np.arange(len(names)), batches):
            writer.commit(_batch({names[n]: documents[names[n]] for n in some}, untrusted or {}))
    return path


def _batch(documents, untrusted):
    words = [pack_words(bits) for bits in documents.values()]
    runs = {part: build_runs(words, F39.part_mask(part)) for part in PARTS}
    index, head = encode_index({part: one.words for part, one in runs.items()})
    arrays = {schema.FRAME_WORDS.path: words}
    for part, one in runs.items():
        arrays[schema.RUN_STARTS[part].path] = one.starts
        arrays[schema.RUN_WORDS[part].path] = one.words
    records = tuple(
        make_document(name, len(bits), rig={"untrusted": f"{untrusted.get(name, 0):x}"})
        for name, bits in documents.items()
    )
    return Batch(records, arrays, index, head)
