"""Keyframes in front of a search: what they leave of the motion, and whether that paid."""

from collections.abc import Iterator
from dataclasses import dataclass

from mocapidx.model import FloatArray, IndexArray
from mocapidx.tasks.store_words import WordBatch
from mocapidx.templates.keyframes import Keyframes, preselect
from mocapidx.templates.quantise import Quantised

__all__ = ["Preselection", "preselected", "preselection_remarks"]


@dataclass(frozen=True, slots=True)
class Preselection:
    """Keyframes that leave little to be matched.

    Parameters
    ----------
    quantised : Quantised
        The template.
    keyframes : Keyframes
    padded : bool
        Whether matching will repeat the first and the last frame of a document.
    """

    quantised: Quantised
    keyframes: Keyframes
    padded: bool


def preselected(preselection: Preselection, batch: WordBatch) -> WordBatch:
    """Leave where the keyframes follow one another.

    Parameters
    ----------
    preselection : Preselection
    batch : WordBatch

    Returns
    -------
    WordBatch
        Pieces of its documents; perhaps none.
    """
    pieces = preselect(
        preselection.quantised.without(batch.untrusted),
        preselection.keyframes,
        batch.words,
        batch.bounds,
        preselection.padded,
    )
    return batch.cut(pieces.documents, pieces.starts, pieces.ends)


def preselection_remarks(
    keyframes: Keyframes, frames: IndexArray, seconds: FloatArray
) -> Iterator[str]:
    """Say how much the keyframes left and what that cost, and whether they paid.

    Parameters
    ----------
    keyframes : Keyframes
    frames : ndarray of int64, shape (2,)
        Before the preselection and after it.
    seconds : ndarray of float64, shape (2,)
        Of preselecting and of matching.

    Yields
    ------
    str
    """
    (total, kept), (spent, matching) = frames.tolist(), seconds.tolist()
    rows = ", ".join(map(str, keyframes.rows))
    yield (
        f"keyframes {rows} with up to {keyframes.tolerance} disagreeing entries left "
        f"{100 * kept / max(total, 1):.1f} % of the motion in {spent:.2f} s; "
        "this can lose hits, --keyframes none can't"
    )
    if kept and spent > matching / kept * (total - kept):
        yield "the keyframes didn't pay: to match what they left out takes no longer"
