"""JSON of files that nobody has checked yet: no more lists and objects than what is written has.

A byte of JSON can become fifty bytes of memory, and each list costs time. What mocapidx writes
is mostly names, digests and numbers, so text that is mostly brackets is refused unread.
"""

import json
from typing import Any, Final

__all__ = ["from_json", "is_mostly_brackets"]

BYTES_EACH: Final = 16
"""Of text for each list or object; ours have 25 to 100."""

ALWAYS_ALLOWED: Final = 100_000
"""Lists and objects of any text, which take a few milliseconds; names may hold brackets, too."""


def is_mostly_brackets(text: bytes) -> bool:
    """Say whether a text has more lists and objects than any that mocapidx writes.

    Parameters
    ----------
    text : bytes

    Returns
    -------
    bool
    """
    most = max(ALWAYS_ALLOWED, len(text) // BYTES_EACH)
    return text.count(b"[") + text.count(b"{") > most


def from_json(text: bytes) -> Any:
    """Read JSON that mocapidx may have written.

    Parameters
    ----------
    text : bytes

    Returns
    -------
    object
        As ``json.loads`` gives it.

    Raises
    ------
    ValueError
        If it is no JSON, says NaN or Infinity, or is mostly brackets.
    RecursionError
        If it is nested too deeply.
    """
    if is_mostly_brackets(text):
        raise ValueError("it is mostly brackets")
    return json.loads(text, parse_constant=_refuse)


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")
