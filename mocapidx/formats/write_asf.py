"""ASF text of a skeleton of bones, each free to turn about all axes."""

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.formats.decimals import decimal
from mocapidx.model import Skeleton
from mocapidx.units import INCH

__all__ = ["asf_text"]

HEAD = """\
:version 1.10
:name {name}
:units
  mass 1.0
  length {length}
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
"""


def asf_text(skeleton: Skeleton, unit: float, name: str) -> bytes:
    """Write a skeleton as ASF.

    Parameters
    ----------
    skeleton : Skeleton
        Of bones (``turned_by`` is "own"), without frames of their own. The root's offset is not
        written: it is where an AMC says.
    unit : float
        Metres in one unit of the skeleton.
    name : str
        What the file is to call it; one word.

    Returns
    -------
    bytes
        The text. The rows of its AMC have three angles for each bone, about x first, then y
        and z.

    Raises
    ------
    ParameterError
        If the skeleton is one of joints, or its numbers are not finite.
    """
    if skeleton.turned_by != "own" or skeleton.axes is not None:
        raise ParameterError("an ASF has bones, not the joints of a BVH")
    if not np.isfinite(skeleton.offsets).all():
        raise ParameterError("an ASF can't hold NaN or infinity")
    lines = [HEAD.format(name=name, length=decimal(INCH / unit))]
    for node, bone in enumerate(skeleton.names[1:], start=1):
        length = float(np.linalg.norm(skeleton.offsets[node]))
        direction = skeleton.offsets[node] / length if length else np.array([0.0, 1.0, 0.0])
        lines.append(
            f"  begin\n    id {node}\n    name {bone}\n"
            f"    direction {' '.join(map(decimal, direction.tolist()))}\n"
            f"    length {decimal(length)}\n    axis 0 0 0 XYZ\n    dof rx ry rz\n"
            "    limits (-360 360)\n           (-360 360)\n           (-360 360)\n  end\n"
        )
    lines.append(":hierarchy\n  begin\n")
    for node, bone in enumerate(skeleton.names):
        children = [skeleton.names[n] for n in np.flatnonzero(skeleton.parents == node).tolist()]
        if children:
            lines.append(f"    {' '.join([bone, *children])}\n")
    lines.append("  end\n")
    return "".join(lines).encode("utf-8", "surrogateescape")
