"""What a motion file does not say of itself: its unit, what is up, how the root moves.

A BVH file is numbers without a unit. What they mean is guessed from what a body must be: legs
of human length, a head above the feet, feet on the floor. Each guess comes with its evidence,
and each can be overruled.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal, get_args

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import FloatArray, IndexArray, Recording
from mocapidx.skeleton.bodychecks import (
    LONGEST_LEG,
    SHORTEST_LEG,
    coincident_joints,
    facing,
    leg_length,
    nearest_unit,
    unit_vectors,
    up_axis,
)
from mocapidx.skeleton.canonical import canonical_positions, made_joints
from mocapidx.skeleton.jointmap import Mapping24
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.skeleton.kinematics import RootPositions
from mocapidx.skeleton.quantiles import median, quantile
from mocapidx.skeleton.rotations import Up, upright

__all__ = ["Conventions", "Overrides", "detect_conventions"]

FirstFrame = Literal["motion", "dropped T-pose"]

SAMPLES: Final = 64  # frames looked at, spread over the take
SMALL_TURN: Final = np.deg2rad(10.0)  # no T-pose is as near to the motion as that
JUMP: Final = 0.05  # metres that a joint moves on average between a T-pose and the motion
JUMP_RATIO: Final = 5.0  # and how many times the largest step that follows


@dataclass(frozen=True, slots=True)
class Overrides:
    """What the user says of a file; None: find out.

    Parameters
    ----------
    unit : float or None
        Metres in one file unit.
    up : {"x", "y", "z", "-x", "-y", "-z"} or None
        The axis that points up.
    root_positions : {"add", "replace"} or None
        Whether position channels add to a joint's OFFSET or replace it.
    keep_first_frame : bool or None
        True: frame 0 is motion; False: it is a pose to drop.
    """

    unit: float | None = None
    up: Up | None = None
    root_positions: RootPositions | None = None
    keep_first_frame: bool | None = None

    def __post_init__(self) -> None:
        if self.unit is not None and not 1e-6 <= self.unit <= 1e6:
            raise ParameterError(f"unit must be metres in one file unit, got {self.unit}")
        if self.up is not None and self.up not in get_args(Up):
            raise ParameterError(f"up must be one of {', '.join(get_args(Up))}, got {self.up!r}")
        if self.root_positions not in (None, *get_args(RootPositions)):
            raise ParameterError(
                f"root_positions must be add or replace, got {self.root_positions!r}"
            )


@dataclass(frozen=True, slots=True)
class Conventions:
    """How a file was read, and why so.

    Parameters
    ----------
    joint_map : str
        The name of the joint map.
    unit : float
        Metres in one file unit.
    up : {"x", "y", "z", "-x", "-y", "-z"}
        The axis of the file that points up.
    root_positions : {"add", "replace"} or None
        Whether position channels add to a joint's OFFSET or replace it; None: there are none.
    first_frame : {"motion", "dropped T-pose"}
        What frame 0 of the file is.
    made : tuple of str
        Canonical joints that the map made up.
    missing : tuple of str
        Canonical joints that are not there at all.
    coincident : tuple of pairs of str
        Canonical joints that are one point through the whole take.
    evidence : tuple of str
        For people: one line a guess.
    warnings : tuple of str
        For people: what looks wrong.
    """

    joint_map: str
    unit: float
    up: Up
    root_positions: RootPositions | None
    first_frame: FirstFrame
    made: tuple[str, ...]
    missing: tuple[str, ...]
    coincident: tuple[tuple[str, str], ...]
    evidence: tuple[str, ...]
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return what a store keeps: everything but evidence and warnings, ready for JSON."""
        return {
            "joint_map": self.joint_map,
            "unit": self.unit,
            "up": self.up,
            "root_positions": self.root_positions,
            "first_frame": self.first_frame,
            "made": list(self.made),
            "missing": list(self.missing),
            "coincident": [list(pair) for pair in self.coincident],
        }


