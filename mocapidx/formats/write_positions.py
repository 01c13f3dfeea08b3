"""Joint positions as npz and as CSV, for programs that take no motion files."""

import io
import zipfile
from typing import Any, Final

import numpy as np

from mocapidx.formats.decimals import decimal
from mocapidx.model import Motion

__all__ = ["positions_csv", "positions_npz"]

EARLIEST: Final = (1980, 1, 1, 0, 0, 0)  # of a zip; one motion always gives the same bytes


def positions_npz(motion: Motion) -> bytes:
    """Write positions as a NumPy archive.

    Parameters
    ----------
    motion : Motion
        T frames of J joints, in metres, Y up.

    Returns
    -------
    bytes
        Arrays `positions` (float64, (T, J, 3), NaN where a joint is not there), `joints` (their
        names), `rate` (Hz), `made` (joints that were made up from others), and what the numbers
        mean: `unit` 1.0 (metres), `up` "y".
    """
    arrays: dict[str, Any] = {
        "positions": np.asarray(motion.positions, np.float64),
        "joints": np.array(motion.joints, np.str_),
        "rate": np.float64(motion.rate),
        "made": np.array(motion.made, np.str_),
        "unit": np.float64(1.0),
        "up": np.array("y", np.str_),
    }
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.asarray(array), allow_pickle=False)
            info = zipfile.ZipInfo(f"{name}.npy", EARLIEST)
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, member.getvalue())
    return stream.getvalue()


def positions_csv(motion: Motion) -> bytes:
    """Write positions as CSV, one row a frame.

    Parameters
    ----------
    motion : Motion
        T frames of J joints, in metres, Y up.

    Returns
    -------
    bytes
        The header is ``time,root_x,root_y,root_z,...``; time in seconds from 0, positions in
        metres, with the digits that read back as the same numbers; a cell is empty where a
        joint is not there, or was made up from others, which a table has no place to say.
    """
    names = [f"{joint}_{axis}" for joint in motion.joints for axis in "xyz"]
    positions = np.array(motion.positions, np.float64)
    positions[:, [joint in motion.made for joint in motion.joints]] = np.nan
    rows = positions.reshape(len(positions), -1)
    lines = [",".join(("time", *names))]
    for frame, row in enumerate(rows.tolist()):
        cells = ("" if value != value else decimal(value) for value in row)
        lines.append(",".join((decimal(frame / motion.rate), *cells)))
    return ("\n".join(lines) + "\n").encode("ascii")
