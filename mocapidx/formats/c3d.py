"""C3D: the points that optical systems measure, four numbers a point and frame.

The fourth number tells whether the point was seen at all. What models computed from the points
(angles, forces, moments, powers) is stored as further points; parameters list them, and they
are left out, as analogue values are.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import FormatError
from mocapidx.formats.c3d_layout import C3dLayout, floats_of, read_layout
from mocapidx.formats.rates import EXPECTED, is_rate
from mocapidx.formats.text import Limits, place, read_binary
from mocapidx.model import FloatArray, PointRecording, Up
from mocapidx.units import INCH

__all__ = ["named_apart", "read_c3d"]

MODELLED: Final = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
UNITS: Final = {
    "m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 0.01, "mm": 0.001, "in": INCH, "inches": INCH,
}  # fmt: skip
UPS: Final[dict[str, Up]] = {
    "+X": "x", "+Y": "y", "+Z": "z", "X": "x", "Y": "y", "Z": "z",
    "-X": "-x", "-Y": "-y", "-Z": "-z",
}  # fmt: skip


def read_c3d(path: Path, limits: Limits) -> PointRecording:
    """Read the points of a C3D file.

    Parameters
    ----------
    path : Path
        The file.
    limits : Limits
        What is refused as too large.

    Returns
    -------
    PointRecording
        Without what models computed; a point without a label is called ``*`` and its number
        from 1, a label that stands again gets a number behind: ``RTHI``, ``RTHI#2``.

    Raises
    ------
    FormatError
        If the file is no C3D file, is cut off or exceeds a limit, or if its numbers don't fit
        together.
    """
    data = read_binary(path, limits)
    layout = read_layout(path, data)
    limits.check_frames(layout.frames, path)
    limits.check_joints(layout.points, path, None)
    labels = _labels(layout)
    modelled = set(_modelled(layout))
    kept = [i for i, label in enumerate(labels) if label not in modelled]
    if not kept:
        raise FormatError(f"{place(path)}: has results of models only, no measured points")
    return PointRecording(
        names=named_apart([labels[i] for i in kept]),
        positions=_positions(layout, data, kept),
        rate=_rate(layout),
        unit=UNITS.get("".join(layout.text("POINT:UNITS")[:1]).lower()),
        up=UPS.get("".join(layout.text("POINT:Y_SCREEN")[:1]).upper()),
    )


def named_apart(names: list[str]) -> tuple[str, ...]:
    """Give names that stand more than once a number: ``RTHI``, ``RTHI#2``.

    Parameters
    ----------
    names : list of str

    Returns
    -------
    tuple of str
        All different.
    """
    taken = set(names)
    counts: dict[str, int] = {}
    apart = []
    for name in names:
        counts[name] = number = counts.get(name, 0) + 1
        new = name
        while number > 1 and new in taken:
            new, number = f"{name}#{number}", number + 1
        taken.add(new)
        apart.append(new)
    return tuple(apart)


def _labels(layout: C3dLayout) -> list[str]:
    """Return a label a point, also where there are more than 255."""
    labels = [label for part in _parts(layout, "LABELS") for label in part]
    labels += [""] * layout.points
    return [label or f"*{i + 1}" for i, label in enumerate(labels[: layout.points])]


def _parts(layout: C3dLayout, name: str) -> Iterator[tuple[str, ...]]:
    """Yield the texts of ``LABELS``, ``LABELS2`` and so on."""
    yield layout.text(f"POINT:{name}")
    number = 2
    while f"POINT:{name}{number}" in layout.parameters:
        yield layout.text(f"POINT:{name}{number}")
        number += 1


def _modelled(layout: C3dLayout) -> Iterator[str]:
    """Yield the labels of all that models computed."""
    groups = layout.text("POINT:TYPE_GROUPS")[::2]  # each with the name of its unit behind it
    for group in dict.fromkeys((*MODELLED, *(group.upper() for group in groups))):
        if group != "LABELS":
            for part in _parts(layout, group):
                yield from part


def _rate(layout: C3dLayout) -> float:
    for rate in (*layout.numbers("POINT:RATE")[:1].tolist(), layout.rate):
        if is_rate(rate):
            return float(rate)
    raise FormatError(
        f"{place(layout.path)}: its rate is {layout.rate:g} frames a second, expected {EXPECTED}"
    )


def _positions(layout: C3dLayout, data: bytes, kept: list[int]) -> FloatArray:
    """Return the points at `kept`, NaN where the fourth number says that one was not seen."""
    values = _values(layout, data)[:, kept]
    with np.errstate(invalid="ignore"):  # a signalling NaN is one too
        positions: FloatArray = values[:, :, :3].astype(np.float64)
    if layout.scale > 0:
        positions *= layout.scale
    positions[values[:, :, 3] < 0] = np.nan
    positions[~np.isfinite(positions).all(axis=2)] = np.nan
    return positions


def _values(layout: C3dLayout, data: bytes) -> NDArray[Any]:
    """Return all points as they are stored, shape (T, P, 4)."""
    count = layout.frames * (layout.frame_size // layout.value_size)
    if layout.scale > 0:
        kind = ">i2" if layout.processor == "SGI" else "<i2"
        flat: NDArray[Any] = np.frombuffer(data, kind, count, layout.data_start)
    elif layout.processor != "DEC":
        kind = ">f4" if layout.processor == "SGI" else "<f4"
        flat = np.frombuffer(data, kind, count, layout.data_start)
    else:
        end = layout.data_start + layout.frames * layout.frame_size
        flat = floats_of(data[layout.data_start : end], layout.processor)
    return flat.reshape(layout.frames, -1)[:, : 4 * layout.points].reshape(
        layout.frames, layout.points, 4
    )