def detect_conventions(
    recording: Recording, mapping: Mapping24, overrides: Overrides | None = None
) -> Conventions:
    """Find out how a file is to be read.

    Parameters
    ----------
    recording : Recording
        The file as it stands, at least one frame.
    mapping : Mapping24
        Which node is which canonical joint.
    overrides : Overrides, optional
        What the user knows better.

    Returns
    -------
    Conventions
        The guesses and their evidence.
    """
    said = overrides or Overrides()
    dropped, first_evidence = _first_frame(recording, mapping, said)
    frames = _spread(int(dropped), len(recording.values))
    looks = {
        positions: _look(recording, mapping, positions, frames, said)
        for positions in _candidates(recording, said)
    }
    positions, positions_evidence = _choose_positions(recording, looks, said)
    look = looks[positions]
    poses = (look.poses * look.unit) @ upright(look.up).T
    cosine = facing(poses)
    warnings = []
    if not SHORTEST_LEG <= look.leg <= LONGEST_LEG:
        warnings.append(f"legs of {look.leg:.2f} m are no adult's: is the unit right?")
    if cosine < 0:
        warnings.append("the toes point backwards: sides exchanged, or a mirrored axis system?")
    made = made_joints(mapping)
    return Conventions(
        joint_map=mapping.joint_map.name,
        unit=look.unit,
        up=look.up,
        root_positions=positions,
        first_frame="dropped T-pose" if dropped else "motion",
        made=tuple(j for j in CANONICAL_JOINTS if j in made),
        missing=tuple(
            j
            for j, n in zip(CANONICAL_JOINTS, mapping.nodes, strict=True)
            if n < 0 and j not in made
        ),
        coincident=coincident_joints(poses),
        evidence=(
            *recording.notes,
            _unit_evidence(recording, look, said),
            _up_evidence(recording, look, said),
            positions_evidence,
            first_evidence,
            f"facing: cosine of toes and front {cosine:.2f} (0.95 when map and sides are right)",
        ),
        warnings=tuple(warnings),
    )


@dataclass(frozen=True, slots=True)
class _Look:
    """One way to read position channels, and what the body looks like then."""

    poses: FloatArray  # (T, 24, 3) in file units and axes
    unit: float
    up: Up
    leg: float  # metres
    head: float  # metres above the ankles, along `up`
    floor: float  # metres, 5th percentile of the lowest foot


def _candidates(recording: Recording, said: Overrides) -> tuple[RootPositions, ...]:
    """Return the readings of position channels that differ for this file."""
    if said.root_positions is not None:
        return (said.root_positions,)
    if _is_acclaim(recording):
        return ("add",)
    moved = recording.channel_nodes[recording.channel_kinds < 3]
    if not np.any(recording.skeleton.offsets[moved]):
        return ("add",)
    return ("add", "replace")


def _look(
    recording: Recording,
    mapping: Mapping24,
    positions: RootPositions,
    frames: IndexArray,
    said: Overrides,
) -> _Look:
    poses = canonical_positions(recording, mapping, positions, frames)
    leg = leg_length(poses)
    unit = said.unit or recording.unit or nearest_unit(leg)
    up = said.up or recording.up or ("y" if _is_acclaim(recording) else up_axis(poses))
    heights = (poses * unit) @ upright(up)[1]
    ankles = heights[:, [INDEX["lankle"], INDEX["rankle"]]]
    feet = heights[:, [INDEX[j] for j in ("lankle", "rankle", "ltoes", "rtoes")]]
    return _Look(
        poses=poses,
        unit=unit,
        up=up,
        leg=leg * unit,
        head=float(median(heights[:, INDEX["head"]] - ankles.mean(axis=1))),
        floor=float(quantile(np.nanmin(feet, axis=1), 0.05)),
    )


