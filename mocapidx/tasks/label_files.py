"""Files of labels: CSV, JSON lines, and what other programs write."""

import csv
import io
import itertools
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mocapidx.errors import FormatError
from mocapidx.printable import shown
from mocapidx.tasks.bounded import read_at_most
from mocapidx.tasks.csv_cells import unquoted
from mocapidx.tasks.found import json_rows
from mocapidx.transcripts.kinds import KINDS, kind_of
from mocapidx.transcripts.spans import LATEST

__all__ = ["Label", "LabelFile", "read_labels"]

COLUMNS: Final = ("document", "label", "start_time", "end_time", "group")
SIZE_LIMIT: Final = 64 << 20  # bytes
TIME: Final = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Label:
    """One row of a labels file.

    Parameters
    ----------
    document : str
        Name of a document.
    label : str
        The motion class.
    start_time, end_time : float or None
        In seconds; None: from the beginning, to the end.
    group : str or None
        Person or recording.
    where : str
        File and line, for messages.
    """

    document: str
    label: str
    start_time: float | None
    end_time: float | None
    group: str | None
    where: str


@dataclass(frozen=True, slots=True)
class LabelFile:
    """Labels, and what a person should know about them.

    Parameters
    ----------
    labels : tuple of Label
    remarks : tuple of str
        A sentence each.
    """

    labels: tuple[Label, ...]
    remarks: tuple[str, ...] = ()


def read_labels(path: Path) -> LabelFile:
    """Read a labels file.

    CSV has the header ``document,label`` and perhaps ``start_time,end_time`` (seconds) and
    ``group``; JSON lines have the same keys; others are passed over. ELAN files, TextGrids,
    WebVTT, SRT and JSON in the manner of BABEL are known by how they begin.

    Parameters
    ----------
    path : Path
        A file, or a folder of files of those other programs, one a document.

    Returns
    -------
    LabelFile

    Raises
    ------
    FormatError
        If a file can't be read or says what can't be; the message names the line.
    """
    files = _files_below(path) if path.is_dir() else [path]
    read = [_read_file(file) for file in files]
    labels = tuple(label for each in read for label in each.labels)
    if not labels:
        raise FormatError(f"{shown(path)}: has no labels")
    _check_overlaps(labels)
    return LabelFile(labels, tuple(remark for each in read for remark in each.remarks))


def _files_below(folder: Path) -> list[Path]:
    suffixes = {kind.suffix.lower() for kind in KINDS.values()}
    found = [p for p in folder.iterdir() if p.suffix.lower() in suffixes and p.name[0] != "."]
    if not found:
        raise FormatError(
            f"{shown(folder)}: a folder without labels; expected files such as "
            f"{', '.join(sorted(suffixes))}"
        )
    return sorted(found)


def _read_file(path: Path) -> LabelFile:
    data = _read_bytes(path)
    kind = kind_of(data)
    if kind is not None:
        transcripts = kind.read(data, shown(path), path.stem)
        labels = [
            Label(each.document, span.label, span.start, span.end, None, span.where)
            for each in transcripts
            for span in each.spans
        ]
        return LabelFile(tuple(labels), tuple(r for each in transcripts for r in each.remarks))
    # Names of documents are bytes of the file system; surrogates keep what is no UTF-8.
    text = data.decode("utf-8-sig", "surrogateescape")
    return _from_json(text, path) if text.lstrip()[:1] == "{" else _from_csv(text, path)


def _from_json(text: str, path: Path) -> LabelFile:
    labels = []
    for row, where in json_rows(text, shown(path)):
        cells = {name: row.get(name) for name in COLUMNS}
        for name in COLUMNS[:2]:
            if type(cells[name]) is not str:
                raise FormatError(f"{where}: '{name}' is missing or no text")
        texts = {name: "" if cell is None else str(cell) for name, cell in cells.items()}
        labels.append(_label(texts, where))
    return LabelFile(tuple(labels))


