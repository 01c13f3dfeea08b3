"""Hits and annotations as files of other programs: ELAN, Praat, video players, BABEL."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from mocapidx.durable import durable_replace, make_folder
from mocapidx.errors import ParameterError
from mocapidx.printable import count, shown
from mocapidx.store.read import open_store
from mocapidx.tasks.document_names import DocumentNames
from mocapidx.tasks.found import Found, read_found
from mocapidx.tasks.records import render_records
from mocapidx.tasks.safe_names import (
    check_place,
    check_targets,
    document_stem,
    has_content,
    those_there,
)
from mocapidx.transcripts.babel import babel_text
from mocapidx.transcripts.kinds import KINDS
from mocapidx.transcripts.spans import Span, Transcript

__all__ = ["TRANSCRIPTS", "export_transcripts", "transcribe"]

COLUMNS: Final = ("document", "label", "start_time", "end_time")
ROWS: Final = {"labels": "csv", "jsonl": "jsonl"}  # what is records, and how they are printed
TRANSCRIPTS: Final = (*KINDS, *ROWS)


def export_transcripts(
    records: str | Path,
    output: str | Path,
    to: str,
    *,
    stores: Sequence[str | Path] = (),
    force: bool = False,
) -> tuple[Path, ...]:
    """Write hits or annotations for another program.

    Parameters
    ----------
    records : str or Path
        Hits or annotations as `read_found` reads them; ``-`` is the standard input.
    output : str or Path
        A file with the suffix of the format for one document, else a folder that gets a file
        for each. BABEL's JSON, labels as CSV and JSON lines are one file for all documents.
    to : {"eaf", "textgrid", "vtt", "srt", "babel", "labels", "jsonl"}
    stores : sequence of str or Path
        Tell how long documents last.
    force : bool
        Replace files that are there.

    Returns
    -------
    tuple of Path
        The files; those that were there already, byte for byte, were passed over.

    Raises
    ------
    FormatError, ParameterError, StoreError, WriteError
    """
    output = Path(output)
    check_place(output)
    written = transcribe(records, to, stores)
    kind = KINDS.get(to)
    if kind is None or kind.write is None or _is_file(output, kind.suffix):
        nothing = {} if kind is None or kind.write is None else {"": kind.write(Transcript("", ()))}
        files = {output: _only(written or nothing, output)}
    else:
        make_folder(output)
        files = {
            output / f"{document_stem(document)}{kind.suffix}": data
            for document, data in written.items()
        }
    there = those_there(files)
    same = {path for path in there if not force and has_content(path, files[path])}
    check_targets((path for path in there if path not in same), force)
    for path, data in files.items():
        if path not in same:
            durable_replace(path, data)
    return tuple(files)


def transcribe(records: str | Path, to: str, stores: Sequence[str | Path] = ()) -> dict[str, bytes]:
    """Turn hits or annotations into files of another program.

    Parameters
    ----------
    records, to, stores
        As `export_transcripts` takes them.

    Returns
    -------
    dict of str to bytes
        The content by document; one that holds them all is that of the document "".

    Raises
    ------
    FormatError, ParameterError, StoreError
    """
    if to not in TRANSCRIPTS:
        raise ParameterError(f"no format '{shown(to)}'; there are {', '.join(TRANSCRIPTS)}")
    seconds = _seconds([Path(store) for store in stores])
    known = DocumentNames(seconds)
    by_document: dict[str, list[Found]] = {}
    for found in read_found(Path(records)):
        name = known.find(found.document, shown(records)) or found.document
        by_document.setdefault(name, []).append(found)
    transcripts = [
        Transcript(
            document,
            tuple(Span(each.start, each.end, each.label, each.cost) for each in own),
            seconds.get(document),
        )
        for document, own in sorted(by_document.items())
    ]
    if to in ROWS:
        return {"": _rows(transcripts, ROWS[to])}
    write = KINDS[to].write
    if write is None:
        return {"": babel_text(transcripts)}
    return {each.document: write(each) for each in transcripts}


def _rows(transcripts: Sequence[Transcript], row_format: str) -> bytes:
    records = [
        {
            "document": each.document,
            "label": span.label,
            "start_time": span.start,
            "end_time": span.end,
        }
        | ({"cost": span.cost} if row_format == "jsonl" else {})
        for each in transcripts
        for span in each.by_time
    ]
    lines = render_records(records, row_format, COLUMNS)
    return "".join(f"{line}\n" for line in lines).encode("utf-8")


def _seconds(stores: Sequence[Path]) -> dict[str, float]:
    """Return how long each document of some stores lasts."""
    seconds: dict[str, float] = {}
    for path in stores:
        with open_store(path) as store:
            rate = store.manifest.settings.rate
            for placed in store.documents():
                name = placed.document.name
                if name in seconds:
                    raise ParameterError(
                        f"two stores hold a document '{shown(name)}'; give the one that the "
                        "records were made from"
                    )
                seconds[name] = placed.document.frames / rate
    return seconds


def _is_file(output: Path, suffix: str) -> bool:
    return output.suffix.lower() == suffix.lower() and not output.is_dir()


def _only(written: Mapping[str, bytes], output: Path) -> bytes:
    if len(written) != 1:
        documents = count(len(written), "document")
        raise ParameterError(
            f"{shown(output, None)}: the records speak of {documents}, the file holds one; give "
            "a folder"
        )
    return next(iter(written.values()))
