"""What others do, written plainly: the peers that our figures are ratios against."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

__all__ = ["kinematics_with_rotation", "parse_amc_line_by_line"]


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
