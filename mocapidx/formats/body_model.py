"""The rest joints of a SMPL body model, which its users have a licence for, at a shape."""

import os
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.arrays import as_numbers, read_arrays
from mocapidx.formats.text import Limits, place
from mocapidx.model import FloatArray

__all__ = ["body_joints"]

KEYS: Final = ("J_regressor", "v_template", "shapedirs")
FINGERS: Final = {24: (22, 23), 52: (25, 40), 55: (28, 43)}  # by the joints of the model
BODY: Final = 22  # joints that all of these models begin with


def body_joints(path: Path, betas: FloatArray, limits: Limits) -> FloatArray:
    """Return the joints of a body model with all angles 0.

    Parameters
    ----------
    path : Path
        The model as npz, with `J_regressor` (J, V), `v_template` (V, 3) and `shapedirs`
        (V, 3, B).
    betas : ndarray of float, shape (N,)
        The shape; what the model does not know of is passed over.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    ndarray of float64, shape (24, 3)
        In metres: the 22 joints of the body, and the middle finger of each hand.

    Raises
    ------
    FormatError
        If the file is no such model.

    References
    ----------
    .. [1] M. Loper, N. Mahmood, J. Romero, G. Pons-Moll, M. J. Black, SMPL: A skinned
       multi-person linear model, SIGGRAPH Asia 2015, equation 10.
    """
    try:
        status = os.stat(path)
    except OSError as exc:
        raise FormatError(f"{place(path)}: can't be read: {exc.strerror}") from exc
    joints, by_shape = _linear(path, limits, (status.st_size, status.st_mtime_ns))
    count = min(len(betas), by_shape.shape[2])
    found: FloatArray = joints + by_shape[:, :, :count] @ betas[:count]
    return found


@lru_cache(maxsize=4)
def _linear(path: Path, limits: Limits, _: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return the joints of the mean shape, and what each number of a shape does to them."""
    where = place(path)
    arrays = read_arrays(path, limits, set(KEYS))
    missing = [key for key in KEYS if key not in arrays]
    if missing:
        raise FormatError(f"{where}: no body model: it has no '{missing[0]}'")
    regressor = as_numbers(arrays["J_regressor"], f"{where}: 'J_regressor'", (None, None))
    vertices = regressor.shape[1]
    template = as_numbers(arrays["v_template"], f"{where}: 'v_template'", (vertices, 3))
    shapes = as_numbers(arrays["shapedirs"], f"{where}: 'shapedirs'", (vertices, 3, None))
    fingers = FINGERS.get(len(regressor))
    if fingers is None:
        raise FormatError(f"{where}: has {len(regressor)} joints, expected 24, 52 or 55 of SMPL")
    rows = regressor[[*range(BODY), *fingers]]
    joints, by_shape = rows @ template, np.einsum("jv,vcs->jcs", rows, shapes)
    if not (np.isfinite(joints).all() and np.isfinite(by_shape).all()):
        raise FormatError(f"{where}: holds numbers that are not finite; is it damaged?")
    return joints, by_shape
