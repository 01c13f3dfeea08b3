"""Records as text: aligned tables for people, JSON lines and CSV for programs."""

import csv
import io
import json
import os
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, TypeAlias

from mocapidx.durable import durable_replace
from mocapidx.errors import WriteError
from mocapidx.model import Hit
from mocapidx.printable import shown
from mocapidx.tasks.csv_cells import quoted

__all__ = ["HIT_COLUMNS", "Record", "hit_record", "pair_records", "render_records", "save_text"]

Record: TypeAlias = Mapping[str, object]

HIT_COLUMNS: Final = (
    "rank",
    "document",
    "start_frame",
    "end_frame",
    "start_time",
    "end_time",
    "source_start_frame",
    "source_end_frame",
    "cost",
    "label",
)
"""The keys of a hit, in their order."""

HEADINGS: Final = {
    "start_time": "start s",
    "end_time": "end s",
    "source_start_frame": "from frame",
    "source_end_frame": "to frame",
    "source_frames": "frames",
    "source_rate_hz": "Hz",
}
"""Column heads of tables where the key with blanks for underscores would be too wide."""

FOR_PROGRAMS: Final = frozenset({"start_frame", "end_frame"})
"""Keys that tables leave out: frames at the store's rate, of which people have no use."""


def hit_record(hit: Hit, rank: int) -> Record:
    """Lay out a hit as the record that all commands print.

    Parameters
    ----------
    hit : Hit
    rank : int
        From 1.

    Returns
    -------
    dict
        Keys in their fixed order; times in seconds, rounded to microseconds; the cost rounded
        to nine digits.
    """
    return {
        "rank": rank,
        "document": hit.document,
        "start_frame": hit.start_frame,
        "end_frame": hit.end_frame,
        "start_time": round(hit.start_time, 6),
        "end_time": round(hit.end_time, 6),
        "source_start_frame": hit.source_start_frame,
        "source_end_frame": hit.source_end_frame,
        "cost": round(hit.cost, 9),
        "label": hit.label,
    }


def pair_records(facts: Record) -> list[Record]:
    """Lay out the facts about one thing as a record each, for a table or CSV."""
    return [
        {"what": what, "value": f"{value:g}" if isinstance(value, float) else value}
        for what, value in facts.items()
    ]


def render_records(
    records: Iterable[Record], row_format: str, columns: Sequence[str]
) -> Iterator[str]:
    """Turn records into lines of text without their line ends.

    Parameters
    ----------
    records : iterable of mapping
        All with the same keys.
    row_format : {"table", "jsonl", "csv"}
    columns : sequence of str
        The columns of a table, but for those that only programs want; ``csv`` takes them for
        its header where there is no record. JSON lines and CSV hold every key of a record.

    Yields
    ------
    str
        One line a record; tables and CSV have a header line first.
    """
    if row_format == "jsonl":
        # ASCII keeps odd names (lone surrogates, control characters) valid JSON everywhere.
        yield from (json.dumps(record, ensure_ascii=True) for record in records)
    elif row_format == "csv":
        yield from _csv_lines(list(records), columns)
    else:
        yield from _table_lines(list(records), columns)


def _csv_lines(records: Sequence[Record], columns: Sequence[str]) -> Iterator[str]:
    header = list(records[0]) if records else list(columns)
    for row in (header, *(map(_csv_cell, record.values()) for record in records)):
        line = io.StringIO()
        csv.writer(line, lineterminator="").writerow(row)
        yield line.getvalue()


def _csv_cell(value: object) -> object:
    if isinstance(value, (list, dict)):
        return json.dumps(value, ensure_ascii=True)
    if not isinstance(value, str):
        return value
    return quoted(shown(value, None))  # whole, or nobody would know the document again


def _table_lines(records: Sequence[Record], columns: Sequence[str]) -> Iterator[str]:
    columns = [name for name in columns if name not in _left_out(columns)]
    heads = [HEADINGS.get(name, name.replace("_", " ")) for name in columns]
    rows = [[_table_cell(record[name]) for name in columns] for record in records]
    numeric = [
        bool(records)
        and all(isinstance(record[name], (int, float, type(None))) for record in records)
        for name in columns
    ]
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    for row in (heads, *rows):
        cells = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        )
        yield "  ".join(cells).rstrip()


def _left_out(columns: Sequence[str]) -> frozenset[str]:
    # What is ranked answers one question, so that the label is the same in every row.
    return FOR_PROGRAMS | {"label"} if "rank" in columns else FOR_PROGRAMS


def _table_cell(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.3f}"
    return shown(str(value))


def save_text(lines: Iterable[str], path: Path) -> None:
    """Write lines to a file that is whole or not there, or else to a pipe or a device.

    Raises
    ------
    WriteError
        If they could not be written; a file that was there before is unchanged.
    BrokenPipeError
        If nobody reads the pipe any more.
    """
    data = (f"{line}\n".encode() for line in lines)
    if not _is_stream(path):
        durable_replace(path, data)
        return
    try:
        with path.open("wb") as stream:
            stream.writelines(data)
    except BrokenPipeError:
        raise
    except OSError as exc:
        raise WriteError(
            f"{shown(path, None)}: could not be written ({(exc.strerror or '').lower()})"
        ) from exc


def _is_stream(path: Path) -> bool:
    """Whether there is something that can't be replaced, such as a pipe or ``/dev/null``."""
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))
