"""TOML files that people write, read safely: feature sets, joint maps, queries, settings."""

import tomllib
from pathlib import Path
from typing import Any, Final

from mocapidx.errors import FormatError, MocapidxError
from mocapidx.printable import shown

__all__ = ["MOST_BYTES", "parse_toml", "read_toml_text"]

MOST_BYTES: Final = 1 << 20
LONGEST_LINE: Final = 2_000  # the parser's time is quadratic in the length of a dotted key


def read_toml_text(
    path: str | Path, error: type[MocapidxError] = FormatError, hint: str = ""
) -> str:
    """Read the text of a small regular file; a device or a pipe is never opened.

    Parameters
    ----------
    path : str or Path
    error : type
        What to raise.
    hint : str
        What to say besides where there is no such file.

    Returns
    -------
    str

    Raises
    ------
    MocapidxError
        Of the given type, if the file isn't there, isn't plain UTF-8 text or is larger than 1 MiB.
    """
    where = shown(path, None)
    try:
        file_path = Path(path)
        if not file_path.is_file():
            found = "is no plain file" if file_path.exists() else "no such file"
            raise error(f"{where}: {found}{hint}")
        with file_path.open("rb") as file:
            octets = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as exc:
        reason = (getattr(exc, "strerror", None) or str(exc)).lower()
        raise error(f"{where}: can't be read ({reason})") from exc
    if len(octets) > MOST_BYTES:
        raise error(f"{where}: larger than {MOST_BYTES >> 20} MiB")
    try:
        return octets.decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        raise error(f"{where}: not UTF-8 text at byte {exc.start}") from exc


def parse_toml(text: str, where: str, error: type[MocapidxError] = FormatError) -> dict[str, Any]:
    """Parse TOML, whatever the text holds.

    Parameters
    ----------
    text : str
    where : str
        What messages call it.
    error : type
        What to raise.

    Returns
    -------
    dict

    Raises
    ------
    MocapidxError
        Of the given type, if the text is no TOML, nested too deeply, or too large.
    """
    if len(text) > MOST_BYTES:
        raise error(f"{where}: larger than {MOST_BYTES >> 20} MiB")
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) > LONGEST_LINE:
            raise error(f"{where}: line {number} is longer than {LONGEST_LINE} characters")
    try:
        return tomllib.loads(text)
    except RecursionError as exc:
        raise error(f"{where}: is nested too deeply") from exc
    except ValueError as exc:
        raise error(f"{where}: is not TOML: {shown(exc, 200)}") from exc
