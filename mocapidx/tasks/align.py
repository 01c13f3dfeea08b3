"""Align two motions in time: which frame of one goes with which of the other."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

import numpy as np

from mocapidx.alignment.banded import WarpingPath, align_inside, refine_match
from mocapidx.alignment.coarse import Region, SegmentMatch, full_region, match_segments
from mocapidx.alignment.distances import (
    FrameDistance,
    common_joints,
    pose_distance,
    word_distance,
)
from mocapidx.durable import durable_replace
from mocapidx.errors import ParameterError
from mocapidx.features.featureset import AnyFeatureSet, FeatureSet, load_feature_set
from mocapidx.reports.alignment import alignment_picture
from mocapidx.reports.style import picture_format
from mocapidx.store.read import open_store
from mocapidx.tasks.example import parse_example
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.records import Record
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.tasks.stretch import Stretch, stretch_of_file, stretch_of_store

__all__ = [
    "PATH_COLUMNS",
    "SEGMENT_COLUMNS",
    "AlignOptions",
    "Aligned",
    "align_motions",
    "align_stretches",
    "alignment_summary",
    "draw_alignment",
    "path_records",
    "segment_records",
]

PATH_COLUMNS: Final = ("a_frame", "b_frame", "a_time", "b_time", "cost", "total")
TIMES: Final = ("a_start_time", "a_end_time", "b_start_time", "b_end_time")
SEGMENT_COLUMNS: Final = ("segment", *TIMES, "features")

FEWEST_JOINTS: Final = 3
"""Fewer say nothing about a pose once it is shifted and turned."""


@dataclass(frozen=True, slots=True)
class AlignOptions:
    """How two motions are aligned.

    Parameters
    ----------
    select : str
        The features whose segments count, as in `FeatureSet.select`.
    margin : float
        How far matched segments are widened at first, in seconds.
    distance : {"poses", "words"}
        What the fine alignment compares.
    coarse_only : bool
        Match segments, and leave it at that.
    feature_set : str, Path or FeatureSet
        Of motion files; a store has its own.
    rate : float
        Of motion files, in Hz; a store has its own.
    read : ReadOptions
        How motion files are understood.
    """

    select: str = "all"
    margin: float = 0.1
    distance: Literal["poses", "words"] = "poses"
    coarse_only: bool = False
    feature_set: AnyFeatureSet = "f39"
    rate: float = 30.0
    read: ReadOptions = field(default_factory=ReadOptions)


@dataclass(frozen=True, slots=True, eq=False)
class Aligned:
    """Two motions, aligned.

    Parameters
    ----------
    names : tuple of str
        Of the two.
    starts : tuple of int
        The frame of each motion that its frame 0 here is.
    frames : tuple of int
        How many frames of each are aligned.
    rate : float
        In Hz.
    feature_set : FeatureSet
    match : SegmentMatch or None
        The coarse alignment, where there is one.
    region : Region or None
        The cells that were looked at in the end; None where there was no fine alignment.
    path : WarpingPath or None
        The fine alignment.
    unit : {"m", "features"}
        Of its costs.
    remarks : tuple of str
        What a person should know, a sentence each.
    """

    names: tuple[str, str]
    starts: tuple[int, int]
    frames: tuple[int, int]
    rate: float
    feature_set: FeatureSet
    match: SegmentMatch | None
    region: Region | None
    path: WarpingPath | None
    unit: Literal["m", "features"]
    remarks: tuple[str, ...]

    @property
    def features(self) -> tuple[str, ...]:
        """The ids of the features whose segments agree."""
        mask = self.match.mask if self.match else 0
        return tuple(name for i, name in enumerate(self.feature_set.ids) if mask >> i & 1)


def align_motions(
    one: str | Path,
    other: str | Path,
    options: AlignOptions | None = None,
    *,
    store: str | Path | None = None,
    picture: Path | None = None,
) -> Aligned:
    """Align two motions: segment by segment, then frame by frame near the matched segments.

    Parameters
    ----------
    one, other : str or Path
        ``FILE`` or ``FILE@START:END``, in seconds.
    options : AlignOptions, optional
    store : str or Path, optional
        `one` and `other` may be names of its documents, too, in place of FILE.
    picture : Path, optional
        A .png or .svg file to draw the alignment into.

    Returns
    -------
    Aligned
        Where no segments can be matched, the fine alignment looks at all pairs of frames, and
        a remark says so.

    Raises
    ------
    FormatError
        If a file can't be used.
    ParameterError, FeatureSetError, StoreError, WriteError

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, "Efficient content-based retrieval of motion capture
       data", SIGGRAPH 2005, section 7.
    """
    options = options or AlignOptions()
    if not 0 <= options.margin <= 3600:
        raise ParameterError(f"the margin must be 0 or more seconds, got {options.margin:g}")
    if picture is not None:
        picture_format(picture)
    texts = (str(one), str(other))
    if store is None:
        feature_set, rate = load_feature_set(options.feature_set), options.rate
        a, b = (
            stretch_of_file(parse_example(text), feature_set, rate, options.read) for text in texts
        )
    else:
        with open_store(Path(store)) as snapshot:
            feature_set = store_feature_set(snapshot)
            rate = snapshot.manifest.settings.rate
            a, b = (stretch_of_store(text, snapshot, feature_set, options.read) for text in texts)
    aligned = align_stretches(a, b, feature_set, rate, options)
    if picture is not None:
        draw_alignment(aligned, picture)
    return aligned


def align_stretches(
    a: Stretch, b: Stretch, feature_set: FeatureSet, rate: float, options: AlignOptions
) -> Aligned:
    """Align two motions that were read already.

    Parameters
    ----------
    a, b : Stretch
    feature_set : FeatureSet
        Of their words.
    rate : float
        Of both, in Hz.
    options : AlignOptions
        Its feature set, rate and way to read play no part.

    Returns
    -------
    Aligned
        As of `align_motions`.

    Raises
    ------
    ParameterError
        If they are too long, or no such features are known.
    """
    mask = feature_set.select(options.select)
    unknown = mask & (a.untrusted | b.untrusted)
    remarks = []
    if unknown:
        ids = (name for i, name in enumerate(feature_set.ids) if unknown >> i & 1)
        remarks.append(f"passed over {', '.join(ids)}: the skeletons can't tell them")
    mask &= ~unknown
    match = match_segments(a.words, b.words, mask)
    region, path, unit = None, None, options.distance
    if not options.coarse_only:
        distance, unit = _distance(a, b, mask, options.distance, remarks)
        if match is None:
            region = full_region(len(a.words), len(b.words))
            path = align_inside(region, distance)
        else:
            refined = refine_match(match, distance, round(options.margin * rate))
            region, path = refined.region, refined.path
    if match is None:
        remarks.append(
            "no coarse alignment: no selected feature changes equally often in both"
            + ("" if options.coarse_only else "; all pairs of frames were looked at")
        )
    return Aligned(
        (a.name, b.name),
        (a.start, b.start),
        (len(a.words), len(b.words)),
        rate,
        feature_set,
        match,
        region,
        path,
        "m" if unit == "poses" else "features",
        tuple(remarks),
    )


def _distance(
    a: Stretch, b: Stretch, mask: int, wanted: Literal["poses", "words"], remarks: list[str]
) -> tuple[FrameDistance, Literal["poses", "words"]]:
    """Choose what frames are compared by; say so where it is not what was wanted."""
    if wanted == "poses" and a.poses is not None and b.poses is not None:
        joints = common_joints(a.poses, b.poses)
        if joints.sum() >= FEWEST_JOINTS:
            return pose_distance(a.poses[:, joints], b.poses[:, joints]), "poses"
        remarks.append("the skeletons share too few joints, so feature words were compared")
    elif wanted == "poses":
        remarks.append("the store keeps no poses, so feature words were compared")
    return word_distance(a.words, b.words, mask), "words"


def path_records(aligned: Aligned) -> Iterator[Record]:
    """Lay out the warping path, a record for each pair of frames.

    Parameters
    ----------
    aligned : Aligned

    Yields
    ------
    dict
        Frames and seconds in the two motions, the distance of the frames, and the sum of the
        distances so far: the last is the cost of the alignment.
    """
    if aligned.path is None:
        return
    path, (a, b) = aligned.path, aligned.starts
    totals = np.cumsum(path.costs).tolist()
    rows = zip(path.rows.tolist(), path.columns.tolist(), path.costs.tolist(), totals, strict=True)
    for row, column, cost, total in rows:
        yield {
            "a_frame": a + row,
            "b_frame": b + column,
            "a_time": round((a + row) / aligned.rate, 6),
            "b_time": round((b + column) / aligned.rate, 6),
            "cost": round(cost, 6),
            "total": round(total, 6),
        }


def segment_records(aligned: Aligned) -> Iterator[Record]:
    """Lay out the coarse alignment, a record for each segment.

    Parameters
    ----------
    aligned : Aligned

    Yields
    ------
    dict
        Half-open ranges of frames, and the same in seconds; `features` names those that are
        1, of those that agree.
    """
    match = aligned.match
    if match is None:
        return
    a, b = match.bounds + aligned.starts[0], match.other_bounds + aligned.starts[1]
    for segment, word in enumerate(match.words.tolist()):
        ends = [bounds[segment + n] for bounds in (a, b) for n in (0, 1)]
        names = ("a_start", "a_end", "b_start", "b_end")
        yield {
            "segment": segment,
            **{f"{name}_frame": int(end) for name, end in zip(names, ends, strict=True)},
            **{
                f"{name}_time": round(float(end) / aligned.rate, 6)
                for name, end in zip(names, ends, strict=True)
            },
            "features": ",".join(
                name for i, name in enumerate(aligned.feature_set.ids) if word >> i & 1
            ),
        }


def alignment_summary(aligned: Aligned) -> str:
    """Say in one line how two motions were aligned."""
    parts = []
    if aligned.match is not None:
        features = ", ".join(aligned.features)
        parts.append(f"{len(aligned.match.words)} segments matched by {features}")
    if aligned.path is not None and aligned.region is not None:
        steps = len(aligned.path.costs)
        cost = aligned.path.cost
        parts.append(f"cost {cost:.4g} {aligned.unit} in {steps} steps, {cost / steps:.3g} a step")
        pairs = aligned.frames[0] * aligned.frames[1]
        parts.append(f"{aligned.region.share:.1%} of {pairs} pairs of frames looked at")
    return "; ".join(parts) or "not aligned"


def draw_alignment(aligned: Aligned, picture: Path) -> None:
    """Draw the matched segments, the region around them and the warping path.

    Parameters
    ----------
    aligned : Aligned
    picture : Path
        A .png or .svg file.

    Raises
    ------
    ParameterError, WriteError
    """
    suffix = picture_format(picture)
    data = alignment_picture(
        aligned.names,
        aligned.frames,
        aligned.starts,
        aligned.rate,
        match=aligned.match,
        region=aligned.region,
        path=aligned.path,
        subtitle=alignment_summary(aligned),
        suffix=suffix,
    )
    durable_replace(picture, data)
