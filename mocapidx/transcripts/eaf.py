"""ELAN annotation files (EAF 3.0): tiers of annotations between time slots in milliseconds.

References
----------
.. [1] EAF 3.0 schema, "EAFv3.0.xsd", The Language Archive, Max Planck Institute for
   Psycholinguistics.
"""

from dataclasses import dataclass, field
from typing import Any, Final
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

from mocapidx.errors import FormatError
from mocapidx.printable import count, shown
from mocapidx.transcripts.spans import (
    Span,
    Transcript,
    checked_span,
    milliseconds,
    plain_text,
    tiers,
)

__all__ = ["eaf_text", "read_eaf"]

DOCUMENT: Final = "mocapidx-document"  # the property that names the document
HEAD: Final = """<?xml version="1.0" encoding="UTF-8"?>
<ANNOTATION_DOCUMENT AUTHOR="" DATE="1970-01-01T00:00:00+00:00" FORMAT="3.0" VERSION="3.0" \
xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" \
xsi:noNamespaceSchemaLocation="http://www.mpi.nl/tools/elan/EAFv3.0.xsd">
    <HEADER MEDIA_FILE="" TIME_UNITS="milliseconds">
        <PROPERTY NAME="%s">%s</PROPERTY>
        <PROPERTY NAME="lastUsedAnnotationId">%d</PROPERTY>
    </HEADER>
"""
TAIL: Final = """    <LINGUISTIC_TYPE GRAPHIC_REFERENCES="false" LINGUISTIC_TYPE_ID="default-lt" \
TIME_ALIGNABLE="true"/>
</ANNOTATION_DOCUMENT>
"""


def eaf_text(transcript: Transcript) -> bytes:
    """Write what goes on in a document as an ELAN file.

    Parameters
    ----------
    transcript : Transcript
        Its spans have times.

    Returns
    -------
    bytes
        One tier a class, times in milliseconds; the document's name is a property. The date is
        that of no day, so that equal transcripts give equal bytes.
    """
    laid = tiers(transcript)
    times = sorted(time for _, spans in laid for span in spans for time in milliseconds(span))
    slots = [
        f'        <TIME_SLOT TIME_SLOT_ID="ts{slot}" TIME_VALUE="{time}"/>\n'
        for slot, time in enumerate(times, start=1)
    ]
    free: dict[int, list[int]] = {}  # several slots may have one time
    for slot, time in reversed([*enumerate(times, start=1)]):
        free.setdefault(time, []).append(slot)
    rows = []
    number = 0
    for name, spans in laid:
        rows.append(f'    <TIER LINGUISTIC_TYPE_REF="default-lt" TIER_ID={quoteattr(name)}>\n')
        for span in spans:
            number += 1
            first, last = (free[time].pop() for time in milliseconds(span))
            rows.append(
                f'        <ANNOTATION>\n            <ALIGNABLE_ANNOTATION ANNOTATION_ID="a{number}"'
                f' TIME_SLOT_REF1="ts{first}" TIME_SLOT_REF2="ts{last}">\n                '
                f"<ANNOTATION_VALUE>{escape(plain_text(span.label))}</ANNOTATION_VALUE>\n"
                "            </ALIGNABLE_ANNOTATION>\n        </ANNOTATION>\n"
            )
        rows.append("    </TIER>\n")
    head = HEAD % (DOCUMENT, escape(plain_text(transcript.document)), number)
    order = ["    <TIME_ORDER>\n", *slots, "    </TIME_ORDER>\n"]
    return "".join([head, *order, *rows, TAIL]).encode("utf-8")


def read_eaf(data: bytes, where: str, stem: str) -> tuple[Transcript, ...]:
    """Read an ELAN file.

    Parameters
    ----------
    data : bytes
        The file; its XML must have no document type, which ELAN never writes.
    where : str
        The file, for messages.
    stem : str
        Its name without the suffix: the document's, unless the file says otherwise.

    Returns
    -------
    tuple of Transcript
        One: annotations with times of their own, of all tiers.

    Raises
    ------
    FormatError
        If it is no ELAN file; the message names the line.
    """
    reader = _Eaf(where)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text.append
    parser.StartDoctypeDeclHandler = reader.doctype
    reader.parser = parser
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, LookupError, ValueError) as exc:  # LookupError: of an encoding
        line = getattr(exc, "lineno", 1)
        raise FormatError(f"{where}:{line}: not XML ({shown(exc)})") from exc
    return (reader.transcript(stem),)


@dataclass
class _Eaf:
    """An ELAN file while it is read."""

    where: str
    parser: Any = None
    text: list[str] = field(default_factory=list)
    slots: dict[str, float] = field(default_factory=dict)
    found: list[tuple[str, str, str, int]] = field(default_factory=list)
    document: str = ""
    unit: float = 1e-3  # seconds
    depth: int = 0
    untimed: int = 0
    property: str = ""
    refs: tuple[str, str, int] | None = None

    def error(self, message: str, line: int | None = None) -> FormatError:
        line = self.parser.CurrentLineNumber if line is None else line
        return FormatError(f"{self.where}:{line}: {message}")

    def doctype(self, *_: object) -> None:
        raise self.error("has a document type, which an ELAN file has not")

    def start(self, name: str, values: dict[str, str]) -> None:
        if not self.depth and name != "ANNOTATION_DOCUMENT":
            raise self.error(f"not an ELAN file: begins with <{shown(name, 40)}>")
        self.depth += 1
        self.text.clear()
        if name == "HEADER" and values.get("TIME_UNITS", "milliseconds") != "milliseconds":
            raise self.error(f"times in {shown(values['TIME_UNITS'], 40)}, expected milliseconds")
        if name == "PROPERTY":
            self.property = values.get("NAME", "")
        elif name == "TIME_SLOT" and "TIME_VALUE" in values:
            value = values["TIME_VALUE"]
            if not (value.isascii() and value.isdigit() and len(value) < 16):
                raise self.error(f"the time '{shown(value, 40)}' is no number of milliseconds")
            self.slots[values.get("TIME_SLOT_ID", "")] = int(value) / 1000
        elif name == "ALIGNABLE_ANNOTATION":
            first, last = (values.get(f"TIME_SLOT_REF{n}", "") for n in (1, 2))
            self.refs = first, last, self.parser.CurrentLineNumber
        elif name == "REF_ANNOTATION":
            self.untimed += 1

    def end(self, name: str) -> None:
        self.depth -= 1
        if name == "ANNOTATION_VALUE" and self.refs is not None:
            first, last, line = self.refs
            self.found.append((first, last, "".join(self.text), line))
            self.refs = None
        elif name == "PROPERTY" and self.property == DOCUMENT:
            self.document = "".join(self.text).strip()
        self.text.clear()

    def transcript(self, stem: str) -> Transcript:
        spans: list[Span] = []
        for first, last, label, line in self.found:
            if first not in self.slots or last not in self.slots:
                self.untimed += 1
            elif label.strip():
                times = self.slots[first], self.slots[last]
                spans.append(checked_span(*times, label, f"{self.where}:{line}"))
        untimed = count(self.untimed, "annotation")
        remark = f"{self.where}: passed over {untimed} without times of their own"
        remarks = (remark,) if self.untimed else ()
        return Transcript(self.document or stem, tuple(spans), remarks=remarks)
