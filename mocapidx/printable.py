"""Text from files made safe to show: nothing in a name may steer a terminal or split a line."""

from collections.abc import Collection

__all__ = ["count", "meant", "shown"]

LONGEST = 120  # characters; enough for any honest name, and a message stays one line
MOST_COMPARED = 20_000  # names; more would take seconds to compare


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


def meant(name: str, known: Collection[str]) -> str:
    """Ask, at the end of a message, whether another name was meant.

    Parameters
    ----------
    name : str
        What was given and is not known.
    known : collection of str
        What could have been meant: of these the end of the path `name`, else the shortest that
        holds it, else the nearest.

    Returns
    -------
    str
        Empty where no known name is like the given one.

    Examples
    --------
    >>> meant("squad", ["kick", "squat"]), meant("a.amc", ["walk/a.amc"]), meant("x", ["kick"])
    ("; is 'squat' meant?", "; is 'walk/a.amc' meant?", '')
    >>> meant("takes/walk/a.amc", ["walk/a.amc", "walk/b.amc"])
    "; is 'walk/a.amc' meant?"
    """
    import difflib

    if len(known) > MOST_COMPARED or not name:
        return ""
    wanted = name.lower()
    near = [each for each in known if wanted.endswith(f"/{each.lower()}")]
    if not near and len(wanted) > 2:
        near = sorted((n for n in known if wanted in n.lower()), key=lambda n: (len(n), n))
    if not near:
        same = {each.lower(): each for each in reversed(sorted(known))}
        near = [same[each] for each in difflib.get_close_matches(wanted, same, n=1)]
    return f"; is '{shown(near[0])}' meant?" if near else ""


def _escaped(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # an undecodable byte, as surrogateescape keeps it
        return f"\\x{code - 0xDC00:02x}"
    return (
        character.encode("ascii", "backslashreplace").decode("ascii")
        if code > 127
        else (repr(character)[1:-1])
    )
