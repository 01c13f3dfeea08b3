"""JSON as stores hold it, written, and read from files that nobody has checked yet.

A byte of JSON can become fifty bytes of memory, and each list costs time. What mocapidx writes
is mostly names, digests and numbers, so text that is mostly brackets is refused unread.
"""

import json
from collections.abc import Iterable
from typing import Any, Final

from mocapidx.errors import StoreError

__all__ = ["from_json", "is_mostly_brackets", "to_json", "with_lists"]

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


def to_json(value: Any, *, sort_keys: bool = False) -> bytes:
    """Write JSON in ASCII, without blanks.

    Parameters
    ----------
    value : object
    sort_keys : bool
        Whether equal objects give equal bytes, whatever the order of their keys.

    Returns
    -------
    bytes
        Lone surrogates, which stand for undecodable bytes in names, are escaped.

    Raises
    ------
    StoreError
        If it holds a number without end, or lists in lists without end.
    """
    try:
        text = json.dumps(value, separators=(",", ":"), allow_nan=False, sort_keys=sort_keys)
    # A forged manifest may hold 1e999, which JSON reads as infinity.
    except (ValueError, RecursionError) as exc:
        raise StoreError(
            "what the store says of a skeleton holds a number without end, or too many lists in "
            "lists; index the sources again"
        ) from exc
    return text.encode("ascii")


def with_lists(tree: bytes, **lists: Iterable[bytes]) -> bytes:
    """Add lists to a JSON object without reading it.

    Parameters
    ----------
    tree : bytes
        A JSON object that is not empty.
    **lists : iterable of bytes
        JSON texts, by the key of their list.

    Returns
    -------
    bytes
    """
    parts = [f'"{name}":['.encode() + b",".join(texts) + b"]" for name, texts in lists.items()]
    return b",".join((tree[:-1], *parts)) + b"}"


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")
