"""AMC text of a motion: what `read_amc` reads, the other way round."""

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.formats.asf import Acclaim
from mocapidx.formats.decimals import decimal, decimal_rows, degrees
from mocapidx.model import Recording
from mocapidx.printable import shown

__all__ = ["amc_text"]


def amc_text(recording: Recording, acclaim: Acclaim, rate: float | None = None) -> bytes:
    """Write a recording as AMC, to be read with its ASF.

    Parameters
    ----------
    recording : Recording
        Channels of the nodes of the ASF, as `read_amc` gives them.
    acclaim : Acclaim
        The ASF, as `read_asf` gives it: it has the last word on the order of a bone's values.
    rate : float, optional
        Frames a second, in Hz, for the header; by default the recording's own, or none.

    Returns
    -------
    bytes
        The text, in degrees, its frames numbered from 1. Translations read back as the same
        numbers, angles as `degrees` says.

    Raises
    ------
    ParameterError
        If the nodes are others than the ASF's, a channel is missing, or a number is not finite.
    """
    if recording.skeleton.names != acclaim.skeleton.names:
        raise ParameterError("the motion moves other bones than those of the ASF")
    if not np.isfinite(recording.values).all():
        raise ParameterError("an AMC can't hold NaN or infinity; fill the gaps first")
    columns = {
        channel: column
        for column, channel in enumerate(
            zip(recording.channel_nodes.tolist(), recording.channel_kinds.tolist(), strict=True)
        )
    }
    order, lines = [], []
    for node, kinds in enumerate(acclaim.columns):
        if kinds:
            if any((node, kind) not in columns for kind in kinds):
                raise ParameterError(f"bone {shown(acclaim.skeleton.names[node])} lacks a channel")
            order += [columns[node, kind] for kind in kinds]
            name = acclaim.skeleton.names[node].replace("%", "%%")
            lines.append(f"{name}{' %s' * len(kinds)}\n")
    values = recording.values[:, order]
    turning = recording.channel_kinds[order] >= 3
    values[:, turning] = degrees(values[:, turning])
    frame = "%s\n" + "".join(lines)
    rate = recording.rate if rate is None else rate
    header = "" if rate is None else f":SAMPLES-PER-SECOND {decimal(rate)}\n"
    text = [f":FULLY-SPECIFIED\n{header}:DEGREES\n"]
    text += [frame % (n, *row) for n, row in enumerate(decimal_rows(values), start=1)]
    return "".join(text).encode("utf-8", "surrogateescape")
