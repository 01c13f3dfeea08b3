"""Hits as still pictures: a few poses side by side, as SVG."""

from typing import Final

import numpy as np

from mocapidx.model import FloatArray
from mocapidx.reports.page.encode import joint_sides
from mocapidx.skeleton.joints import INDEX, PARENTS

__all__ = ["still_picture"]

POSES: Final = 5
WIDTH: Final = 280
HEIGHT: Final = 120
GROUND: Final = 112
UNITS_A_METRE: Final = 56.0
AZIMUTH: Final = np.radians(35.0)
"""How far the camera stands beside the way that the person faces at first."""


def _limbs() -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Cut the tree of joints into lines, each from its far end to where another passes."""
    sides, parents = joint_sides(), PARENTS.tolist()
    ends = [joint for joint in range(len(parents)) if joint not in parents]
    limbs, drawn = [], set[int]()
    for end in sorted(ends, key=lambda joint: sides[joint] != "m"):
        line = [end]
        while parents[line[-1]] >= 0 and line[-1] not in drawn:
            line.append(parents[line[-1]])
        drawn |= {*line}
        limbs.append((sides[end], tuple(line)))
    return tuple(limbs)


LIMBS: Final = _limbs()


def still_picture(poses: FloatArray, size: float, floor: float) -> str:
    """Draw poses at equal distances in time.

    Parameters
    ----------
    poses : ndarray of float, shape (T, 24, 3)
        In metres, Y up; NaN for joints that the skeleton lacks. At least one frame.
    size : float
        Of the body; 1 is a grown person.
    floor : float
        Height of the ground, in metres.

    Returns
    -------
    str
        An ``svg`` element without text; colours come from the page's style.
    """
    frames = np.unique(np.linspace(0, len(poses) - 1, POSES).round().astype(np.int64))
    chosen = np.asarray(poses[frames], dtype=np.float64)
    across, up = _seen(chosen, size, floor)
    spacing = WIDTH / len(frames)
    figures = []
    for number in range(len(frames)):
        x = across[number] + spacing * (number + 0.5)
        drawn = "".join(_figure(x, up[number]))
        figures.append(f'<g opacity="{0.45 + 0.55 * (number + 1) / len(frames):.2f}">{drawn}</g>')
    return (
        f'<svg class="still" viewBox="0 0 {WIDTH} {HEIGHT}" aria-hidden="true">'
        f'<path class="ground" d="M4 {GROUND}H{WIDTH - 4}"/>{"".join(figures)}</svg>'
    )


def _seen(poses: FloatArray, size: float, floor: float) -> tuple[FloatArray, FloatArray]:
    """Project joints for a camera that follows the root; both of shape (poses, 24)."""
    angle = _facing(poses[0]) + AZIMUTH
    centred = poses - poses[:, :1]
    # Seen from where the angle points to, the right is at a quarter turn from it.
    across = centred[..., 0] * np.cos(angle) - centred[..., 2] * np.sin(angle)
    scale = UNITS_A_METRE / size
    up = GROUND - (poses[..., 1] - floor) * scale
    return np.clip(across * scale, -999, 999), np.clip(up, -999, 999)


def _facing(pose: FloatArray) -> float:
    """Give the angle about the vertical, from Z to X, in which a person faces."""
    left, right = pose[INDEX["lhip"]], pose[INDEX["rhip"]]
    if not np.isfinite(left - right).all():
        return 0.0
    across = left - right
    return float(np.arctan2(-across[2], across[0]))


def _figure(x: FloatArray, y: FloatArray) -> list[str]:
    parts = []
    for side, joints in LIMBS:
        known = [joint for joint in joints if np.isfinite(x[joint]) and np.isfinite(y[joint])]
        points = "L".join(f"{x[joint]:.0f} {y[joint]:.0f}" for joint in known)
        if len(known) > 1:
            parts.append(f'<path class="{side}" d="M{points}"/>')
    head, top = INDEX["head"], INDEX["headtop"]
    if np.isfinite([x[head], y[head], x[top], y[top]]).all():
        middle = (x[head] + x[top]) / 2, (y[head] + y[top]) / 2
        parts.append(f'<circle class="m" cx="{middle[0]:.0f}" cy="{middle[1]:.0f}" r="5"/>')
    return parts
