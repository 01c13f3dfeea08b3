"""What the user says about motion files, and what is known of one that was read."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from mocapidx.errors import ParameterError
from mocapidx.formats.rates import EXPECTED, is_rate
from mocapidx.formats.text import Limits
from mocapidx.model import Motion, Up
from mocapidx.skeleton.conventions import Conventions, Overrides
from mocapidx.skeleton.gaps import FILLED, GapCounts
from mocapidx.skeleton.kinematics import RootPositions

__all__ = ["RateOrigin", "ReadOptions", "Reading"]

RateOrigin = Literal["option", "file", "name", "assumed"]


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What the user says about files; None: find out.

    Parameters
    ----------
    skeleton : Path or None
        The ASF of AMC files, or the body model (npz) of AMASS files.
    source_rate : float or None
        Frames a second of files that don't say, in Hz; BVH, C3D and TRC files state their own.
    joint_map : Path or None
        A joint map or, for points, a marker map in TOML.
    unit : float or None
        Metres in one file unit.
    up : {"x", "y", "z", "-x", "-y", "-z"} or None
        The axis that points up.
    root_positions : {"add", "replace"} or None
        Whether BVH position channels add to a joint's OFFSET or replace it.
    keep_first_frame : bool or None
        True: frame 0 is motion; False: it is a pose to drop.
    subject : str or None
        Whose points count in files of several people.
    fill_gaps : float
        Seconds: the longest gap of a point that is filled.
    limits : Limits
        What is refused as too large.

    Raises
    ------
    ParameterError
        If a value is out of its range.
    """

    skeleton: Path | None = None
    source_rate: float | None = None
    joint_map: Path | None = None
    unit: float | None = None
    up: Up | None = None
    root_positions: RootPositions | None = None
    keep_first_frame: bool | None = None
    subject: str | None = None
    fill_gaps: float = FILLED
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if self.source_rate is not None and not is_rate(self.source_rate):
            raise ParameterError(f"source rate must be {EXPECTED} Hz, got {self.source_rate}")
        if not 0 <= self.fill_gaps <= 3600:
            raise ParameterError(f"gaps to fill must be 0 to 3600 s, got {self.fill_gaps}")
        self.overrides()

    def overrides(self) -> Overrides:
        """Return the part that detection heeds."""
        return Overrides(self.unit, self.up, self.root_positions, self.keep_first_frame)


@dataclass(frozen=True, slots=True)
class Reading:
    """A take as it was read.

    Parameters
    ----------
    motion : Motion
        The 24 canonical joints in their order, at the source rate unless another was asked for.
    conventions : Conventions
        How the file was read, and why so.
    sources : tuple of Path
        The files read, the motion file first.
    source_frames : int
        Frames in the file.
    source_start : int
        The frame of the file that frame 0 of `motion` is: 1 after a dropped T-pose.
    source_rate : float
        Frames a second of the file, in Hz.
    rate_origin : {"option", "file", "name", "assumed"}
        Where the source rate comes from.
    gaps : GapCounts
        How much of the points that count was not seen, and what of that was filled.
    """

    motion: Motion
    conventions: Conventions
    sources: tuple[Path, ...]
    source_frames: int
    source_start: int
    source_rate: float
    rate_origin: RateOrigin
    gaps: GapCounts = field(default_factory=GapCounts)
