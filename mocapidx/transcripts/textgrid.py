"""Praat TextGrids: interval tiers that cover all the time, with empty texts where nothing is.

References
----------
.. [1] Praat manual, "TextGrid file formats" and "Types of TextGrid files", P. Boersma and
   D. Weenink.
"""

import re
from collections.abc import Iterator, Sequence
from typing import Final

from mocapidx.errors import FormatError
from mocapidx.printable import shown
from mocapidx.transcripts.decoding import decoded_text
from mocapidx.transcripts.spans import Span, Transcript, checked_span, plain_text, tiers

__all__ = ["read_textgrid", "textgrid_text"]

DOCUMENT: Final = "document"  # the tier that names the document
MOST_TIERS: Final = 10_000
SHORTEST: Final = 1e-3  # seconds; a grid without any time is none
# Praat reads texts, flags and numbers that stand free, and takes all else for remarks.
TOKEN: Final = re.compile(
    r'"[^"]*"(?:"[^"]*")*|<[a-z]+>|(?<![^\s])[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?(?!\S)'
)


def textgrid_text(transcript: Transcript) -> bytes:
    """Write what goes on in a document as a TextGrid.

    Parameters
    ----------
    transcript : Transcript
        Its spans have times.

    Returns
    -------
    bytes
        UTF-8. The first tier is called ``document`` and says its name; then one tier a class.
    """
    end = max(transcript.end, SHORTEST)
    laid = [(DOCUMENT, [Span(0.0, end, transcript.document)])]
    laid += tiers(transcript, taken=[DOCUMENT])
    lines = [
        'File type = "ooTextFile"',
        'Object class = "TextGrid"',
        "",
        "xmin = 0 ",
        f"xmax = {end!r} ",
        "tiers? <exists> ",
        f"size = {len(laid)} ",
        "item []: ",
    ]
    for number, (name, spans) in enumerate(laid, start=1):
        rows = _covered(spans, end)
        lines += [
            f"    item [{number}]:",
            '        class = "IntervalTier" ',
            f"        name = {_quoted(name)} ",
            "        xmin = 0 ",
            f"        xmax = {end!r} ",
            f"        intervals: size = {len(rows)} ",
        ]
        for row, (start, stop, text) in enumerate(rows, start=1):
            lines += [
                f"        intervals [{row}]:",
                f"            xmin = {start!r} ",
                f"            xmax = {stop!r} ",
                f"            text = {_quoted(text)} ",
            ]
    return ("\n".join(lines) + "\n").encode("utf-8")


def _covered(spans: Sequence[Span], end: float) -> list[tuple[float, float, str]]:
    rows: list[tuple[float, float, str]] = []
    at = 0.0
    for span in spans:
        start, stop = float(span.start or 0.0), float(span.end or 0.0)
        if start > at:
            rows.append((at, start, ""))
        rows.append((start, stop, plain_text(span.label)))
        at = stop
    if at < end:
        rows.append((at, end, ""))
    return rows


def _quoted(text: str) -> str:
    doubled = text.replace('"', '""')
    return f'"{doubled}"'


def read_textgrid(data: bytes, where: str, stem: str) -> tuple[Transcript, ...]:
    """Read a TextGrid, long or short.

    Parameters
    ----------
    data : bytes
        The file: UTF-8, or UTF-16 with its mark.
    where : str
        The file, for messages.
    stem : str
        Its name without the suffix: the document's, unless a tier ``document`` says otherwise.

    Returns
    -------
    tuple of Transcript
        One: the intervals that have a text, of all tiers; tiers of points are passed over.

    Raises
    ------
    FormatError
        If it is no TextGrid; the message names the line.
    """
    reader = _Tokens(decoded_text(data, where), where)
    if reader.text() != "ooTextFile" or reader.text() != "TextGrid":
        raise reader.error("not a TextGrid as text; save it in Praat as a text file")
    start, end = reader.number(), reader.number()
    if reader.next() != "<exists>":
        return (Transcript(stem, (), end - start),)
    document = ""
    spans: list[Span] = []
    remarks: list[str] = []
    for _ in range(reader.count(MOST_TIERS)):
        kind, name = reader.text(), reader.text()
        reader.number(), reader.number()
        size = reader.count(len(reader.content))
        if kind == "TextTier":
            for _ in range(size):
                reader.number(), reader.text()
            remarks.append(f"{where}: passed over '{shown(name, 40)}', a tier of points")
            continue
        if kind != "IntervalTier":
            raise reader.error(f"a tier of the kind '{shown(kind, 40)}'")
        own = list(_intervals(reader, size))
        if name == DOCUMENT and size == 1 and own:
            document = own[0].label
        else:
            spans += own
    return (Transcript(document or stem, tuple(spans), end, tuple(remarks)),)


def _intervals(reader: "_Tokens", size: int) -> Iterator[Span]:
    for _ in range(size):
        start, stop = reader.number(), reader.number()
        label, place = reader.text(), reader.place
        if label.strip():
            yield checked_span(start, stop, label, place)


class _Tokens:
    """What stands free in a TextGrid, one after the other."""

    def __init__(self, content: str, where: str) -> None:
        self.content, self.where = content, where
        self.at = self.lines = self.counted = 0
        self.tokens = TOKEN.finditer(content)

    @property
    def place(self) -> str:
        """File and line of the last token."""
        self.lines += self.content.count("\n", self.counted, self.at)
        self.counted = self.at
        return f"{self.where}:{self.lines + 1}"

    def error(self, message: str) -> FormatError:
        return FormatError(f"{self.place}: {message}")

    def next(self) -> str:
        token = next(self.tokens, None)
        if token is None:
            self.at = len(self.content)
            raise self.error("ends too early; is the file cut off?")
        self.at = token.start()
        return token[0]

    def text(self) -> str:
        token = self.next()
        if token[0] != '"':
            raise self.error(f"expected a text in quotes, found {shown(token, 40)}")
        return token[1:-1].replace('""', '"')

    def number(self) -> float:
        token = self.next()
        if token[0] in '"<':
            raise self.error(f"expected a number, found {shown(token, 40)}")
        return float(token)

    def count(self, most: int) -> int:
        number = self.number()
        if not (number.is_integer() and 0 <= number <= most):
            raise self.error(f"expected how many there are, found {number:g}")
        return int(number)
