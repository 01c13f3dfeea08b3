"""The kinds of annotation files: how each is known, written and read."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from mocapidx.transcripts.babel import read_babel
from mocapidx.transcripts.captions import read_srt, read_vtt, srt_text, vtt_text
from mocapidx.transcripts.eaf import eaf_text, read_eaf
from mocapidx.transcripts.spans import Transcript
from mocapidx.transcripts.textgrid import read_textgrid, textgrid_text

__all__ = ["KINDS", "Kind", "kind_of"]

SRT: Final = re.compile(r"[0-9]+[ \t]*\n[0-9:]+[,.][0-9]+[ \t]+-->")
BEGINNING: Final = 4096  # bytes looked at
BABEL_BEGINNING: Final = 1 << 20


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of annotation file.

    Parameters
    ----------
    name : str
        As options have it.
    suffix : str
        Of its files.
    read : callable
        Takes bytes, the file for messages, and its stem; gives transcripts.
    write : callable or None
        Takes a transcript and gives bytes; None where one file holds many documents.
    """

    name: str
    suffix: str
    read: Callable[[bytes, str, str], tuple[Transcript, ...]]
    write: Callable[[Transcript], bytes] | None = None


KINDS: Final = {
    kind.name: kind
    for kind in (
        Kind("eaf", ".eaf", read_eaf, eaf_text),
        Kind("textgrid", ".TextGrid", read_textgrid, textgrid_text),
        Kind("vtt", ".vtt", read_vtt, vtt_text),
        Kind("srt", ".srt", read_srt, srt_text),
        Kind("babel", ".json", read_babel),
    )
}


def kind_of(data: bytes) -> Kind | None:
    """Tell an annotation file by how it begins.

    Parameters
    ----------
    data : bytes
        Its content.

    Returns
    -------
    Kind or None
        None where it is none of these, such as CSV or JSON lines.
    """
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    beginning = data[:BEGINNING].decode("utf-16" if wide else "utf-8-sig", "ignore").lstrip()
    name = None
    if beginning.startswith("<"):
        name = "eaf"
    elif beginning.startswith("WEBVTT"):
        name = "vtt"
    elif "ooTextFile" in beginning.partition("\n")[0]:
        name = "textgrid"
    elif SRT.match(beginning.replace("\r\n", "\n")):
        name = "srt"
    elif beginning.startswith("{") and b'"feat_p"' in data[:BABEL_BEGINNING]:
        name = "babel"
    return None if name is None else KINDS[name]
