"""What others do, written plainly: the peers that our figures are ratios against."""

import contextlib
import io
import os
from collections.abc import Callable
from pathlib import Path

import bvhio
import numpy as np
from scipy.spatial.transform import Rotation

__all__ = [
    "kinematics_with_rotation",
    "matchers",
    "parse_amc_line_by_line",
    "parse_bvh_line_by_line",
    "read_with_bvhio",
]

STEPS = np.array([[1, 1], [2, 1], [1, 2]])


def parse_amc_line_by_line(path: Path) -> list[dict[str, list[float]]]:
    """Read an AMC as most public parsers do: split each line, convert each number."""
    frames: list[dict[str, list[float]]] = []
    for line in path.read_text(encoding="latin-1").splitlines():
        words = line.split()
        if not words or words[0][0] in ":#":
            continue
        if words[0].isdigit():
            frames.append({})
        else:
            frames[-1][words[0]] = [float(word) for word in words[1:]]
    return frames


def parse_bvh_line_by_line(path: Path) -> list[list[float]]:
    """Read the frames of a BVH as most public parsers do, the hierarchy left out."""
    lines = iter(path.read_text(encoding="latin-1").splitlines())
    for line in lines:
        if line.strip().startswith("Frame Time"):
            break
    return [[float(word) for word in line.split()] for line in lines if line.strip()]


def read_with_bvhio(path: Path) -> object:
    """Read the channels of a BVH with bvhio, which prints as it goes."""
    with contextlib.redirect_stdout(io.StringIO()):
        return bvhio.readAsBvh(str(path))


def kinematics_with_rotation(
    parents: np.ndarray, offsets: np.ndarray, orders: list[str], angles: list[np.ndarray]
) -> np.ndarray:
    """Forward kinematics joint by joint with scipy's Rotation; angles (T, axes) in radians."""
    frames = len(angles[0])
    turned: list[Rotation] = []
    places = np.zeros((len(parents), frames, 3))
    for joint, parent in enumerate(parents):
        own = Rotation.from_euler(orders[joint], angles[joint])
        if parent < 0:
            turned.append(own)
            continue
        turned.append(turned[parent] * own)
        places[joint] = places[parent] + turned[parent].apply(offsets[joint])
    return places


def matchers(
    costs: Callable[[], np.ndarray], rows: int, frames: int
) -> dict[str, Callable[[], object]]:
    """Give libfmp's and librosa's subsequence DTW of the same steps, costs made for each call.

    And stumpy's distance profile of a series as long, for context.

    Numba compiles them at their first call, which is not to be counted.
    """
    os.environ.setdefault("MPLBACKEND", "agg")
    import librosa
    from libfmp.c7 import compute_accumulated_cost_matrix_subsequence_dtw_21

    def with_librosa() -> object:
        return librosa.sequence.dtw(
            C=costs(),
            step_sizes_sigma=STEPS,
            weights_mul=np.array([1.0, 2.0, 1.0]),
            weights_add=np.zeros(3),
            subseq=True,
            backtrack=False,
        )

    import stumpy

    series = np.random.default_rng(1).random(frames)

    return {
        "libfmp": lambda: compute_accumulated_cost_matrix_subsequence_dtw_21(costs()),
        "librosa": with_librosa,
        # No warping, and one number a frame: something else, for context.
        "stumpy": lambda: stumpy.mass(series[:rows], series),
    }
