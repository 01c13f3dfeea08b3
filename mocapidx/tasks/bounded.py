"""Read no more of a file than it may hold, and take no more memory than it does hold."""

from typing import BinaryIO, Final

__all__ = ["read_at_most"]

PIECE: Final = 1 << 20


def read_at_most(file: BinaryIO, most: int) -> bytes:
    """Read a file, or the beginning of one that is too large.

    Python sets aside as many bytes as are asked for, however short the file is.

    Parameters
    ----------
    file : binary file
    most : int
        Bytes.

    Returns
    -------
    bytes
        One more than `most` if there are more.
    """
    pieces = []
    left = most + 1
    while left > 0 and (piece := file.read(min(PIECE, left))):
        pieces.append(piece)
        left -= len(piece)
    return b"".join(pieces)
