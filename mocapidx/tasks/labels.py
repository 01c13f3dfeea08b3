"""Which stretch of which document shows what: labels from a CSV file or from document names."""

import csv
import io
import itertools
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from mocapidx.errors import FormatError, ParameterError
from mocapidx.printable import count, shown
from mocapidx.store.manifest import Document

__all__ = ["Example", "Label", "LabelFile", "labels_from_names", "place_labels", "read_labels"]

COLUMNS: Final = ("document", "label", "start_time", "end_time", "group")
SIZE_LIMIT: Final = 64 << 20  # bytes
SLACK: Final = 1.0  # seconds that a label may last longer than its document
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


@dataclass(frozen=True, slots=True)
class Example:
    """A label on the frames of a document.

    Parameters
    ----------
    label : Label
    document : int
        Number of the document in the sequence that was asked for.
    start, end : int
        At the store's rate, from 0, end exclusive.
    """

    label: Label
    document: int
    start: int
    end: int


def read_labels(path: Path) -> LabelFile:
    """Read a labels file: CSV with the header ``document,label``.

    Optional columns are ``start_time,end_time`` (seconds) and ``group``; others are passed over.

    Parameters
    ----------
    path : Path

    Returns
    -------
    LabelFile

    Raises
    ------
    FormatError
        If the file can't be read or a row is wrong; the message names the line.
    """
    rows = csv.reader(io.StringIO(_read_text(path), newline=""), strict=True)
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
            labels.append(_label(dict(zip(header, cells, strict=True)), where))
    except csv.Error as exc:
        raise FormatError(f"{shown(path)}:{rows.line_num}: not CSV ({exc})") from exc
    if not labels:
        raise FormatError(f"{shown(path)}: has no labels, only a header")
    _check_overlaps(labels)
    unknown = ", ".join(shown(name) for name in header if name not in COLUMNS)
    return LabelFile(
        tuple(labels), (f"{shown(path)}: passed over the columns {unknown}",) if unknown else ()
    )


def _read_text(path: Path) -> str:
    try:
        if not path.is_file():
            raise FormatError(f"{shown(path)}: no such labels file, or no regular file")
        with path.open("rb") as file:
            data = file.read(SIZE_LIMIT + 1)
    except OSError as exc:
        raise FormatError(f"{shown(path)}: can't be read ({exc.strerror})") from exc
    if len(data) > SIZE_LIMIT:
        raise FormatError(f"{shown(path)}: larger than {SIZE_LIMIT >> 20} MiB, no labels file")
    # Names of documents are bytes of the file system; surrogates keep what is no UTF-8.
    return data.decode("utf-8-sig", "surrogateescape")


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
    if not (math.isfinite(value) and value >= 0):
        raise FormatError(f"{where}: {name} must be seconds from 0, found '{shown(text)}'")
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
                raise FormatError(
                    f"{after.where}: '{shown(after.label)}' overlaps '{shown(before.label)}' of "
                    f"line {before.where.rpartition(':')[2]} in {shown(after.document)}"
                )


def labels_from_names(names: Iterable[str], rule: str) -> LabelFile:
    """Take labels from the names of documents.

    Parameters
    ----------
    names : iterable of str
        Names of documents.
    rule : str
        ``folder``: the folder that holds a document is its label. Else a regular expression with
        a group ``(?P<label>...)``, and perhaps ``(?P<group>...)``, searched in each name.

    Returns
    -------
    LabelFile
        One label for each whole document; documents that the rule doesn't fit have none.

    Raises
    ------
    ParameterError
        If the rule is no such expression, or fits no document.
    """
    labels, unfit = [], 0
    expression = None if rule == "folder" else _compiled(rule)
    for name in names:
        label, group = _by_folder(name) if expression is None else _by_match(name, expression)
        unfit += label is None
        if label is not None:
            labels.append(Label(name, label, None, None, group, shown(name)))
    if not labels:
        what = "lies in a folder" if rule == "folder" else "is fitted by the expression"
        raise ParameterError(f"--labels-from {shown(rule)}: no document {what}")
    lacking = count(unfit, "document")
    remarks = (f"--labels-from {shown(rule)}: without a label: {lacking}",) if unfit else ()
    return LabelFile(tuple(labels), remarks)


def _compiled(rule: str) -> re.Pattern[str]:
    try:
        expression = re.compile(rule)
    except re.error as exc:
        raise ParameterError(f"--labels-from {shown(rule)}: no regular expression ({exc})") from exc
    if "label" not in expression.groupindex:
        raise ParameterError(
            f"--labels-from {shown(rule)}: expected 'folder' or a regular expression with "
            "a group (?P<label>...)"
        )
    return expression


def _by_folder(name: str) -> tuple[str | None, str | None]:
    return PurePosixPath(name).parent.name or None, None


def _by_match(name: str, expression: re.Pattern[str]) -> tuple[str | None, str | None]:
    match = expression.search(name)
    if match is None:
        return None, None
    groups = match.groupdict()
    return groups["label"] or None, groups.get("group") or None


def place_labels(
    labels: Iterable[Label], documents: Sequence[Document], rate: float, shortest: int
) -> list[Example]:
    """Find the frames that labels mean.

    Parameters
    ----------
    labels : iterable of Label
    documents : sequence of Document
        The live documents of a store.
    rate : float
        The store's, in Hz.
    shortest : int
        Frames that an example must have.

    Returns
    -------
    list of Example
        In the order of the labels.

    Raises
    ------
    FormatError
        If a document is not there, or a label does not lie in it or is too short.
    """
    numbers = {document.name: number for number, document in enumerate(documents)}
    examples = []
    for label in labels:
        number = numbers.get(label.document)
        if number is None:
            raise FormatError(
                f"{label.where}: no document '{shown(label.document)}' in the store; "
                "names are those that 'mocapidx info' lists"
            )
        frames = documents[number].frames
        start = round((label.start_time or 0.0) * rate)
        end = frames if label.end_time is None else round(label.end_time * rate)
        if start >= frames or end > frames + SLACK * rate:
            raise FormatError(
                f"{label.where}: {shown(label.document)} lasts {frames / rate:.2f} s, the label "
                f"goes from {start / rate:.2f} s to {end / rate:.2f} s"
            )
        end = min(end, frames)
        if end - start < shortest:
            raise FormatError(
                f"{label.where}: '{shown(label.label)}' has {end - start} frames at {rate:g} Hz, "
                f"an example needs at least {shortest}"
            )
        examples.append(Example(label, number, start, end))
    return examples
