"""How far people differ in each feature, in a store: measured, shipped, or the larger of both."""

from typing import Final

import numpy as np

from mocapidx.features.featureset import FeatureSet
from mocapidx.model import FloatArray
from mocapidx.store.read import Snapshot
from mocapidx.store.sigma import MeasuredSigma, read_sigma, save_sigma
from mocapidx.tasks.store_poses import read_sample
from mocapidx.templates.sigma import FEWEST_DOCUMENTS, Sample, estimate_sigma, usual_sigma

__all__ = ["store_sigma"]

SAMPLE_SECONDS: Final = 600.0
PIECE_SECONDS: Final = 60.0
"""The most that is taken from one document, so that a long one is not all there is."""
SEED: Final = 2005


def store_sigma(snapshot: Snapshot, feature_set: FeatureSet) -> FloatArray:
    """Give the standard deviation of each feature between people who do the same thing.

    Parameters
    ----------
    snapshot : Snapshot
    feature_set : FeatureSet
        The store's.

    Returns
    -------
    ndarray of float64, shape (F,)
        The larger of what is usual and of what the store itself says, if it has poses and
        enough documents. The store's own values are kept with it where it may be written, and
        measured again when it has doubled.
    """
    usual = usual_sigma(feature_set)
    documents = snapshot.documents()
    if len(documents) < FEWEST_DOCUMENTS or not snapshot.manifest.settings.poses:
        return usual
    frames = sum(placed.document.frames for placed in documents)
    digest = snapshot.manifest.settings.feature_set_digest
    known = read_sigma(snapshot.path)
    if known is None or not known.holds_for(digest, frames) or len(known.sigma) != len(usual):
        samples = _samples(snapshot, feature_set)
        own = estimate_sigma(samples, feature_set, snapshot.manifest.settings.rate)
        known = MeasuredSigma(tuple(own.tolist()), digest, frames)
        save_sigma(snapshot.path, known)
    larger: FloatArray = np.fmax(np.array(known.sigma), usual)
    return larger


def _samples(snapshot: Snapshot, feature_set: FeatureSet) -> list[Sample]:
    """Draw documents, and a piece of each that is long; the same ones for the same documents."""
    rate = snapshot.manifest.settings.rate
    wanted, longest = round(SAMPLE_SECONDS * rate), round(PIECE_SECONDS * rate)
    documents = sorted(snapshot.documents(), key=lambda placed: placed.document.name)
    rng = np.random.default_rng(SEED)
    samples: list[Sample] = []
    for number in rng.permutation(len(documents)).tolist():
        placed = documents[number]
        length = min(placed.document.frames, longest)
        start = int(rng.integers(0, placed.document.frames - length + 1))
        samples.append(read_sample(snapshot, placed, start, start + length, feature_set))
        wanted -= length
        if wanted <= 0:
            break
    return samples
