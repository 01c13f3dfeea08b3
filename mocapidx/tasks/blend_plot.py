"""Draw spaces of motion and the motion that is made from them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocapidx.durable import durable_replace
from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.reports.spaces import poses_picture, region_picture
from mocapidx.reports.style import picture_format
from mocapidx.synthesis.blending import blend_at
from mocapidx.synthesis.bodies import joint_points
from mocapidx.synthesis.parameters import Parameters, parse_parameters
from mocapidx.synthesis.spaces import BlendSpace, MotionFunction, reach
from mocapidx.tasks.blend import Made, open_space
from mocapidx.tasks.parameter_files import load_parameters

__all__ = ["draw_motion", "draw_space", "picture_format"]


def draw_space(
    space: BlendSpace | str | Path,
    picture: str | Path,
    targets: Sequence[Sequence[float]] = (),
    *,
    parameter: str | None = None,
) -> None:
    """Draw the accessible region of a space.

    Parameters
    ----------
    space : BlendSpace, str or Path
        A space, or its file.
    picture : str or Path
        A .png or .svg file.
    targets : sequence of sequences of float
        Drawn with what comes nearest to them.
    parameter : str, optional
        ``FILE.py:FUNCTION`` where the space was fitted with a function.

    Raises
    ------
    ParameterError, StoreError, FormatError, WriteError
    """
    path = Path(picture)
    suffix = picture_format(path)
    title = "accessible region"
    if not isinstance(space, BlendSpace):
        title = f"accessible region of {shown(Path(space).name, 60)}"
        space = open_space(space)
    what: Parameters | MotionFunction | None = None
    if parameter is not None:
        what = load_parameters(parameter)
    elif space.text:
        what = parse_parameters(space.text, "parameters of the space")
    asked = np.array(targets, dtype=np.float64) if targets else None
    reached = None
    if asked is not None:
        reached = np.array([reach(space, target, what).reached for target in asked])
    count = len(space.origins)
    drawn = region_picture(
        space.names,
        space.units,
        space.parameters[:count],
        space.parameters[count:],
        targets=asked,
        reached=reached,
        pose=_pose(space, what),
        title=title,
        suffix=suffix,
    )
    durable_replace(path, drawn)


def _pose(space: BlendSpace, what: Parameters | MotionFunction | None) -> FloatArray | None:
    """Return the first pose of the first example where the parameters are a place in its frame."""
    if not isinstance(what, Parameters) or len(what.measures) != 1:
        return None
    only = what.measures[0]
    if only.what != "position" or only.axes != "xyz" or len(only.joints) != 1:
        return None
    weights = np.eye(len(space.origins))[0]
    blended = blend_at(space.examples, weights, np.array([0.0, 1.0]))
    pose: FloatArray = joint_points(space.examples.body, blended.movement)[0]
    return pose


def draw_motion(made: Made, picture: str | Path) -> None:
    """Draw new motion as stick figures, from the side and from the front.

    Parameters
    ----------
    made : Made
    picture : str or Path
        A .png or .svg file.

    Raises
    ------
    ParameterError, WriteError
    """
    path = Path(picture)
    suffix = picture_format(path)
    asked = ", ".join(f"{value:.4g}" for value in made.target)
    title = f"new motion at {asked}"
    durable_replace(
        path,
        poses_picture(made.motion.positions, made.motion.rate, title=title, suffix=suffix),
    )
