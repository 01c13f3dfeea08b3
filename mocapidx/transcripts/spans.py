"""Labelled stretches of time, and how they are laid out on tiers."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from mocapidx.errors import FormatError
from mocapidx.printable import shown

__all__ = ["LATEST", "Span", "Transcript", "checked_span", "milliseconds", "plain_text", "tiers"]

NOTHING: Final = "unlabelled"  # in place of a label without letters, which is a gap elsewhere
LATEST: Final = 1e9
"""No document lasts longer, in seconds."""


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of time and what goes on in it.

    Parameters
    ----------
    start, end : float or None
        In seconds; both None: the whole document.
    label : str
    cost : float
        Smaller is better; 0 where nothing is known.
    where : str
        Place in a file, for messages.
    """

    start: float | None
    end: float | None
    label: str
    cost: float = 0.0
    where: str = ""


@dataclass(frozen=True, slots=True)
class Transcript:
    """What goes on in one document.

    Parameters
    ----------
    document : str
        Its name; of a file that does not say, the name of the file without its suffix.
    spans : tuple of Span
        May overlap.
    seconds : float, optional
        How long the document lasts.
    remarks : tuple of str
        What a person should know, a sentence each.
    """

    document: str
    spans: tuple[Span, ...]
    seconds: float | None = None
    remarks: tuple[str, ...] = ()

    @property
    def by_time(self) -> list[Span]:
        """The spans by their start."""
        return sorted(self.spans, key=lambda span: (span.start or 0.0, span.end or 0.0))

    @property
    def end(self) -> float:
        """Seconds up to the end of the document, or at least of what is said of it."""
        return max([self.seconds or 0.0, *(span.end or 0.0 for span in self.spans)])


def checked_span(start: float, end: float, label: str, where: str) -> Span:
    """Make a span of what a file says.

    Parameters
    ----------
    start, end : float
        In seconds.
    label : str
        White space in it counts as single blanks.
    where : str
        Place in the file.

    Returns
    -------
    Span

    Raises
    ------
    FormatError
        If the times are no stretch of time.
    """
    if not (math.isfinite(start) and math.isfinite(end) and 0 <= start < end <= LATEST):
        raise FormatError(f"{where}: goes from {start:g} s to {end:g} s")
    return Span(start, end, " ".join(label.split()), where=where)


def milliseconds(span: Span) -> tuple[int, int]:
    """Give start and end of a span as whole milliseconds.

    Parameters
    ----------
    span : Span
        With times.

    Returns
    -------
    start, end : int
        Different, however short the span is.
    """
    start = round(1000 * (span.start or 0.0))
    return start, max(round(1000 * (span.end or 0.0)), start + 1)


def plain_text(text: str) -> str:
    r"""Make one printable line of a name, so that no program stumbles over it.

    Parameters
    ----------
    text : str
        Whatever a file or a class is called.

    Returns
    -------
    str
        Control characters, bidirectional controls, line ends and lone surrogates as ``\x1b``;
        never empty.
    """
    return shown(text, None).strip() or NOTHING


def tiers(transcript: Transcript, taken: Iterable[str] = ()) -> list[tuple[str, list[Span]]]:
    """Lay spans out such that no two on one tier overlap.

    Parameters
    ----------
    transcript : Transcript
        Its spans have times.
    taken : iterable of str
        Names that tiers may not have.

    Returns
    -------
    list of (str, list of Span)
        Tiers by name, a class each; what overlaps within a class goes to a tier ``NAME (2)``.
    """
    used = {*taken}
    laid: list[tuple[str, list[Span]]] = []
    by_label: dict[str, list[Span]] = {}
    for span in transcript.by_time:
        by_label.setdefault(plain_text(span.label), []).append(span)
    for label in sorted(by_label):
        for own in _layers(by_label[label]):
            name, number = label, 2
            while name in used:
                name, number = f"{label} ({number})", number + 1
            used.add(name)
            laid.append((name, own))
    return laid


def _layers(spans: Sequence[Span]) -> list[list[Span]]:
    layers: list[list[Span]] = []
    for span in spans:
        for layer in layers:
            if (layer[-1].end or 0.0) <= (span.start or 0.0):
                layer.append(span)
                break
        else:
            layers.append([span])
    return layers
