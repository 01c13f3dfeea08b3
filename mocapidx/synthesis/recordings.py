"""Movement as a recording: rotations as the channels of a motion file."""

from dataclasses import replace
from typing import Final

import numpy as np

from mocapidx.model import Recording
from mocapidx.skeleton.angles import channel_angles
from mocapidx.synthesis.bodies import Body, Movement
from mocapidx.synthesis.quaternions import to_matrices

__all__ = ["recording_of"]

ORDER: Final = (2, 1, 0)  # z, y, x: what most programs write and read


def recording_of(body: Body, movement: Movement, unit: float) -> Recording:
    """Lay out movement as channels.

    Parameters
    ----------
    body : Body
    movement : Movement
        Of this body.
    unit : float
        Metres in one unit of the file.

    Returns
    -------
    Recording
        The root has three translations; all nodes but End Sites turn about z, y and x, each
        angle without jumps by whole turns.
    """
    skeleton = body.skeleton
    nodes, kinds = [0, 0, 0], [0, 1, 2]
    columns = list((movement.places / unit).T)
    matrices = np.moveaxis(to_matrices(movement.turns), 0, 3)
    for node in range(len(skeleton.names)):
        leaf = not (skeleton.parents == node).any()
        if leaf and node and skeleton.turned_by == "parent":  # turns nothing
            continue
        nodes += [node] * 3
        kinds += [axis + 3 for axis in ORDER]
        columns += list(channel_angles(matrices[node], ORDER))
    return Recording(
        replace(skeleton, offsets=skeleton.offsets / unit),
        np.array(nodes, dtype=np.int64),
        np.array(kinds, dtype=np.int64),
        np.stack(columns, axis=1),
        movement.rate,
        unit,
    )
