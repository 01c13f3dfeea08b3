"""Turn found motion into a space of motion, and make new motion from it."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.durable import durable_replace
from mocapidx.errors import ParameterError
from mocapidx.formats.asf import Acclaim
from mocapidx.formats.write_amc import amc_text
from mocapidx.formats.write_asf import asf_text
from mocapidx.formats.write_bvh import bvh_text
from mocapidx.model import FloatArray, Motion
from mocapidx.printable import shown
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.skeleton.rigs import as_joints
from mocapidx.synthesis.aiming import Aim
from mocapidx.synthesis.blending import Blend, blend
from mocapidx.synthesis.bodies import joint_points
from mocapidx.synthesis.file import load_space, save_space
from mocapidx.synthesis.parameters import Parameters, parse_parameters
from mocapidx.synthesis.recordings import recording_of
from mocapidx.synthesis.spaces import (
    ENOUGH,
    BlendSpace,
    FitOptions,
    MotionFunction,
    fit_space,
    reach,
)
from mocapidx.tasks.blend_examples import ExampleOptions, read_examples
from mocapidx.tasks.parameter_files import load_parameters
from mocapidx.tasks.records import Record
from mocapidx.units import ACCLAIM

__all__ = [
    "AIM_COLUMNS",
    "EXAMPLE_COLUMNS",
    "FitOptions",
    "Made",
    "aim_records",
    "example_records",
    "fit_blend_space",
    "made_summary",
    "make_motion",
    "open_space",
    "space_facts",
    "write_motion",
]

CENTIMETRE: Final = 0.01
FORMATS: Final = (".bvh", ".amc")
OUT_OF_REACH: Final = 5 * ENOUGH
AIM_COLUMNS: Final = ("parameter", "unit", "asked", "reached")
EXAMPLE_COLUMNS: Final = ("example", "document", "start_time", "end_time")


def fit_blend_space(
    hits: str | Path,
    parameter: str,
    output: str | Path | None = None,
    *,
    examples: ExampleOptions | None = None,
    options: FitOptions | None = None,
) -> BlendSpace:
    """Build a space of motion from hits.

    Parameters
    ----------
    hits : str or Path
        JSON lines or CSV as `query`, `retrieve` and `match` print them; ``-`` is the standard
        input.
    parameter : str
        A TOML file, or ``FILE.py:FUNCTION``: what the motion shall be steered by.
    output : str or Path, optional
        Where to keep the space.
    examples : ExampleOptions, optional
        Where the motions of the hits come from.
    options : FitOptions, optional

    Returns
    -------
    BlendSpace

    Raises
    ------
    FormatError
        If a file can't be used, a source is gone, or skeletons differ.
    ParameterError
        If there are too few examples, or they can't be aligned.
    StoreError, WriteError
    """
    if output is not None:
        _check_folder(Path(output))
    what = load_parameters(parameter)
    registered, origins = read_examples(Path(hits), examples or ExampleOptions())
    space = fit_space(registered, origins, what, options or FitOptions())
    if output is not None:
        save_space(space, Path(output))
    return space


def open_space(path: str | Path) -> BlendSpace:
    """Read a space of motion from its file, everything checked.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    BlendSpace

    Raises
    ------
    StoreError
        If there is no such file, or it is damaged or of a newer version.
    """
    return load_space(Path(path))


@dataclass(frozen=True, slots=True, eq=False)
class Made:
    """New motion.

    Parameters
    ----------
    motion : Motion
        The canonical joints: it starts over the origin, facing Z.
    aim : Aim
        Its blend weights, and what they reach.
    target : ndarray of float64, shape (D,)
        What was asked.
    blend : Blend
        Its rotations.
    space : BlendSpace
    """

    motion: Motion
    aim: Aim
    target: FloatArray
    blend: Blend = field(repr=False)
    space: BlendSpace = field(repr=False)

    @property
    def is_out_of_reach(self) -> bool:
        """Whether no valid blend gives what was asked."""
        return self.aim.miss > OUT_OF_REACH


def make_motion(
    space: BlendSpace | str | Path,
    at: Sequence[float],
    *,
    parameter: str | None = None,
    rate: float | None = None,
    output: str | Path | None = None,
) -> Made:
    """Make the motion of a space that has given parameters, or comes nearest to them.

    Parameters
    ----------
    space : BlendSpace, str or Path
        A space, or its file.
    at : sequence of float
        The parameters, in their units.
    parameter : str, optional
        ``FILE.py:FUNCTION`` where the space was fitted with a function: without it weights are
        interpolated, and what they reach is not known.
    rate : float, optional
        Frames a second, in Hz; default: that of the first example.
    output : str or Path, optional
        A .bvh or .amc file; with an AMC goes an ASF of the same name.

    Returns
    -------
    Made

    Raises
    ------
    ParameterError
        If the target has another number of values, or the output can't be of that kind.
    StoreError
        If the space file is damaged.
    FormatError, WriteError
    """
    if not isinstance(space, BlendSpace):
        space = load_space(Path(space))
    if output is not None:
        _check_output(Path(output), space)
    rate = space.examples.movements[0].rate if rate is None else rate
    if not 1 <= rate <= 1000:
        raise ParameterError(f"rate must be between 1 and 1000 Hz, got {rate}")
    what: Parameters | MotionFunction | None = None
    if parameter is not None:
        what = load_parameters(parameter)
    elif space.text:
        what = parse_parameters(space.text, "parameters of the space")
    target = np.asarray(at, dtype=np.float64)
    found = reach(space, target, what)
    blended = blend(space.examples, found.weights, rate)
    motion = Motion(CANONICAL_JOINTS, joint_points(space.examples.body, blended.movement), rate)
    made = Made(motion, found, target, blended, space)
    if output is not None:
        write_motion(made, Path(output))
    return made


def _check_folder(path: Path) -> None:
    """Say before any work is done that its result would have no place."""
    folder = Path(os.path.realpath(path)).parent
    if not folder.is_dir():
        raise ParameterError(
            f"{shown(path, None)}: there is no folder {shown(folder, None)}; make it first"
        )


def _check_output(path: Path, space: BlendSpace) -> None:
    _check_folder(path)
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise ParameterError(f"{shown(path, None)}: new motion is written as .bvh or .amc")
    if suffix == ".amc" and space.examples.body.skeleton.turned_by != "own":
        raise ParameterError(
            f"{shown(path, None)}: the examples have the joints of BVH files; write a .bvh"
        )


def write_motion(made: Made, path: Path) -> tuple[Path, ...]:
    """Write new motion as BVH, or as AMC with its ASF.

    Parameters
    ----------
    made : Made
    path : Path
        A .bvh or .amc file.

    Returns
    -------
    tuple of Path
        The files, the motion first.

    Raises
    ------
    ParameterError
        If the file can't be of that kind.
    WriteError
    """
    _check_output(path, made.space)
    body, movement = made.space.examples.body, made.blend.movement
    if path.suffix.lower() == ".bvh":
        joints = as_joints(recording_of(body, movement, CENTIMETRE))
        durable_replace(path, bvh_text(joints))
        return (path,)
    recording = recording_of(body, movement, ACCLAIM)
    bones = len(body.skeleton.names)
    skeleton_path = path.with_suffix(".asf")
    acclaim = Acclaim(
        path=skeleton_path,
        skeleton=recording.skeleton,
        columns=((0, 1, 2, 3, 4, 5), *[(3, 4, 5)] * (bones - 1)),
        turns=((3, 4, 5),) * bones,
        unit=ACCLAIM,
        degrees=True,
    )
    durable_replace(skeleton_path, asf_text(recording.skeleton, ACCLAIM, "blend"))
    durable_replace(path, amc_text(recording, acclaim))
    return path, skeleton_path


def aim_records(made: Made) -> Iterator[Record]:
    """Lay out what was asked and what was reached, a record for each parameter."""
    for name, unit, asked, reached in zip(
        made.space.names, made.space.units, made.target, made.aim.reached, strict=True
    ):
        yield {
            "parameter": name,
            "unit": unit,
            "asked": round(float(asked), 6),
            "reached": None if np.isnan(reached) else round(float(reached), 6),
            "reachable": None if np.isnan(reached) else not made.is_out_of_reach,
        }


def made_summary(made: Made) -> str:
    """Say in one line how near the new motion comes, and what it is blended from."""
    frames, rate = len(made.motion.positions), made.motion.rate
    used = int(np.count_nonzero(np.abs(made.aim.weights) > 1e-6))
    text = (
        f"{frames} frames ({frames / rate:.2f} s) blended from {used} of {len(made.space.origins)}"
    )
    if np.isnan(made.aim.miss):
        return f"{text} examples; what they reach is not known without --parameter"
    unit = " m" if set(made.space.units) == {"m"} else ""
    if made.is_out_of_reach:
        return (
            f"{text} examples; out of reach: this is on the border of the accessible region, "
            f"{made.aim.miss:.3f}{unit} away"
        )
    return f"{text} examples; off by {made.aim.miss:.4f}{unit}"


def example_records(space: BlendSpace) -> Iterator[Record]:
    """Lay out the examples of a space, each with its own parameters."""
    for number, origin in enumerate(space.origins):
        own = zip(space.names, space.parameters[number], strict=True)
        yield {
            "example": number + 1,
            "document": origin.document,
            "start_time": round(origin.start, 6),
            "end_time": round(origin.end, 6),
            **{name: round(float(value), 6) for name, value in own},
        }


def space_facts(space: BlendSpace) -> list[str]:
    """Say in a few lines what a space is."""
    times = space.examples.registration.times[-1]
    lines = [
        f"{len(space.origins)} examples of {times.min():.2f} to {times.max():.2f} s, "
        f"{len(space.weights)} samples, weights from {-space.extrapolation:g} to "
        f"{1 + space.extrapolation:g}"
    ]
    low, high = space.parameters.min(axis=0), space.parameters.max(axis=0)
    lines += [
        f"{name}: {a:.3f} to {b:.3f} {unit}".rstrip()
        for name, unit, a, b in zip(space.names, space.units, low, high, strict=True)
    ]
    return lines
