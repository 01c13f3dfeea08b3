"""Hits and annotations, read back from what commands print and other programs keep."""

import csv
import io
import json
import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mocapidx.errors import FormatError
from mocapidx.printable import shown
from mocapidx.tasks.bounded import read_at_most
from mocapidx.tasks.csv_cells import unquoted
from mocapidx.transcripts.kinds import kind_of
from mocapidx.transcripts.spans import LATEST, Span

__all__ = ["Found", "json_rows", "read_found"]

SIZE_LIMIT: Final = 256 << 20  # bytes
NEEDED: Final = ("document", "start_time", "end_time", "label")
SOURCE_FRAMES: Final = ("source_start_frame", "source_end_frame")
MOST_FRAMES: Final = 1 << 40


@dataclass(frozen=True, slots=True)
class Found:
    """One hit or one annotation.

    Parameters
    ----------
    document : str
    label : str
        The class.
    start, end : float
        In seconds.
    cost : float
        Smaller is better; 0 where the record has none.
    ranked : bool
        Whether it is a hit: annotations have no rank.
    rank : int or None
        From 1, where the record has one.
    source_frames : tuple of int or None
        First frame and end of the stretch in the original file, where the record has them.
    """

    document: str
    label: str
    start: float
    end: float
    cost: float
    ranked: bool
    rank: int | None = None
    source_frames: tuple[int, int] | None = None


def read_found(path: Path) -> tuple[Found, ...]:
    """Read hits or annotations.

    Parameters
    ----------
    path : Path
        JSON lines or CSV, as ``--format jsonl`` and ``--format csv`` print them, or a file of
        annotations that `mocapidx.transcripts` reads; ``-`` is the standard input.

    Returns
    -------
    tuple of Found
        In the order of the file.

    Raises
    ------
    FormatError
        If it can't be read or is something else; the message names the line.
    """
    where = "standard input" if str(path) == "-" else shown(path)
    data = _read_bytes(path, where)
    kind = kind_of(data)
    if kind is not None:
        transcripts = kind.read(data, where, "" if where == "standard input" else path.stem)
        return tuple(_said(each.document, span) for each in transcripts for span in each.spans)
    text = data.decode("utf-8-sig", "surrogateescape")
    if text.lstrip()[:1] == "{":
        rows = json_rows(text, where)
    elif not text.strip():  # no hits as JSON lines
        return ()
    else:
        rows = _csv_rows(text, where)
    return tuple(_found(row, place) for row, place in rows)


def _read_bytes(path: Path, where: str) -> bytes:
    try:
        if str(path) == "-":
            data = read_at_most(sys.stdin.buffer, SIZE_LIMIT)
        else:
            if not path.is_file():
                what = "is no regular file" if path.exists() else "no such file"
                raise FormatError(f"{where}: {what}; expected hits or annotations (or - for stdin)")
            with path.open("rb") as file:
                data = read_at_most(file, SIZE_LIMIT)
    except OSError as exc:
        raise FormatError(f"{where}: can't be read ({exc.strerror})") from exc
    if len(data) > SIZE_LIMIT:
        raise FormatError(f"{where}: larger than {SIZE_LIMIT >> 20} MiB")
    return data


def _said(document: str, span: Span) -> Found:
    if span.start is None or span.end is None:
        raise FormatError(f"{span.where}: '{shown(span.label)}' has no times")
    return Found(document, span.label, span.start, span.end, span.cost, False)


def json_rows(text: str, where: str) -> Iterator[tuple[Mapping[str, Any], str]]:
    """Read JSON lines.

    Parameters
    ----------
    text : str
    where : str
        The file, for messages.

    Yields
    ------
    (mapping, str)
        Each object, and the file with its line.

    Raises
    ------
    FormatError
        If a line is no JSON object.
    """
    for number, line in enumerate(text.split("\n"), start=1):
        if not line.strip():
            continue
        place = f"{where}:{number}"
        try:
            row = json.loads(line)
        except (ValueError, RecursionError) as exc:
            raise FormatError(f"{place}: not a JSON object on one line") from exc
        if type(row) is not dict:
            raise FormatError(f"{place}: not a JSON object on one line")
        yield row, place


def _csv_rows(text: str, where: str) -> Iterator[tuple[Mapping[str, Any], str]]:
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = next(rows, [])
        if not {*NEEDED} <= {*header}:
            raise FormatError(
                f"{where}:1: neither JSON lines nor CSV of hits or annotations; print them with "
                "--format jsonl"
            )
        for cells in rows:
            place = f"{where}:{rows.line_num}"
            if len(cells) != len(header):
                raise FormatError(f"{place}: {len(cells)} values, the header names {len(header)}")
            yield dict(zip(header, map(unquoted, cells), strict=True)), place
    except csv.Error as exc:
        raise FormatError(f"{where}:{rows.line_num}: not CSV ({exc})") from exc


def _found(row: Mapping[str, Any], place: str) -> Found:
    missing = [name for name in NEEDED if name not in row]
    if missing:
        raise FormatError(f"{place}: '{missing[0]}' is missing; not a hit or an annotation")
    for name in ("document", "label"):
        if type(row[name]) is not str:
            raise FormatError(f"{place}: '{name}' is no text")
    start, end = (_number(row[name], name, place) for name in ("start_time", "end_time"))
    if not 0 <= start < end <= LATEST:
        raise FormatError(f"{place}: goes from {start:g} s to {end:g} s")
    cost = _number(row.get("cost", 0.0), "cost", place)
    ranked = "rank" in row
    rank, first, stop = (_count(row, name, place) for name in ("rank", *SOURCE_FRAMES))
    if first is None or stop is None:
        return Found(row["document"], row["label"], start, end, cost, ranked, rank)
    if first >= stop:
        raise FormatError(f"{place}: goes from frame {first} to {stop} of the source")
    return Found(row["document"], row["label"], start, end, cost, ranked, rank, (first, stop))


def _count(row: Mapping[str, Any], name: str, place: str) -> int | None:
    if row.get(name) in (None, ""):
        return None
    number = _number(row[name], name, place)
    if not (number.is_integer() and 0 <= number <= MOST_FRAMES):
        raise FormatError(f"{place}: '{name}' is no number of frames or ranks: {number:g}")
    return int(number)


def _number(value: Any, name: str, place: str) -> float:
    try:
        number = float(value) if type(value) in (int, float, str) else math.nan
    except (ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        what = "empty, expected a number" if value == "" else f"no number: {shown(value, 40)}"
        raise FormatError(f"{place}: '{name}' is {what}")
    return number
