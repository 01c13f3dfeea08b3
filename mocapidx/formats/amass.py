"""AMASS: body model poses as npz, turned into a skeleton of joints and channels.

The files hold angles and a shape, no joints: these follow from a body model that can't be
shipped. Where none is given, a template body of usual proportions stands in for it, which is as
good for relations between joints, but for small differences of build.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import FormatError
from mocapidx.formats.arrays import as_numbers
from mocapidx.formats.body_model import body_joints
from mocapidx.formats.positions import stated_rate
from mocapidx.formats.text import Limits, place
from mocapidx.model import FloatArray, Recording, Skeleton
from mocapidx.printable import shown

__all__ = ["AMASS_KEYS", "amass_recording"]

AMASS_KEYS: Final = ("poses", "trans", "betas")
LARGEST_SHAPE: Final = 100.0  # people lie within 5 or so
LARGEST_ANGLE: Final = 1e6  # radians
WIDTHS: Final = {66: "SMPL body", 72: "SMPL", 156: "SMPL-H", 165: "SMPL-X"}
TEMPLATE: Final = (
    # name, parent, offset in metres: a person of 1.73 m with arms stretched out, left is +x
    ("pelvis", -1, (0, 0, 0)),
    ("left_hip", 0, (0.07, -0.09, 0)), ("right_hip", 0, (-0.07, -0.09, 0)),
    ("spine1", 0, (0, 0.12, -0.02)),
    ("left_knee", 1, (0.03, -0.4, 0)), ("right_knee", 2, (-0.03, -0.4, 0)),
    ("spine2", 3, (0, 0.13, 0)),
    ("left_ankle", 4, (0, -0.41, -0.03)), ("right_ankle", 5, (0, -0.41, -0.03)),
    ("spine3", 6, (0, 0.06, 0.01)),
    ("left_foot", 7, (0.03, -0.06, 0.13)), ("right_foot", 8, (-0.03, -0.06, 0.13)),
    ("neck", 9, (0, 0.21, -0.03)),
    ("left_collar", 9, (0.08, 0.12, -0.02)), ("right_collar", 9, (-0.08, 0.12, -0.02)),
    ("head", 12, (0, 0.09, 0.04)),
    ("left_shoulder", 13, (0.1, 0.04, -0.01)), ("right_shoulder", 14, (-0.1, 0.04, -0.01)),
    ("left_elbow", 16, (0.26, -0.01, -0.02)), ("right_elbow", 17, (-0.26, -0.01, -0.02)),
    ("left_wrist", 18, (0.25, 0.01, 0)), ("right_wrist", 19, (-0.25, 0.01, 0)),
    ("left_middle1", 20, (0.1, 0, 0)), ("right_middle1", 21, (-0.1, 0, 0)),
)  # fmt: skip
TURNING: Final = 22  # nodes that turn: all but the fingers
NOTE: Final = (
    "body: a template of usual proportions, for the file has angles and no joints; "
    "differences of build are lost"
)


def amass_recording(
    path: Path, arrays: dict[str, NDArray[Any]], limits: Limits, model: Path | None = None
) -> Recording:
    """Understand the arrays of an npz file as AMASS motion.

    Parameters
    ----------
    path : Path
        The file, for messages.
    arrays : dict of str to ndarray
        `poses` (T, 156) of SMPL-H or (T, 165) of SMPL-X, axis and angle in radians; `trans`
        (T, 3) in metres; `mocap_framerate` or `mocap_frame_rate`.
    limits : Limits
        What is refused as too large.
    model : Path, optional
        A body model as npz; by default a template body moves. `betas` is the shape.

    Returns
    -------
    Recording
        The first 22 joints and a finger of each hand; Z up.

    Raises
    ------
    FormatError
        If an array is missing or of another shape; the message names it.
    """
    where = place(path)
    for key in AMASS_KEYS[:2]:
        if key not in arrays:
            raise FormatError(f"{where}: has no '{key}': not a motion of AMASS")
    poses = as_numbers(arrays["poses"], f"{where}: 'poses'", (None, None))
    if poses.shape[1] not in WIDTHS:
        known = ", ".join(f"{width} ({name})" for width, name in WIDTHS.items())
        raise FormatError(
            f"{where}: 'poses' has {poses.shape[1]} numbers a frame, expected {known}"
        )
    trans = as_numbers(arrays["trans"], f"{where}: 'trans'", (len(poses), 3))
    limits.check_frames(len(poses), path)
    if not len(poses):
        raise FormatError(f"{where}: has no frames; there is no motion in the file")
    rate = stated_rate(where, arrays)
    vectors = poses[:, : 3 * TURNING].reshape(len(poses), TURNING, 3)
    if not (np.isfinite(vectors).all() and np.isfinite(trans).all()):
        raise FormatError(f"{where}: holds numbers that are not finite; is it damaged?")
    if (np.abs(vectors) > LARGEST_ANGLE).any():
        raise FormatError(f"{where}: 'poses' hold what is no angle in radians; is it damaged?")
    names, parents, places = zip(*TEMPLATE, strict=True)
    offsets = np.array(places, dtype=np.float64)
    nodes = np.concatenate(([0, 0, 0], np.repeat(np.arange(TURNING), 3)))
    kinds = np.concatenate(([0, 1, 2], np.tile([5, 4, 3], TURNING)))
    angles = _euler_angles(vectors).reshape(len(poses), -1)
    notes: tuple[str, ...] = (NOTE,)
    if model is not None:
        joints = body_joints(model, _shape(where, arrays), limits)
        offsets = joints - joints[np.maximum(parents, 0)]
        offsets[0] = 0.0
        trans = trans + joints[0]
        notes = (f"body: of the model {shown(model.name)} at the shape of the file",)
    return Recording(
        skeleton=Skeleton(
            names=names,
            parents=np.array(parents, dtype=np.int64),
            offsets=offsets,
            turned_by="parent",
        ),
        channel_nodes=nodes.astype(np.int64),
        channel_kinds=kinds.astype(np.int64),
        values=np.concatenate((trans, angles), axis=1),
        rate=rate,
        unit=1.0,
        up="z",
        notes=notes,
    )


def _shape(where: str, arrays: dict[str, NDArray[Any]]) -> FloatArray:
    if "betas" not in arrays:
        return np.zeros(0)
    betas = as_numbers(arrays["betas"].reshape(-1), f"{where}: 'betas'", (None,))
    if not (np.abs(betas) < LARGEST_SHAPE).all():
        raise FormatError(f"{where}: 'betas' are no shape of a body; is it damaged?")
    return betas


def _euler_angles(vectors: FloatArray) -> FloatArray:
    """Turn axes times angles (..., 3) into angles about z, y and x: Rz Ry Rx is the rotation."""
    angle = np.linalg.norm(vectors, axis=-1)
    x, y, z = np.moveaxis(vectors / np.where(angle > 0, angle, 1.0)[..., None], -1, 0)
    c, s = np.cos(angle), np.sin(angle)
    v = 1 - c
    about_y = np.arcsin(np.clip(y * s - x * z * v, -1, 1))
    about_z = np.arctan2(x * y * v + z * s, c + x * x * v)
    about_x = np.arctan2(y * z * v + x * s, c + z * z * v)
    return np.stack((about_z, about_y, about_x), axis=-1)
