"""Documents to one batch of a store: words, runs and inverted lists laid end to end."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from mocapidx.features.featureset import PARTS, FeatureSet
from mocapidx.index.build import build_runs
from mocapidx.index.postings import encode_index
from mocapidx.model import WordArray
from mocapidx.store.manifest import Document
from mocapidx.store.write import Batch

__all__ = ["make_batch"]


def make_batch(
    documents: Sequence[Document],
    words: Sequence[WordArray],
    poses: Callable[[], Iterable[NDArray[np.float32]]] | None,
    feature_set: FeatureSet,
) -> Batch:
    """Lay documents end to end and build the runs and inverted lists over them.

    Parameters
    ----------
    documents : sequence of Document, length D
    words : sequence of ndarray of uint64, each of shape (T,)
        The feature words of each document.
    poses : callable or None
        Gives the joint positions of each document, float32 (T, 24, 3), in metres; called once,
        and none is held longer than it takes to write it. None: the store keeps no poses.
    feature_set : FeatureSet

    Returns
    -------
    Batch
    """
    runs = {part: build_runs(words, feature_set.part_mask(part)) for part in PARTS}
    index, head = encode_index({part: found.words for part, found in runs.items()})
    arrays: dict[str, NDArray[np.generic] | Iterable[NDArray[np.generic]]] = {
        "frames/words": np.concatenate(words)
    }
    if poses is not None:
        arrays["frames/poses"] = poses()
    for part, found in runs.items():
        arrays[f"runs/{part}/starts"] = found.starts
        arrays[f"runs/{part}/words"] = found.words
    return Batch(documents, arrays, index, head)