def _from_csv(text: str, path: Path) -> LabelFile:
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    labels = []
    try:
        header = [name.strip() for name in next(rows, [])]
        _check_header(header, path)
        for cells in rows:
            where = f"{shown(path)}:{rows.line_num}"
            if not any(cell.strip() for cell in cells):
                continue
            if len(cells) != len(header):
                raise FormatError(
                    f"{where}: found {len(cells)} values, the header names {len(header)} columns"
                )
            labels.append(_label(dict(zip(header, map(unquoted, cells), strict=True)), where))
    except csv.Error as exc:
        raise FormatError(f"{shown(path)}:{rows.line_num}: not CSV ({exc})") from exc
    if not labels:
        raise FormatError(f"{shown(path)}: has no labels, only a header")
    unknown = ", ".join(shown(name) for name in header if name not in COLUMNS)
    return LabelFile(
        tuple(labels), (f"{shown(path)}: passed over the columns {unknown}",) if unknown else ()
    )


def _read_bytes(path: Path) -> bytes:
    try:
        if not path.is_file():
            what = "is no regular file" if path.exists() else "no such labels file"
            raise FormatError(f"{shown(path)}: {what}; expected one such as CSV of document,label")
        with path.open("rb") as file:
            data = read_at_most(file, SIZE_LIMIT)
    except OSError as exc:
        raise FormatError(f"{shown(path)}: can't be read ({exc.strerror})") from exc
    if len(data) > SIZE_LIMIT:
        raise FormatError(f"{shown(path)}: larger than {SIZE_LIMIT >> 20} MiB, no labels file")
    return data


def _check_header(header: Sequence[str], path: Path) -> None:
    missing = [name for name in COLUMNS[:2] if name not in header]
    if missing:
        found = shown(",".join(header)) or "nothing"
        raise FormatError(
            f"{shown(path)}:1: the header has no column '{missing[0]}'; expected "
            f"document,label and perhaps start_time,end_time,group, found {found}"
        )
    twice = [name for name in header if header.count(name) > 1]
    if twice:
        raise FormatError(f"{shown(path)}:1: the column '{shown(twice[0])}' stands twice")


def _label(row: dict[str, str], where: str) -> Label:
    for name in COLUMNS[:2]:
        if not row[name].strip():
            raise FormatError(f"{where}: the {name} is empty")
    start, end = (_time(row.get(name, ""), name, where) for name in COLUMNS[2:4])
    if end is not None and end <= (start or 0.0):
        raise FormatError(
            f"{where}: end_time {end:g} must be later than start_time {start or 0.0:g}"
        )
    group = row.get("group", "").strip() or None
    return Label(row["document"], row["label"].strip(), start, end, group, where)


def _time(text: str, name: str, where: str) -> float | None:
    text = text.strip()
    if not text:
        return None
    value = float(text) if TIME.fullmatch(text) else math.nan
    if not 0 <= value <= LATEST:
        raise FormatError(
            f"{where}: {name} must be seconds from 0 to {LATEST:g}, found '{shown(text)}'"
        )
    return value


def _check_overlaps(labels: Iterable[Label]) -> None:
    """Refuse labels that share a part of a document: one motion can't stand for two classes."""
    by_document: dict[str, list[Label]] = {}
    for label in labels:
        by_document.setdefault(label.document, []).append(label)
    for own in by_document.values():
        ordered = sorted(own, key=lambda label: label.start_time or 0.0)
        for before, after in itertools.pairwise(ordered):
            end = math.inf if before.end_time is None else before.end_time
            if (after.start_time or 0.0) < end:
                place = before.where.rpartition(":")[2].strip()
                raise FormatError(
                    f"{after.where}: '{shown(after.label)}' overlaps '{shown(before.label)}' of "
                    f"{'line ' * place.isdigit()}{place} in {shown(after.document)}; "
                    "one motion can't be an example of two classes"
                )
