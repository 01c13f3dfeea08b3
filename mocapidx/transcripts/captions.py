"""WebVTT and SRT: captions that a video player shows over the picture of a take.

References
----------
.. [1] W3C, "WebVTT: The Web Video Text Tracks Format", sections 4 and 6.
"""

import html
import re
from collections.abc import Iterator
from typing import Final

from mocapidx.errors import FormatError
from mocapidx.printable import shown
from mocapidx.transcripts.decoding import decoded_text
from mocapidx.transcripts.spans import (
    Span,
    Transcript,
    checked_span,
    milliseconds,
    plain_text,
)

__all__ = ["read_srt", "read_vtt", "srt_text", "vtt_text"]

DOCUMENT: Final = "document: "  # begins the note that names the document
TIMING: Final = re.compile(
    r"(?:([0-9]{1,6}):)?([0-9]{1,2}):([0-9]{1,2})[.,]([0-9]{1,3})"
    r"[ \t]+-->[ \t]+"
    r"(?:([0-9]{1,6}):)?([0-9]{1,2}):([0-9]{1,2})[.,]([0-9]{1,3})(?:[ \t].*)?"
)
TAG: Final = re.compile(r"<[^<>]*>")
NO_CUES: Final = ("NOTE", "STYLE", "REGION")


def vtt_text(transcript: Transcript) -> bytes:
    """Write what goes on in a document as WebVTT.

    Parameters
    ----------
    transcript : Transcript
        Its spans have times.

    Returns
    -------
    bytes
        A note that names the document, then a cue each, by time.
    """
    name = html.escape(plain_text(transcript.document), quote=False)
    blocks = [f"WEBVTT\n\nNOTE {DOCUMENT}{name}\n"]
    for number, span in enumerate(transcript.by_time, start=1):
        label = html.escape(plain_text(span.label), quote=False)
        blocks.append(f"{number}\n{_timing(span, '.')}\n{label}\n")
    return "\n".join(blocks).encode("utf-8")


def srt_text(transcript: Transcript) -> bytes:
    """Write what goes on in a document as SRT, which has no place for the document's name.

    Parameters
    ----------
    transcript : Transcript
        Its spans have times.

    Returns
    -------
    bytes
        A numbered block each, by time.
    """
    blocks = [
        f"{number}\n{_timing(span, ',')}\n{plain_text(span.label)}\n"
        for number, span in enumerate(transcript.by_time, start=1)
    ]
    return "\n".join(blocks).encode("utf-8")


def _timing(span: Span, point: str) -> str:
    start, end = milliseconds(span)
    return f"{_clock(start, point)} --> {_clock(end, point)}"


def _clock(time: int, point: str) -> str:
    seconds, rest = divmod(time, 1000)
    minutes, seconds = divmod(seconds, 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}{point}{rest:03d}"


def read_vtt(data: bytes, where: str, stem: str) -> tuple[Transcript, ...]:
    """Read WebVTT; styles, regions, settings and tags count for nothing.

    Parameters
    ----------
    data : bytes
        The file.
    where : str
        The file, for messages.
    stem : str
        Its name without the suffix: the document's, unless a note says otherwise.

    Returns
    -------
    tuple of Transcript
        One.

    Raises
    ------
    FormatError
        If it is no WebVTT; the message names the line.
    """
    blocks = _blocks(decoded_text(data, where))
    line, first = next(blocks, (1, [""]))
    if not re.match(r"WEBVTT(?:[ \t]|\Z)", first[0]):
        raise FormatError(f"{where}:{line}: not WebVTT: it does not begin with WEBVTT")
    document, spans = "", []
    for line, block in blocks:
        if block[0].startswith(f"NOTE {DOCUMENT}"):
            document = document or html.unescape(block[0].partition(DOCUMENT)[2])
        elif block[0].split(None, 1)[0] not in NO_CUES or any("-->" in row for row in block[:2]):
            spans.append(_cue(block, where, line, marked=True))
    return (Transcript(document or stem, tuple(s for s in spans if s.label)),)


def read_srt(data: bytes, where: str, stem: str) -> tuple[Transcript, ...]:
    """Read SRT.

    Parameters
    ----------
    data : bytes
        The file.
    where : str
        The file, for messages.
    stem : str
        Its name without the suffix: the document's.

    Returns
    -------
    tuple of Transcript
        One.

    Raises
    ------
    FormatError
        If it is no SRT; the message names the line.
    """
    text = decoded_text(data, where)
    spans = [_cue(block, where, line, marked=False) for line, block in _blocks(text)]
    return (Transcript(stem, tuple(span for span in spans if span.label)),)


def _blocks(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield what stands between blank lines, with the number of its first line."""
    block: list[str] = []
    for number, line in enumerate(text.split("\n"), start=1):
        if line.strip():
            block.append(line)
        elif block:
            yield number - len(block), block
            block = []
    if block:
        yield text.count("\n") + 2 - len(block), block


def _cue(block: list[str], where: str, line: int, *, marked: bool) -> Span:
    at = 0 if "-->" in block[0] or len(block) == 1 else 1
    timing = TIMING.fullmatch(block[at].strip())
    if timing is None:
        raise FormatError(
            f"{where}:{line + at}: expected a time such as 00:00:01.000 --> 00:00:02.500, "
            f"found '{shown(block[at], 40)}'"
        )
    start, end = (_seconds(timing.groups()[n : n + 4]) for n in (0, 4))
    text = " ".join(block[at + 1 :])
    return checked_span(
        start, end, html.unescape(TAG.sub("", text)) if marked else text, f"{where}:{line + at}"
    )


def _seconds(parts: tuple[str | None, ...]) -> float:
    hours, minutes, seconds = (int(part or 0) for part in parts[:3])
    thousandths = int((parts[3] or "0").ljust(3, "0"))
    return (1000 * (3600 * hours + 60 * minutes + seconds) + thousandths) / 1000
