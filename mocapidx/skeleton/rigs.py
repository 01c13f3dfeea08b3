"""The bones of an ASF as the joints of a BVH: one hierarchy, the same motion.

A bone is known by its far end and turns in a frame of its own; a joint is known by where it is
and turns what hangs on it. The joint of a bone lies where the bone begins.
"""

from dataclasses import replace

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import FloatArray, IndexArray, Recording, Skeleton
from mocapidx.skeleton.angles import channel_angles
from mocapidx.skeleton.rotations import multiplied, turned

__all__ = ["as_joints"]

ORDER = (2, 1, 0)  # z, y, x: what most programs write and read


def as_joints(recording: Recording) -> Recording:
    """Turn a recording of bones into one of joints.

    Parameters
    ----------
    recording : Recording
        Of an AMC; one of a BVH comes back as it is.

    Returns
    -------
    Recording
        The joint ``X`` lies where the bone ``X`` begins; the end of a bone without children is
        the node ``X/End``. Rotations that are given in a bone's own frame become turns about
        z, y and x in that of the joint above; others keep their channels.

    Raises
    ------
    ParameterError
        If a bone other than the root changes its length.
    """
    skeleton = recording.skeleton
    if skeleton.turned_by == "parent":
        return recording
    if ((recording.channel_kinds < 3) & (recording.channel_nodes != 0)).any():
        raise ParameterError("bones that change their length can't be joints of a BVH")
    nodes, kinds, columns = [], [], []
    for node in range(len(skeleton.names)):
        own = np.flatnonzero(recording.channel_nodes == node)
        if not len(own):
            continue
        frame = np.eye(3) if skeleton.axes is None else skeleton.axes[node]
        moves = own[recording.channel_kinds[own] < 3]
        turns = own[recording.channel_kinds[own] >= 3]
        values = recording.values[:, turns].T
        turn_kinds = recording.channel_kinds[turns]
        if len(turns) and not np.array_equal(frame, np.eye(3)):
            values = channel_angles(_unframed(values, turn_kinds, frame), ORDER)
            turn_kinds = np.array(ORDER) + 3
        kinds += [*recording.channel_kinds[moves].tolist(), *turn_kinds.tolist()]
        nodes += [node] * (len(moves) + len(turn_kinds))
        columns += [*recording.values[:, moves].T, *values]
    return replace(
        recording,
        skeleton=_joints(skeleton),
        channel_nodes=np.array(nodes, np.int64),
        channel_kinds=np.array(kinds, np.int64),
        values=np.stack(columns, axis=1),
    )


def _unframed(values: FloatArray, kinds: IndexArray, frame: FloatArray) -> FloatArray:
    """Return the rotations of a bone outside its own frame, C M C', shape (3, 3, T)."""
    product = np.repeat(frame[:, :, None], values.shape[1], axis=2)
    for kind, angles in zip(kinds.tolist(), values, strict=True):
        product = turned(product, kind - 3, np.cos(angles), np.sin(angles))
    return multiplied(product, frame.T)


def _joints(skeleton: Skeleton) -> Skeleton:
    parents = skeleton.parents
    # bones on the root begin where it is, others where the bone above ends
    offsets = np.where((parents > 0)[:, None], skeleton.offsets[parents], 0.0)
    offsets[0] = skeleton.offsets[0]
    leaves = [n for n in range(1, len(parents)) if not (parents == n).any()]
    return Skeleton(
        names=(*skeleton.names, *(f"{skeleton.names[n]}/End" for n in leaves)),
        parents=np.concatenate((parents, np.array(leaves, np.int64))),
        offsets=np.concatenate((offsets, skeleton.offsets[leaves])),
        turned_by="parent",
    )
