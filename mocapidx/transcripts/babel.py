"""Labels in the manner of BABEL: one JSON object of sequences, each with its labelled segments.

References
----------
.. [1] A. R. Punnakkal et al., "BABEL: Bodies, Action and Behavior with English Labels", CVPR
   2021; the layout is that of the files of release 1.0.
"""

import itertools
import json
from collections.abc import Iterator, Sequence
from typing import Any

from mocapidx.errors import FormatError
from mocapidx.printable import shown
from mocapidx.transcripts.decoding import decoded_text
from mocapidx.transcripts.spans import LATEST, Span, Transcript, checked_span

__all__ = ["babel_text", "read_babel"]


def babel_text(transcripts: Sequence[Transcript]) -> bytes:
    """Write what goes on in documents as BABEL does.

    Parameters
    ----------
    transcripts : sequence of Transcript
        Their spans have times.

    Returns
    -------
    bytes
        JSON: sequences under their numbers from 1. ``feat_p`` is the document's name; each
        label of ``frame_ann`` has its class as ``raw_label``, ``proc_label`` and ``act_cat``,
        times in seconds, and its cost, which BABEL has not.
    """
    sequences = {
        str(number): _sequence(number, transcript)
        for number, transcript in enumerate(transcripts, start=1)
    }
    return f"{json.dumps(sequences, indent=1, ensure_ascii=True)}\n".encode("ascii")


def _sequence(number: int, transcript: Transcript) -> dict[str, Any]:
    spans = transcript.by_time
    several = any((a.end or 0.0) > (b.start or 0.0) for a, b in itertools.pairwise(spans))
    labels = dict.fromkeys(span.label for span in spans)
    return {
        "babel_sid": number,
        "url": "",
        "feat_p": transcript.document,
        "dur": round(transcript.end, 6),
        "seq_ann": {
            "babel_lid": f"{number}-sequence",
            "anntr_id": "mocapidx",
            "mul_act": len(labels) > 1,
            "labels": [_label(f"{number}-{i}", label) for i, label in enumerate(labels, start=1)],
        },
        "frame_ann": {
            "babel_lid": f"{number}-frames",
            "anntr_id": "mocapidx",
            "mul_act": several,
            "labels": [
                _label(f"{number}-frames-{i}", span.label)
                | {
                    "start_t": round(span.start or 0.0, 6),
                    "end_t": round(span.end or 0.0, 6),
                    "cost": round(span.cost, 9),
                }
                for i, span in enumerate(spans, start=1)
            ],
        },
    }


def _label(name: str, label: str) -> dict[str, Any]:
    return {"raw_label": label, "proc_label": label, "seg_id": name, "act_cat": [label]}


def read_babel(data: bytes, where: str, stem: str) -> tuple[Transcript, ...]:
    """Read labels in the manner of BABEL.

    Parameters
    ----------
    data : bytes
        The file.
    where : str
        The file, for messages.
    stem : str
        Not looked at: sequences name their documents.

    Returns
    -------
    tuple of Transcript
        One a sequence. Segments are taken from ``frame_ann`` (or the first of ``frame_anns``);
        a sequence without has the labels of ``seq_ann``, which have no times.

    Raises
    ------
    FormatError
        If it is something else; the message names the sequence and the label.
    """
    try:
        sequences = json.loads(decoded_text(data, where), parse_constant=_refuse)
    except (ValueError, RecursionError) as exc:
        what = str(exc).partition(";")[0]  # behind it stands advice for programmers
        raise FormatError(f"{where}: not JSON ({shown(what, 100)})") from exc
    if type(sequences) is not dict:
        raise FormatError(f"{where}: not BABEL's JSON: expected an object of sequences")
    return tuple(
        _read_sequence(sequence, f"{where}: sequence {shown(name, 40)}")
        for name, sequence in sequences.items()
    )


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is no number")


def _read_sequence(sequence: Any, where: str) -> Transcript:
    if type(sequence) is not dict or type(sequence.get("feat_p")) is not str:
        raise FormatError(f"{where}: expected an object with feat_p, the name of a motion")
    seconds = sequence.get("dur")
    timed = _first(sequence, "frame_ann")
    spans = tuple(_read_labels(timed or _first(sequence, "seq_ann"), where, timed is not None))
    if not isinstance(seconds, int | float) or not 0 < seconds <= LATEST:
        seconds = None
    return Transcript(sequence["feat_p"], spans, seconds)


def _first(sequence: dict[str, Any], name: str) -> Any:
    several = sequence.get(f"{name}s")
    one = sequence.get(name)
    return several[0] if one is None and type(several) is list and several else one


def _read_labels(annotation: Any, where: str, timed: bool) -> Iterator[Span]:
    labels = annotation.get("labels") if type(annotation) is dict else []
    if type(labels) is not list:
        raise FormatError(f"{where}: labels are no list")
    for number, label in enumerate(labels, start=1):
        place = f"{where}: label {number}"
        text = label.get("proc_label") or label.get("raw_label") if type(label) is dict else None
        if type(text) is not str:
            raise FormatError(f"{place}: has neither proc_label nor raw_label")
        if not timed:
            yield Span(None, None, " ".join(text.split()), where=place)
            continue
        times = [label.get("start_t"), label.get("end_t")]
        if any(type(time) not in (int, float) for time in times):
            raise FormatError(f"{place}: start_t and end_t are no numbers")
        # whole numbers may be too large for a float
        start, end = (float(max(-1, min(time, 2 * LATEST))) for time in times)
        yield checked_span(start, end, text, place)
