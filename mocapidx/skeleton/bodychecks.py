"""What a body must be like: human legs, a head above the feet, toes in front.

All take poses of the 24 canonical joints; joints that are NaN are passed over.
"""

from typing import Final

import numpy as np

from mocapidx.model import BoolArray, FloatArray, Up
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from mocapidx.skeleton.quantiles import median, quantile
from mocapidx.units import LENGTHS

__all__ = [
    "LONGEST_LEG",
    "LOWER",
    "SHORTEST_LEG",
    "UPPER",
    "coincident_joints",
    "facing",
    "leg_length",
    "limb_length",
    "middle",
    "nearest_unit",
    "unit_vectors",
    "up_axis",
]

SHORTEST_LEG, LONGEST_LEG = 0.70, 1.00  # hip to knee to ankle of adults, metres
STEEP: Final = 0.95  # cosine between a standing shank and the vertical
ON_ONE_POINT: Final = 1e-4  # metres
UPPER: Final = (("head",), ("neck",), ("lshoulder", "rshoulder"), ("chest",), ("root",))
LOWER: Final = (("lankle", "rankle"), ("lknee", "rknee"), ("lhip", "rhip"), ("root",))
ARM_AS_LEG: Final = 1.6  # legs, hip to knee to ankle, are that much longer than shoulder to wrist


def leg_length(poses: FloatArray) -> float:
    """Return the length of the legs, hip to knee to ankle, as a median over frames.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        In any unit.

    Returns
    -------
    float
        In that unit; of one leg where the other is not known, NaN where none is.
    """
    return _limb(poses, ("hip", "knee", "ankle"))


def limb_length(poses: FloatArray) -> float:
    """Return the length of the legs, or what the arms let expect of them.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        In any unit.

    Returns
    -------
    float
        In that unit; NaN where neither legs nor arms are known.
    """
    leg = leg_length(poses)
    return leg if np.isfinite(leg) else ARM_AS_LEG * _limb(poses, ("shoulder", "elbow", "wrist"))


def nearest_unit(leg: float) -> float:
    """Return the unit that makes a leg most like an adult's.

    Where none does, shorter ones may be a child's; longer ones are nobody's.

    Parameters
    ----------
    leg : float
        Hip to knee to ankle, in file units.

    Returns
    -------
    float
        Metres in one file unit.
    """
    if not leg > 0:
        return 1.0

    def oddness(unit: float) -> float:
        shorter, longer = SHORTEST_LEG / (leg * unit), leg * unit / LONGEST_LEG
        return max(0.0, float(np.log(shorter)), 3 * float(np.log(longer)))

    return min(LENGTHS.values(), key=oddness)


def up_axis(poses: FloatArray) -> Up:
    """Return the axis along which the head is farthest from the ankles.

    A person who lies or tumbles most of the take must not turn the world over: Y stays up where
    the head is about as high above the ankles along Y in a tenth of the take as along any axis.
    Where head or ankles are missing, what is next to them counts.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        In any unit.

    Returns
    -------
    {"x", "y", "z", "-x", "-y", "-z"}
    """
    heads = middle(poses, UPPER) - middle(poses, LOWER)
    heads = heads[np.isfinite(heads).all(axis=1)]
    if not len(heads):
        return "y"
    reach = quantile(np.concatenate((heads, -heads), axis=1), 0.9)
    if reach[1] >= 0.8 * reach.max():
        return "y"
    usual = median(heads)
    axis = int(np.argmax(median(np.abs(heads))))
    names: tuple[tuple[Up, Up], ...] = (("x", "-x"), ("y", "-y"), ("z", "-z"))
    return names[axis][int(usual[axis] < 0)]


def middle(poses: FloatArray, groups: tuple[tuple[str, ...], ...]) -> FloatArray:
    """Return the middle of the first group of joints of which some are there at all.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        In any unit.
    groups : tuple of tuple of str
        Canonical joints, the best group first.

    Returns
    -------
    ndarray of float, shape (T, 3)
        NaN where the joints are.
    """
    for group in groups:
        rows = [INDEX[joint] for joint in group]
        rows = [row for row in rows if np.isfinite(poses[:, row]).all(axis=1).any()]
        if rows:
            point: FloatArray = poses[:, rows].mean(axis=1)
            return point
    return np.full((len(poses), 3), np.nan)


def facing(poses: FloatArray) -> float:
    """Return the median cosine between where the hips face and where the toes point.

    Only feet under a steep shank count: those of a runner's back leg point anywhere.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        Upright, in any unit.

    Returns
    -------
    float
        NaN where there are no toes.
    """
    across = poses[:, INDEX["lhip"]] - poses[:, INDEX["rhip"]]
    front = unit_vectors(np.cross(across, (0.0, 1.0, 0.0))[:, [0, 2]])
    cosines, steepness = [], []
    for side in "lr":
        knee, ankle, toes = (poses[:, INDEX[f"{side}{j}"]] for j in ("knee", "ankle", "toes"))
        foot = unit_vectors((toes - ankle)[:, [0, 2]])
        cosines.append(np.sum(front * foot, axis=1))
        steepness.append(unit_vectors(knee - ankle)[:, 1])
    cosine, steep = np.concatenate(cosines), np.concatenate(steepness)
    known = np.isfinite(cosine) & np.isfinite(steep)
    if not known.any():
        return np.nan
    cosine, steep = cosine[known], steep[known]
    return float(median(cosine[steep >= min(STEEP, quantile(steep, 0.75))]))


def coincident_joints(poses: FloatArray) -> tuple[tuple[str, str], ...]:
    """Return the pairs of joints that are never apart.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        In metres.

    Returns
    -------
    tuple of (str, str)
        Joints that are both known in no frame are no pair.
    """
    whole = poses[np.argmax(np.isfinite(poses).all(axis=2).sum(axis=1))]
    near = np.abs(whole[:, None] - whole).max(axis=2) < ON_ONE_POINT  # NaN is near nothing
    return tuple(
        (CANONICAL_JOINTS[a], CANONICAL_JOINTS[b])
        for a, b in np.argwhere(np.triu(near, k=1))
        if not (np.abs(poses[:, a] - poses[:, b]) >= ON_ONE_POINT).any()
    )


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """Return vectors at length 1; what has no length stays.

    Parameters
    ----------
    vectors : ndarray of float, shape (..., D)

    Returns
    -------
    ndarray of float, shape (..., D)
    """
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0, lengths, 1.0)


def _limb(poses: FloatArray, chain: tuple[str, str, str]) -> float:
    lengths = []
    for side in "lr":
        first, second, third = (poses[:, INDEX[side + joint]] for joint in chain)
        lengths.append(
            np.linalg.norm(first - second, axis=1) + np.linalg.norm(second - third, axis=1)
        )
    both = np.array(lengths)
    known: BoolArray = np.isfinite(both)
    if known.all(axis=0).any():
        both = both[:, known.all(axis=0)]
    else:
        sides = known.any(axis=1)
        if not sides.any():
            return np.nan
        both = both[int(np.argmax(sides))][None]
        both = both[:, np.isfinite(both[0])]
    return float(median(both.mean(axis=0)))
