"""Text of annotation files."""

from mocapidx.errors import FormatError

__all__ = ["decoded_text"]

MARKS = (b"\xff\xfe", b"\xfe\xff")


def decoded_text(data: bytes, where: str) -> str:
    r"""Decode a file as UTF-8, or as UTF-16 where it begins with its mark.

    Parameters
    ----------
    data : bytes
    where : str
        The file, for messages.

    Returns
    -------
    str
        Lines end in ``\n``.

    Raises
    ------
    FormatError
        If it is neither.
    """
    try:
        text = data.decode("utf-16" if data.startswith(MARKS) else "utf-8-sig")
    except UnicodeError as exc:
        line = data.count(b"\n", 0, getattr(exc, "start", 0)) + 1
        raise FormatError(f"{where}:{line}: neither UTF-8 nor UTF-16; save it as UTF-8") from exc
    return text.replace("\r\n", "\n").replace("\r", "\n")
