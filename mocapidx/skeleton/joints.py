"""The 24 canonical joints that everything above the files speaks of."""

from typing import Final

import numpy as np

from mocapidx.model import IndexArray

__all__ = ["CANONICAL_JOINTS", "INDEX", "MIRROR", "PARENTS"]

_PARENT_OF: Final = {
    "root": "",
    "lhip": "root", "lknee": "lhip", "lankle": "lknee", "ltoes": "lankle",
    "rhip": "root", "rknee": "rhip", "rankle": "rknee", "rtoes": "rankle",
    "belly": "root", "chest": "belly", "neck": "chest", "head": "neck", "headtop": "head",
    "lclavicle": "neck", "lshoulder": "lclavicle", "lelbow": "lshoulder",
    "lwrist": "lelbow", "lfingers": "lwrist",
    "rclavicle": "neck", "rshoulder": "rclavicle", "relbow": "rshoulder",
    "rwrist": "relbow", "rfingers": "rwrist",
}  # fmt: skip

CANONICAL_JOINTS: Final[tuple[str, ...]] = tuple(_PARENT_OF)
INDEX: Final = {name: i for i, name in enumerate(CANONICAL_JOINTS)}
PARENTS: Final[IndexArray] = np.array(
    [INDEX.get(parent, -1) for parent in _PARENT_OF.values()], dtype=np.int64
)


def _other_side(name: str) -> str:
    mirrored = {"l": "r", "r": "l"}.get(name[0], "") + name[1:]
    return mirrored if mirrored in INDEX else name


MIRROR: Final[IndexArray] = np.array(
    [INDEX[_other_side(name)] for name in CANONICAL_JOINTS], dtype=np.int64
)
"""A permutation of the 24 that exchanges left and right."""
