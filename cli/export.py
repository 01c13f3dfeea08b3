"""The command `export`."""

from pathlib import Path
from typing import Any

import click

from mocapidx.printable import count

from .options import NumberRange, quiet_option, read_options, reading_options
from .progress import Bar
from .rows import note, warn

__all__ = ["export"]

SKIPPED = 5  # exit code: done, but some documents were passed over
CLIPS = ("source", "bvh", "npz", "csv")
TRANSCRIPTS = ("eaf", "textgrid", "vtt", "srt", "babel", "labels", "jsonl")


@click.command()
@click.argument("records", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "--output",
    type=click.Path(path_type=Path, allow_dash=True),
    required=True,
    metavar="FOLDER|FILE",
    help="Folder for the clips, or for a file for each document; made if need be. A file (or - for "
    "stdout) for one document, and for babel, labels and jsonl.",
)
@click.option(
    "--to",
    type=click.Choice(CLIPS + TRANSCRIPTS),
    default="source",
    show_default=True,
    help="Clips: stretches of AMC, BVH and C3D as they are (others as npz), any motion as bvh, or "
    "positions of the 24 joints in metres as npz or csv. When is what: ELAN, Praat, WebVTT, SRT, "
    "BABEL's JSON, a labels file (CSV), JSON lines.",
)
@click.option(
    "--store",
    "stores",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="STORE",
    help="Knows where the documents lie; may be repeated.",
)
@click.option(
    "--root",
    "roots",
    multiple=True,
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Documents lie below this folder; may be repeated.  [default: where STORE saw them, else "
    "the current folder]",
)
@click.option(
    "--handles",
    type=NumberRange(min=0, max=3600),
    default=0.0,
    show_default=True,
    metavar="SECONDS",
    help="Motion before and after each hit, as far as there is any.",
)
@click.option(
    "--top", type=click.IntRange(min=1), metavar="N", help="Only the best N.  [default: all]"
)
@click.option("--force", is_flag=True, help="Replace files that are there and differ.")
@click.option(
    "--skip-bad",
    is_flag=True,
    help="Pass over documents whose files can't be used; the exit code is then 5.",
)
@reading_options
@quiet_option
def export(
    records: Path,
    output: Path,
    to: Any,
    stores: tuple[Path, ...],
    roots: tuple[Path, ...],
    handles: float,
    top: int | None,
    force: bool,
    skip_bad: bool,
    quiet: bool,
    **reading: Any,
) -> int:
    """Take hits or annotations along: as clips, or as annotations of other programs.

    RECORDS are those of query, retrieve or annotate, as JSON lines or CSV, or a file of one of
    those programs. Names of clips begin with the rank; clips.jsonl says where each is from.
    When it was stopped, run it again: what is there just as it would be written is kept.

    \b
    Example:
      mocapidx retrieve takes.store --templates t.h5 --class kick --format jsonl |
        mocapidx export - --store takes.store --output kicks --handles 0.5 --top 20
      mocapidx export annotations.jsonl --to eaf --output annotations
    """
    if to in TRANSCRIPTS:
        write_transcripts(records, output, to, stores, force, quiet)
        return 0
    if str(output) == "-":
        raise click.UsageError("Clips need a folder: --output FOLDER.")
    from mocapidx.tasks.export import ExportOptions, export_clips

    options = ExportOptions(
        to=to,
        handles=handles,
        top=top,
        force=force,
        skip_bad=skip_bad,
        stores=stores,
        roots=roots,
        read=read_options(reading),
    )
    with Bar("clip", quiet) as bar:
        exported = export_clips(records, output, options, progress=bar.show)
    for refused in exported.refused:
        warn(refused.message)
    there = f"; {exported.there} {'was' if exported.there == 1 else 'were'} there already"
    clips = f"{count(len(exported.clips), 'clip')} in {output}"
    note(f"{clips}{there if exported.there else ''}", quiet)
    return SKIPPED if exported.refused else 0


def write_transcripts(
    records: Path, output: Path, to: str, stores: tuple[Path, ...], force: bool, quiet: bool
) -> None:
    """Write annotation files, or print the only one."""
    from mocapidx.tasks.transcribe import export_transcripts, transcribe

    if str(output) == "-":
        written = transcribe(records, to, stores)
        if len(written) > 1:
            raise click.UsageError("The records speak of several documents: --output FOLDER.")
        for data in written.values():
            click.echo(data, nl=False)
        return
    files = export_transcripts(records, output, to, stores=stores, force=force)
    note(f"{count(len(files), 'file')} in {output}", quiet)
