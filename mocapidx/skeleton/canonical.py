"""From the nodes of a rig to the 24 canonical joints; joints that a rig lacks are made up.

A made joint fills a gap for those who look at poses. It is flagged, and no feature that uses
it is trusted.
"""

from typing import Final

import numpy as np

from mocapidx.model import FloatArray, IndexArray, Recording
from mocapidx.skeleton.jointmap import Between, Mapping24
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.skeleton.kinematics import RootPositions, node_positions, zero_pose
from mocapidx.skeleton.quantiles import median

__all__ = ["canonical_positions", "canonical_rest", "completed_positions", "made_joints"]

# Segment lengths as parts of the body's height: Winter, Biomechanics and Motor Control of Human
# Movement, 4th ed., 2009, figure 4.1 (after Drillis and Contini 1966).
THIGH_AND_SHANK: Final = 0.245 + 0.246
HEAD_TO_TOP: Final = 0.06  # of the height; Acclaim skeletons have 10 cm there
HAND: Final = 0.35  # of the forearm; Acclaim skeletons have 0.24 to 0.51

RULES: Final = {
    "root": Between("lhip", "rhip", 0.5),
    "neck": Between("lshoulder", "rshoulder", 0.5),
    "belly": Between("root", "neck", 1 / 3),
    "chest": Between("root", "neck", 2 / 3),
    "lfingers": Between("lelbow", "lwrist", 1 + HAND),
    "rfingers": Between("relbow", "rwrist", 1 + HAND),
}


def made_joints(mapping: Mapping24) -> dict[str, Between | None]:
    """Return the joints that a rig lacks and that can be made up.

    Parameters
    ----------
    mapping : Mapping24
        Which node is which joint.

    Returns
    -------
    dict of str to Between or None
        In an order in which they can be made; None: beyond the head, by the body's height.
        Toes are never made.
    """
    there = {j for j, node in zip(CANONICAL_JOINTS, mapping.nodes, strict=True) if node >= 0}
    made: dict[str, Between | None] = {}
    for joint, rule in (RULES | dict(mapping.joint_map.made)).items():
        if joint not in there and {rule.first, rule.last} <= there | made.keys():
            made[joint] = rule
    if "headtop" not in there and {"neck", "head"} <= there | made.keys():
        made["headtop"] = None
    return made


def canonical_positions(
    recording: Recording,
    mapping: Mapping24,
    positions: RootPositions = "add",
    frames: slice | IndexArray = slice(None),
) -> FloatArray:
    """Compute the canonical joints, in the units and axes of the file.

    Parameters
    ----------
    recording : Recording
        The skeleton and its channels.
    mapping : Mapping24
        Which node is which joint.
    positions : {"add", "replace"}
        Whether position channels add to a node's offset or replace it.
    frames : slice or ndarray of int
        The frames wanted, T of them; by default all.

    Returns
    -------
    ndarray of float64, shape (T, 24, 3)
        In file units; NaN for joints that the rig lacks and that can't be made.
    """
    return completed_positions(node_positions(recording, mapping.nodes, positions, frames), mapping)


def canonical_rest(recording: Recording, mapping: Mapping24) -> FloatArray:
    """Compute the canonical joints of the zero pose, in the units and axes of the file.

    Parameters
    ----------
    recording : Recording
        The skeleton; its channels are not looked at.
    mapping : Mapping24
        Which node is which joint.

    Returns
    -------
    ndarray of float64, shape (24, 3)
        In file units, the root at the origin.
    """
    points = zero_pose(recording.skeleton)
    there = np.array(mapping.nodes)
    pose = np.where(there[:, None] >= 0, points[there], np.nan)
    completed: FloatArray = completed_positions(pose[None], mapping)[0]
    return completed


def completed_positions(positions: FloatArray, mapping: Mapping24) -> FloatArray:
    """Make up, in place, the joints that a rig lacks and that can be made.

    Parameters
    ----------
    positions : ndarray of float, shape (T, 24, 3)
        The canonical joints that the rig has; in any unit.
    mapping : Mapping24
        Which node is which joint.

    Returns
    -------
    ndarray of float, shape (T, 24, 3)
        The same array.
    """
    for joint, rule in made_joints(mapping).items():
        if rule is None:
            positions[:, INDEX[joint]] = _top_of_head(positions)
        else:
            first, last = positions[:, INDEX[rule.first]], positions[:, INDEX[rule.last]]
            positions[:, INDEX[joint]] = first + rule.at * (last - first)
    return positions


def _top_of_head(positions: FloatArray) -> FloatArray:
    hip, knee, ankle, neck, head = (
        positions[:, INDEX[j]] for j in ("lhip", "lknee", "lankle", "neck", "head")
    )
    leg = np.linalg.norm(hip - knee, axis=1) + np.linalg.norm(knee - ankle, axis=1)
    known = leg[np.isfinite(leg)]
    height = median(known) / THIGH_AND_SHANK if len(known) else np.nan
    upwards = head - neck
    length = np.linalg.norm(upwards, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        top: FloatArray = head + HEAD_TO_TOP * height * upwards / length
    return top
