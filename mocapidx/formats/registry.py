"""Motion files by their suffix: who reads what."""

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.formats.text import Limits, place
from mocapidx.model import PointRecording, Recording
from mocapidx.printable import shown

__all__ = ["SUFFIXES", "holds_motion", "is_motion_file", "read_recording", "sources_of"]


def _of(name: str) -> Any:
    """Import the module of a kind of file when such a file comes: a search reads one, if any."""
    return import_module(f"mocapidx.formats.{name}")


def _read_npz(path: Path, model: Path | None, limits: Limits) -> Recording | PointRecording:
    """Tell angles of AMASS from joint positions by the names of the arrays."""
    from mocapidx.formats.amass import AMASS_KEYS, amass_recording
    from mocapidx.formats.arrays import read_arrays
    from mocapidx.formats.positions import POSITION_KEYS, RATE_KEYS, joints_from_arrays

    arrays = read_arrays(path, limits, {*AMASS_KEYS, *POSITION_KEYS, *RATE_KEYS})
    if "positions" in arrays:
        return joints_from_arrays(path, arrays, limits)
    if "poses" in arrays:
        return amass_recording(path, arrays, limits, model)
    raise FormatError(
        f"{place(path)}: has no 'poses' and no 'positions', so there is no motion in it"
    )


READERS: Final[dict[str, Callable[[Path, Path | None, Limits], Recording | PointRecording]]] = {
    ".amc": lambda *given: _of("amc").read_amc(*given),
    ".bvh": lambda path, _, limits: _of("bvh").read_bvh(path, limits),
    ".c3d": lambda path, _, limits: _of("c3d").read_c3d(path, limits),
    ".trc": lambda path, _, limits: _of("trc").read_trc(path, limits),
    ".npz": _read_npz,
    ".npy": lambda *given: _of("positions").read_npy(*given),
    ".csv": lambda path, _, limits: _of("positions").read_csv(path, limits),
    ".json": lambda path, _, limits: _of("keypoints").read_keypoints(path, limits),
}
# Files of these kinds may well hold something else.
PEEKS: Final[dict[str, Callable[[Path], bool]]] = {
    ".npz": lambda path: bool({"poses", "positions"} & set(_of("arrays").array_names(path))),
    ".npy": lambda path: _of("positions").find_joint_list(path) is not None,
    ".csv": lambda path: bool(_of("positions").is_position_table(path)),
    ".json": lambda path: bool(_of("keypoints").is_keypoint_file(path)),
}
FARTHEST: Final = 1e9  # file units
PIECE: Final = 4_096  # frames looked at together
TOO_FAR: Final = "is more than 1e9 units away; is the file damaged?"
SUFFIXES: Final = frozenset(READERS)


def _unread(path: Path) -> str:
    """Say why there is no reader for a file."""
    if not path.exists():
        return "no such file"
    if path.is_dir():
        return "is a folder, expected a motion file"
    if path.suffix.lower() == ".asf":
        return "a skeleton without motion; name an AMC file that moves it"
    return f"no motion file by its name; mocapidx reads {', '.join(sorted(SUFFIXES))}"


def is_motion_file(path: Path) -> bool:
    """Whether a file holds motion, by its suffix in any case.

    Parameters
    ----------
    path : Path
        The file; it need not exist.

    Returns
    -------
    bool
        An ASF holds a skeleton and no motion.
    """
    return path.suffix.lower() in READERS


def holds_motion(path: Path) -> bool:
    """Whether a file found in a folder is one to read, by its suffix and, if need be, a look.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    bool
        False also for npz, npy, CSV and JSON files that hold something else.
    """
    peek = PEEKS.get(path.suffix.lower())
    if peek is None:
        return is_motion_file(path)
    return path.is_file() and peek(path)  # a pipe would block for ever


def sources_of(path: Path, skeleton_path: Path | None = None) -> tuple[Path, ...]:
    """Return the files that a take is read from: itself, and its skeleton if it has one apart.

    The skeleton of an AMC is its ASF, that of an npy file its list of joints, and that of an npz
    file of AMASS the body model that the user named, if any.

    Parameters
    ----------
    path : Path
        The motion file.
    skeleton_path : Path, optional
        The skeleton that the user named.

    Returns
    -------
    tuple of Path
        The motion file first.

    Raises
    ------
    FormatError
        If an AMC has no ASF.
    """
    suffix = path.suffix.lower()
    own = _of_kind(skeleton_path, suffix)
    if suffix == ".npy":
        own = _of("positions").find_joint_list(path)
    elif suffix == ".amc":
        own = own or _of("amc").find_skeleton(path)
    return (path,) if own is None else (path, own)


def _of_kind(skeleton_path: Path | None, suffix: str) -> Path | None:
    """Return the skeleton that the user named if it can be one of such files."""
    if skeleton_path is None:
        return None
    is_model = skeleton_path.suffix.lower() == ".npz"
    return skeleton_path if suffix == (".npz" if is_model else ".amc") else None


def read_recording(
    path: Path, *, skeleton_path: Path | None = None, limits: Limits | None = None
) -> Recording | PointRecording:
    """Read a motion file as it stands.

    Parameters
    ----------
    path : Path
        The motion file.
    skeleton_path : Path, optional
        As `sources_of` gives it: the ASF of an AMC, the body model of an AMASS file, the list of
        joints of an npy file.
    limits : Limits, optional
        What is refused as too large.

    Returns
    -------
    Recording or PointRecording
        The skeleton and its channels, or points, in the units of the file.

    Raises
    ------
    FormatError
        If the file can't be used; the message says where in it and why.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise FormatError(f"{place(path)}: {_unread(path)}")
    recording = reader(path, skeleton_path, limits or Limits())
    if isinstance(recording, PointRecording):
        return _seen_points(path, recording)
    _check_lengths(path, recording)
    return recording


def _seen_points(path: Path, recording: PointRecording) -> PointRecording:
    """Leave out points that are never seen.

    Points that no body has are refused, before they overflow in sums and squares.
    """
    far = np.argwhere(np.abs(recording.positions) > FARTHEST)
    if len(far):
        frame, point, _ = far[0].tolist()
        name = shown(recording.names[point])
        raise FormatError(f"{place(path)}: frame {frame}: point '{name}' {TOO_FAR}")
    kept = np.flatnonzero(np.isfinite(recording.positions[:, :, 0]).any(axis=0))
    if not len(kept):
        raise FormatError(f"{place(path)}: no point of it is ever seen")
    if len(kept) == len(recording.names):
        return recording
    names = tuple(recording.names[i] for i in kept.tolist())
    return replace(recording, names=names, positions=recording.positions[:, kept])


def _check_lengths(path: Path, recording: Recording) -> None:
    """Refuse lengths that no body has, before they overflow in sums and squares."""
    names = recording.skeleton.names
    far = np.argwhere(np.abs(recording.skeleton.offsets) > FARTHEST)
    if len(far):
        raise FormatError(f"{place(path)}: joint '{shown(names[far[0][0]])}' {TOO_FAR}")
    moving = np.flatnonzero(recording.channel_kinds < 3)
    for at in range(0, len(recording.values), PIECE):
        far = np.argwhere(np.abs(recording.values[at : at + PIECE, moving]) > FARTHEST)
        if len(far):
            frame, column = far[0].tolist()
            name = shown(names[recording.channel_nodes[moving[column]]])
            raise FormatError(f"{place(path)}: frame {at + frame}: joint '{name}' {TOO_FAR}")
