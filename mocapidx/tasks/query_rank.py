"""Costs of hits: by the lengths of their steps, by time warping, by a template of the example."""

from collections.abc import Callable, Iterator
from typing import Final, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError
from mocapidx.model import FloatArray, WordArray
from mocapidx.queries.rank import length_costs
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.answers import Answer, Archive
from mocapidx.tasks.query_example import LoadedExample
from mocapidx.tasks.stored import pose_rows

# Alignment and templates are imported where they are needed: to rank by lengths needs neither.

__all__ = ["RANKINGS", "Costs", "costs_by"]

Costs: TypeAlias = Callable[[LoadedExample, Answer], FloatArray]
Ranking: TypeAlias = Callable[[Archive, LoadedExample, Answer], FloatArray]
Frames = TypeVar("Frames", bound=np.generic)

FEWEST_JOINTS: Final = 3
"""Fewer say nothing about a pose once it is shifted and turned."""

UNKNOWN: Final = 1.0
"""The cost where nothing can be compared: a metre off, or every feature wrong."""

LONGEST: Final = 1024
"""Frames; a longer hit or example is thinned out before it is warped."""


def costs_by(rank: str, archive: Archive) -> Costs:
    """Give the way in which hits of an example are ranked.

    Parameters
    ----------
    rank : {"length", "dtw", "template", "none"}
    archive : Archive

    Returns
    -------
    callable
        From an example and an answer to a cost for each hit, float64 of shape (H,).

    Raises
    ------
    ParameterError
        If there is no such ranking.
    """
    if rank not in RANKINGS:
        raise ParameterError(f"no ranking '{rank}': take one of {', '.join(RANKINGS)}")
    return lambda example, answer: RANKINGS[rank](archive, example, answer)


def _none(archive: Archive, example: LoadedExample, answer: Answer) -> FloatArray:
    return np.zeros(len(answer.documents))


def _length(archive: Archive, example: LoadedExample, answer: Answer) -> FloatArray:
    if answer.pattern is None:
        return np.zeros(0)
    return length_costs(answer.bounds, answer.pattern.lengths)


def _dtw(archive: Archive, example: LoadedExample, answer: Answer) -> FloatArray:
    """Warp the example and each hit; the mean over the path of what the frames differ by.

    Poses where there are any, in metres; else all features that both can tell, as a share.
    """
    mask = _trusted(archive, example, answer)
    words, poses = _thinned(example.words), example.poses
    if poses is not None:
        poses = _thinned(poses)
    costs = []
    for rows in _cores(answer):
        if poses is not None and archive.snapshot.manifest.settings.poses:
            found = pose_rows(archive.snapshot, answer.place.file, *rows)
            costs.append(_pose_cost(poses, _thinned(found.astype(np.float64))))
        else:
            found = archive.snapshot.array(answer.place.file, FRAME_WORDS.path, *rows)
            costs.append(_word_cost(words, _thinned(found.astype(np.uint64)), mask))
    return np.array(costs, np.float64)


def _pose_cost(example: FloatArray, found: FloatArray) -> float:
    from mocapidx.alignment.banded import align_inside
    from mocapidx.alignment.coarse import full_region
    from mocapidx.alignment.distances import common_joints, pose_distance

    joints = common_joints(example, found)
    if joints.sum() < FEWEST_JOINTS:
        return UNKNOWN
    distance = pose_distance(example[:, joints], found[:, joints])
    return float(align_inside(full_region(len(example), len(found)), distance).costs.mean())


def _word_cost(example: WordArray, found: WordArray, mask: int) -> float:
    from mocapidx.alignment.banded import align_inside
    from mocapidx.alignment.coarse import full_region
    from mocapidx.alignment.distances import word_distance

    distance = word_distance(example, found, mask)
    path = align_inside(full_region(len(example), len(found)), distance)
    return float(path.costs.mean()) / max(mask.bit_count(), 1)


def _template(archive: Archive, example: LoadedExample, answer: Answer) -> FloatArray:
    """Match the example as a template that decides everything with each hit.

    The cost is the share of features that disagree along the best match; a hit that is less
    than half as long as the example is matched together with what is around it.
    """
    from mocapidx.alignment.subsequence import shortest_match
    from mocapidx.templates.match import lowest_costs, match_documents
    from mocapidx.templates.quantise import Quantised

    if not len(answer.documents):
        return np.zeros(0)
    mask = np.uint64(_trusted(archive, example, answer))
    care = np.full(len(example.words), mask)
    template = Quantised(example.words & mask, care, np.bitwise_count(care).astype(np.int64))
    pieces = [
        archive.snapshot.array(answer.place.file, FRAME_WORDS.path, *rows).astype(np.uint64)
        for rows in _cores(answer, shortest_match(len(care)))
    ]
    bounds = np.concatenate(([0], np.cumsum([len(piece) for piece in pieces]))).astype(np.int64)
    costs = lowest_costs(match_documents(template, np.concatenate(pieces), bounds))
    return np.minimum(costs.astype(np.float64), UNKNOWN)


def _trusted(archive: Archive, example: LoadedExample, answer: Answer) -> int:
    """Give the mask of the features that example and documents both can tell."""
    everything = (1 << len(archive.feature_set.features)) - 1
    return everything & ~example.untrusted & ~answer.group.untrusted


def _cores(answer: Answer, least: int = 1) -> Iterator[tuple[int, int]]:
    """Yield the rows of each hit among the frames of its file.

    Of the first and the last step no more counts than the example has of them, however long a
    person stood still before and after; but at least so many frames, where the document has them.
    """
    if answer.pattern is None or not len(answer.documents):
        return
    lengths = answer.pattern.lengths
    starts = np.maximum(answer.bounds[:, 0], answer.bounds[:, 1] - lengths[0])
    ends = np.minimum(answer.bounds[:, -1], answer.bounds[:, -2] + lengths[-1])
    ends = np.maximum(ends, starts + 1)
    lacking = np.maximum(least - (ends - starts), 0)
    frames = answer.place.source.lengths[answer.documents]
    starts = np.maximum(starts - (lacking + 1) // 2, 0)
    ends = np.minimum(np.maximum(ends, starts + least), frames)
    starts = np.maximum(np.minimum(starts, ends - least), 0)
    placed = answer.place.placed
    rows = zip(answer.documents.tolist(), starts.tolist(), ends.tolist(), strict=True)
    for document, start, end in rows:
        offset = placed[document].frame_offset
        yield offset + start, offset + end


def _thinned(frames: NDArray[Frames]) -> NDArray[Frames]:
    if len(frames) <= LONGEST:
        return frames
    return frames[np.linspace(0, len(frames) - 1, LONGEST).astype(np.int64)]


RANKINGS: Final[dict[str, Ranking]] = {
    "length": _length,
    "dtw": _dtw,
    "template": _template,
    "none": _none,
}
