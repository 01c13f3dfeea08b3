"""Text from files made safe to show: nothing in a name may steer a terminal or split a line."""

__all__ = ["count", "shown"]

LONGEST = 120  # characters; enough for any honest name, and a message stays one line


def shown(text: object, longest: int | None = LONGEST) -> str:
    r"""Return `text` with everything unprintable escaped.

    Parameters
    ----------
    text : object
        A name or a path; bytes that were no UTF-8 may stand in it as lone surrogates.
    longest : int or None
        Longer texts lose their middle; None keeps all.

    Returns
    -------
    str
        The text on one line, without control characters, bidirectional controls, lone
        surrogates or separators other than the blank.

    Examples
    --------
    >>> shown("a\x1b[2J\nb")
    'a\\x1b[2J\\nb'
    """
    string = str(text)
    if longest is not None and len(string) > longest:
        kept = (longest - 3) // 2
        string = f"{string[:kept]}...{string[-kept:]}"
    if string.isprintable():
        return string
    return "".join(c if c.isprintable() else _escaped(c) for c in string)


def count(number: int, noun: str, plural: str | None = None) -> str:
    """Say how many there are of what.

    Parameters
    ----------
    number : int
    noun : str
        One of them.
    plural : str, optional
        Several of them; by default with an s.

    Returns
    -------
    str

    Examples
    --------
    >>> count(1, "file"), count(2, "file"), count(0, "class", "classes")
    ('1 file', '2 files', '0 classes')
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def _escaped(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # an undecodable byte, as surrogateescape keeps it
        return f"\\x{code - 0xDC00:02x}"
    return (
        character.encode("ascii", "backslashreplace").decode("ascii")
        if code > 127
        else (repr(character)[1:-1])
    )
