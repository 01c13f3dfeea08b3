"""What a file of points does not say of itself: its unit and what is up, as far as need be."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from mocapidx.model import FloatArray, PointRecording, Up
from mocapidx.skeleton.bodychecks import (
    LONGEST_LEG,
    LOWER,
    SHORTEST_LEG,
    UPPER,
    coincident_joints,
    facing,
    leg_length,
    limb_length,
    middle,
    nearest_unit,
    up_axis,
)
from mocapidx.skeleton.conventions import Conventions, Overrides
from mocapidx.skeleton.markers import PointMapping, marker_joints
from mocapidx.skeleton.quantiles import median
from mocapidx.skeleton.rotations import upright

__all__ = ["detect_point_conventions"]

SAMPLES: Final = 64  # frames looked at, spread over those that show most
# Hips told by markers at the waist lie that much above the joint, in metres.
WAIST: Final = 0.15
LYING: Final = 0.4  # of the height along another axis: less is odd


def detect_point_conventions(
    recording: PointRecording, mapping: PointMapping, overrides: Overrides | None = None
) -> Conventions:
    """Find out how a file of points is to be read.

    Parameters
    ----------
    recording : PointRecording
        The file as it stands, at least one frame.
    mapping : PointMapping
        How the canonical joints follow.
    overrides : Overrides, optional
        What the user knows better.

    Returns
    -------
    Conventions
        The guesses and their evidence; there are no root positions to add or replace.
    """
    said = overrides or Overrides()
    points = recording.positions[_telling(recording.positions, mapping.used)]
    unit = (
        said.unit
        or recording.unit
        or nearest_unit(limb_length(marker_joints(mapping, points, 1.0)))
    )
    poses = marker_joints(mapping, points, unit) * unit
    stands = up_axis(poses)
    up = said.up or recording.up or stands
    height, standing = (_height(poses @ upright(axis).T) for axis in (up, stands))
    odd = [] if said.up else _lying(up, stands, height, standing)
    poses = poses @ upright(up).T
    leg, cosine = leg_length(poses), facing(poses)
    return Conventions(
        joint_map=mapping.marker_map.name,
        unit=unit,
        up=up,
        root_positions=None,
        first_frame="dropped T-pose" if _drops(recording, said) else "motion",
        made=mapping.made,
        missing=mapping.missing,
        coincident=coincident_joints(poses),
        evidence=(
            f"unit: {unit:.6g} m, {_legs(leg)} "
            f"({_reason(said.unit, recording.unit, 'guessed by the length of the limbs')})",
            f"up: {up}, the body is {height:.2f} m high along it "
            f"({_reason(said.up, recording.up, 'guessed')})",
            _front(cosine),
        ),
        warnings=(*recording.remarks, *odd, *_warnings(leg, cosine)),
    )


def _telling(
    positions: FloatArray, used: Sequence[int]
) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return some frames, spread over those in which the most points are seen."""
    seen = np.isfinite(positions[:, used]).all(axis=2).sum(axis=1)
    best = np.flatnonzero(seen == seen.max())
    chosen = np.linspace(0, len(best) - 1, min(SAMPLES, len(best))).astype(np.int64)
    return best[chosen]


def _drops(recording: PointRecording, said: Overrides) -> bool:
    return said.keep_first_frame is False and len(recording.positions) > 1


def _height(poses: FloatArray) -> float:
    """Return how high the body is, from its lowest to its highest known part, in metres."""
    heights = (middle(poses, UPPER) - middle(poses, LOWER))[:, 1]
    known = heights[np.isfinite(heights)]
    return float(median(known)) if len(known) else np.nan


def _lying(up: Up, stands: Up, height: float, standing: float) -> list[str]:
    """Doubt the axis that a file says where the body lies or hangs in most of the take."""
    if up == stands or not height < LYING * standing:
        return []
    return [
        f"along {up}, which the file says is up, the body is {height:.2f} m high, along {stands} "
        f"{standing:.2f} m: --up {stands}?"
    ]


def _reason(told: object, file: object, guess: str) -> str:
    if told is not None:
        return "as told"
    return "as the file says" if file is not None else guess


def _legs(leg: float) -> str:
    return f"which makes legs of {leg:.2f} m" if np.isfinite(leg) else "legs are not known"


def _front(cosine: float) -> str:
    if not np.isfinite(cosine):
        return "facing: not known without hips and toes"
    return f"facing: cosine of toes and front {cosine:.2f} (0.95 when map and sides are right)"


def _warnings(leg: float, cosine: float) -> list[str]:
    warnings = []
    if np.isfinite(leg) and not SHORTEST_LEG <= leg <= LONGEST_LEG + WAIST:
        warnings.append(f"legs of {leg:.2f} m are no adult's: is the unit right?")
    if cosine < 0:
        warnings.append("the toes point backwards: sides exchanged, or a mirrored axis system?")
    return warnings