def _choose_positions(
    recording: Recording, looks: Mapping[RootPositions, _Look], said: Overrides
) -> tuple[RootPositions, str]:
    """Choose the reading with human legs, and among those the one with its feet on the floor."""

    def oddness(positions: RootPositions) -> tuple[bool, float]:
        look = looks[positions]
        return not SHORTEST_LEG <= look.leg <= LONGEST_LEG, abs(look.floor)

    best = min(looks, key=oddness)
    if said.root_positions is not None:
        reason = "as told"
    elif _is_acclaim(recording):
        reason = "as the format says"
    elif len(looks) == 1:
        reason = "both are the same here, the OFFSETs are 0"
    else:
        reason = ", ".join(
            f"{name}: lowest foot at {look.floor:.2f} m, legs of {look.leg:.2f} m"
            for name, look in looks.items()
        )
    return best, f"root positions: {best} ({reason})"


def _first_frame(recording: Recording, mapping: Mapping24, said: Overrides) -> tuple[bool, str]:
    """Tell whether frame 0 is a pose to drop, and why."""
    if said.keep_first_frame is not None or len(recording.values) < 2:
        drop = said.keep_first_frame is False and len(recording.values) > 1
        return drop, f"first frame: {'dropped' if drop else 'motion'} (as told)"
    turns = recording.values[:2, recording.channel_kinds >= 3]
    if turns.size and not turns[0].any() and turns[1].any():
        return True, "first frame: dropped T-pose (all its rotations are 0)"
    step = np.abs(np.remainder(turns[1] - turns[0] + np.pi, 2 * np.pi) - np.pi)
    if np.max(step, initial=0.0) < SMALL_TURN:
        return False, "first frame: motion (nothing turns by more than 10 degrees to frame 1)"
    poses = canonical_positions(recording, mapping, "add", slice(0, SAMPLES))
    unit = said.unit or recording.unit or nearest_unit(leg_length(poses))
    poses = (poses - poses[:, :1]) * unit
    steps = np.nanmean(np.linalg.norm(np.diff(poses, axis=0), axis=2), axis=1)
    later = float(np.max(steps[1:], initial=0.0))
    evidence = f"joints move {steps[0]:.3f} m to frame 1, then at most {later:.3f} m a frame"
    if len(steps) > 1 and steps[0] > max(JUMP, JUMP_RATIO * later) and _is_t_pose(poses[0]):
        return True, f"first frame: dropped T-pose ({evidence})"
    return False, f"first frame: motion ({evidence})"


def _is_t_pose(pose: FloatArray) -> bool:
    """Whether the arms are stretched out to both sides."""

    def arm(side: str) -> FloatArray:
        vector = pose[INDEX[f"{side}wrist"]] - pose[INDEX[f"{side}shoulder"]]
        return unit_vectors(vector)

    return bool(arm("l") @ arm("r") < -0.9)


def _is_acclaim(recording: Recording) -> bool:
    return recording.skeleton.turned_by == "own"


def _spread(begin: int, end: int) -> IndexArray:
    """Return at most `SAMPLES` frames, evenly spread over a take."""
    return np.linspace(begin, end - 1, min(SAMPLES, end - begin)).astype(np.int64)


def _unit_evidence(recording: Recording, look: _Look, said: Overrides) -> str:
    reason = "guessed by the length of the legs, adults have 0.70 to 1.00 m"
    if said.unit is not None:
        reason = "as told"
    elif recording.unit is not None:
        reason = "as the file says"
    return f"unit: {look.unit:.6g} m, which makes legs of {look.leg:.2f} m ({reason})"


def _up_evidence(recording: Recording, look: _Look, said: Overrides) -> str:
    reason = "guessed"
    if said.up is not None:
        reason = "as told"
    elif recording.up is not None or _is_acclaim(recording):
        reason = "as the format says"
    return f"up: {look.up}, the head is {look.head:.2f} m above the ankles ({reason})"
