"""Which stretch of which document shows what: labels from files or from document names."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from typing import Final

from mocapidx.errors import FormatError, ParameterError
from mocapidx.printable import count, meant, shown
from mocapidx.store.manifest import Document
from mocapidx.tasks.document_names import DocumentNames
from mocapidx.tasks.label_files import Label, LabelFile, read_labels

__all__ = [
    "Example",
    "Label",
    "LabelFile",
    "labels_from_names",
    "named_labels",
    "place_labels",
    "read_labels",
]

SLACK: Final = 1.0  # seconds that a label may last longer than its document


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


def named_labels(labels: LabelFile, names: Iterable[str]) -> LabelFile:
    """Give labels the names of the documents that they mean.

    Parameters
    ----------
    labels : LabelFile
        Their documents may be called as `DocumentNames.find` knows them.
    names : iterable of str
        Of the documents there are.

    Returns
    -------
    LabelFile
        Labels of other documents stay as they are.

    Raises
    ------
    FormatError
        If several documents could be meant.
    """
    known = DocumentNames(names)
    named = [replace(each, document=_name(each, known) or each.document) for each in labels.labels]
    return replace(labels, labels=tuple(named))


def _name(label: Label, known: DocumentNames) -> str | None:
    return known.find(label.document, label.where)


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
    known = DocumentNames(numbers)
    examples = []
    for given in labels:
        label = replace(given, document=_name(given, known) or given.document)
        number = numbers.get(label.document)
        if number is None:
            raise FormatError(
                f"{label.where}: no document '{shown(label.document)}' in the store; "
                "names are those that 'mocapidx info STORE --documents' lists"
                f"{meant(label.document, numbers)}"
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
