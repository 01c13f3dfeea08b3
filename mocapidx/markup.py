"""HTML for notebooks: names from files are inert text, pictures stand in the text itself."""

import struct
import zlib
from binascii import b2a_base64
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocapidx.printable import shown

__all__ = ["facts_html", "grey_picture_html", "point_figures_html", "table_html"]

ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&#39;"})
LEFT, RIGHT, MIDDLE = "#4477aa", "#ee6677", "#777777"


def table_html(columns: Sequence[str], rows: Iterable[Sequence[object]], below: str = "") -> str:
    """Lay out rows under heads.

    Parameters
    ----------
    columns : sequence of str
    rows : iterable of sequence
        Floats are shown with three decimals.
    below : str
        A line of text under the table.

    Returns
    -------
    str
    """
    head = "".join(f"<th>{_text(name)}</th>" for name in columns)
    body = "".join(f"<tr>{''.join(f'<td>{_text(cell)}</td>' for cell in row)}</tr>" for row in rows)
    note = f"<p>{_text(below)}</p>" if below else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{note}"


def facts_html(title: str, facts: Mapping[str, object]) -> str:
    """Lay out what is known of one thing, a line each.

    Parameters
    ----------
    title : str
    facts : mapping of str to value

    Returns
    -------
    str
    """
    rows = "".join(
        f"<tr><th>{_text(name)}</th><td>{_text(value)}</td></tr>" for name, value in facts.items()
    )
    return f"<p><b>{_text(title)}</b></p><table><tbody>{rows}</tbody></table>"


def grey_picture_html(values: NDArray[Any], width: int, height: int, text: str) -> str:
    """Draw a matrix in grey, white is 1.

    Parameters
    ----------
    values : ndarray of float, shape (rows, columns)
        From 0 to 1.
    width, height : int
        On the page, in pixels.
    text : str
        What it shows, for those who don't see it.

    Returns
    -------
    str
        An ``img`` element that holds the picture.
    """
    grey = np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8)
    rows, columns = grey.shape
    lines = np.zeros((rows, columns + 1), np.uint8)  # a 0 before each row: no filter
    lines[:, 1:] = grey
    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), 9)), (b"IEND", b""))
    png = b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)
    source = b2a_base64(png, newline=False).decode("ascii")
    return (
        f'<img src="data:image/png;base64,{source}" width="{width}" height="{height}" '
        f'alt="{_text(text)}" style="image-rendering:pixelated">'
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    body = kind + data
    return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))


def point_figures_html(poses: NDArray[Any], joints: Sequence[str], text: str) -> str:
    """Draw poses as points beside each other, seen from where the body is broadest.

    Parameters
    ----------
    poses : ndarray of float, shape (P, J, 3)
        In metres, Y up; what is NaN is left out.
    joints : sequence of str, length J
        Names that begin with l and r get the colours of their side.
    text : str
        What it shows, for those who don't see it.

    Returns
    -------
    str
        An ``svg`` element.
    """
    flat = poses.astype(np.float64)
    flat = flat - np.nanmean(flat[..., [0, 2]], axis=(0, 1))[[0, 0, 1]] * (1, 0, 1)
    ground = flat[..., [0, 2]].reshape(-1, 2)
    seen = ground[np.isfinite(ground).all(axis=1)]
    _, directions = np.linalg.eigh(seen.T @ seen)
    across = flat[..., [0, 2]] @ directions[:, 1]
    own = across - np.nanmean(across, axis=1, keepdims=True)
    height = float(np.nanmax(flat[..., 1]) - np.nanmin(flat[..., 1])) or 1.0
    scale, gap = 120 / height, 90
    x = own * scale + gap * (np.arange(len(poses))[:, None] + 0.5)
    y = 130 - (flat[..., 1] - np.nanmin(flat[..., 1])) * scale
    colours = [{"l": LEFT, "r": RIGHT}.get(name[:1], MIDDLE) for name in joints]
    colours = [
        MIDDLE if name == "root" else each for name, each in zip(joints, colours, strict=True)
    ]
    dots = "".join(
        f'<circle cx="{x[pose, joint]:.1f}" cy="{y[pose, joint]:.1f}" r="2.5" fill="{colour}"/>'
        for pose in range(len(poses))
        for joint, colour in enumerate(colours)
        if np.isfinite(x[pose, joint]) and np.isfinite(y[pose, joint])
    )
    size = f'width="{gap * len(poses)}" height="140"'
    return f'<svg {size} role="img" aria-label="{_text(text)}">{dots}</svg>'


def _text(value: object) -> str:
    text = f"{value:.3f}" if isinstance(value, float) else shown(value)
    return text.translate(ESCAPES)
