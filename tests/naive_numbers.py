"""Numbers in motion files, one at a time, by what Python has."""

import math

DIGITS = set("0123456789+-.eE")


def number_of(word):
    """The number that a word stands for; None if motion files can't have it."""
    if set(word) - DIGITS:
        return None
    try:
        number = float(word)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def rows_of(lines, width):
    """The numbers of each line of bytes that has words, up to the first that is no row."""
    for line in lines.split(b"\n"):
        row = [number_of(word.decode("latin-1")) for word in line.split()]
        if not row:
            continue
        if len(row) != width or None in row:
            return
        yield row
