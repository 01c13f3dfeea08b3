"""Take hits along: each as a motion file of its own, below one folder, with where it is from."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from mocapidx.durable import durable_replace, make_folder
from mocapidx.errors import FormatError, Interrupted, ParameterError, WriteError
from mocapidx.printable import count, shown
from mocapidx.tasks.clips import Clip, ClipFormat, ClipSource, open_source
from mocapidx.tasks.found import Found, read_found
from mocapidx.tasks.origins import Origin, find_origins
from mocapidx.tasks.prepare import Refused
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.records import Record
from mocapidx.tasks.safe_names import (
    check_place,
    check_targets,
    document_stem,
    has_content,
    slug,
    those_there,
)

__all__ = ["SIDECAR", "ExportOptions", "Exported", "export_clips"]

SIDECAR: Final = "clips.jsonl"
LONGEST_HANDLE: Final = 3600.0  # seconds
SUFFIXES: Final = (".amc", ".asf", ".bvh", ".c3d", ".npz", ".csv")


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """How clips are cut.

    Parameters
    ----------
    to : {"source", "bvh", "npz", "csv"}
        Their format; ``source``: that of the file, where stretches can be cut out of it.
    handles : float
        Seconds of motion kept before and after each hit, as far as there are any.
    top : int, optional
        Only the best so many.
    force : bool
        Replace files that are there.
    skip_bad : bool
        Go on after a document whose file can't be used.
    stores, roots : tuple of Path
        Where the documents are known, and folders below which their files lie.
    read : ReadOptions
        How motion files are understood; comes before what a store knows.

    Raises
    ------
    ParameterError
        If the handles are negative or longer than an hour.
    """

    to: ClipFormat = "source"
    handles: float = 0.0
    top: int | None = None
    force: bool = False
    skip_bad: bool = False
    stores: tuple[Path, ...] = ()
    roots: tuple[Path, ...] = ()
    read: ReadOptions = field(default_factory=ReadOptions)

    def __post_init__(self) -> None:
        if not 0 <= self.handles <= LONGEST_HANDLE:
            raise ParameterError(f"handles must be 0 to 3600 seconds, got {self.handles:g}")


@dataclass(frozen=True, slots=True)
class Exported:
    """What is in the folder.

    Parameters
    ----------
    clips : tuple of mapping
        A record for each clip, as the sidecar has them.
    refused : tuple of Refused
        Documents whose files can't be used.
    there : int
        Clips that were there already, byte for byte, and were passed over.
    """

    clips: tuple[Record, ...]
    refused: tuple[Refused, ...]
    there: int = 0


def export_clips(
    records: str | Path,
    folder: str | Path,
    options: ExportOptions | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Exported:
    """Cut the stretches that records tell of out of their motion files.

    What a run that was stopped has written is compared with what would be written, and passed
    over where it is the same. Nothing is written before all that is there has been compared.

    Parameters
    ----------
    records : str or Path
        Hits or annotations as `query`, `retrieve` and `annotate` print them, or a file of
        annotations of another program; ``-`` is the standard input.
    folder : str or Path
        Where the clips go, made if need be. Their names begin with the number of the hit; the
        file ``clips.jsonl`` tells where each is from.
    options : ExportOptions, optional
    progress : callable, optional
        Called with the number of clips done and of all.

    Returns
    -------
    Exported

    Raises
    ------
    FormatError
        If the records or, unless ``skip_bad`` is on, a motion file can't be used.
    ParameterError
        If something is in the way in the folder.
    StoreError, WriteError
    """
    options = options or ExportOptions()
    folder = Path(folder)
    check_place(folder)
    if options.force and os.path.realpath(records) == os.path.realpath(folder / SIDECAR):
        raise ParameterError(
            f"{shown(records)}: is read and would be replaced; give another folder"
        )
    hits = _numbered(read_found(Path(records)), options.top)
    origins = find_origins(
        (hit.document for _, hit in hits), options.stores, options.roots, options.read
    )
    make_folder(folder)
    run = _Run(hits, _stems(hits), origins, folder, options)
    show = progress or (lambda done, total: None)
    try:
        _pass_over(run, show)
        _write(run, show)
        _put(folder / SIDECAR, _lines(run.done), options.force)
    except WriteError as exc:
        if not run.done:
            raise
        message = f"{exc}; {count(len(run.done), 'clip')} written; run again to continue"
        raise WriteError(message) from exc
    except Interrupted as exc:
        message = f"stopped after {count(len(run.done), 'clip')}; run again to continue"
        raise Interrupted(exc.signal_number, message) from exc
    clips = tuple(run.done[i] for i in sorted(run.done))
    return Exported(clips, tuple(run.refused.values()), run.there)


@dataclass(slots=True)
class _Run:
    """Clips to be written, and how far it has come; `done` has records by the place of a hit."""

    hits: Sequence[tuple[int, Found]]
    stems: Sequence[str]
    origins: Mapping[str, Origin | FormatError]
    folder: Path
    options: ExportOptions
    done: dict[int, Record] = field(default_factory=dict)
    there: int = 0
    refused: dict[str, Refused] = field(default_factory=dict)

    def by_document(self) -> dict[str, list[int]]:
        """Group the hits that are not done, so that each file is read once."""
        found: dict[str, list[int]] = {}
        for i, (_, hit) in enumerate(self.hits):
            if i not in self.done:
                found.setdefault(hit.document, []).append(i)
        return found


def _pass_over(run: _Run, progress: Callable[[int, int], None]) -> None:
    """Compare what is there with what would be written, and refuse what differs.

    Only documents of clips that are there are read for it. Where the sidecar is there, a run has
    come to its end: then all are, as each clip has its line there.
    """
    sidecar = those_there([run.folder / SIDECAR])
    taken = {
        i: paths
        for i, stem in enumerate(run.stems)
        if (paths := those_there(run.folder / f"{stem}{suffix}" for suffix in SUFFIXES))
    }
    if run.options.force:
        return
    known = set(sidecar[0].read_bytes().splitlines(keepends=True)) if sidecar else set()
    records: dict[int, Record] = {}

    def compare(i: int, clip: Clip, record: Record) -> None:
        if sidecar and _lines({i: record}) not in known:
            check_targets(sidecar, force=False)
        records[i] = record
        _check_same(run, i, clip, record, taken.get(i, ()))

    for document, every in run.by_document().items():
        own = [i for i in every if sidecar or i in taken]
        if not own:
            continue
        _cut_document(run, document, own, compare)
        # What can't be made again can't be told from what is somebody else's.
        check_targets((p for i in own if i not in records for p in taken.get(i, ())), force=False)
        progress(run.there, len(run.hits))
    if sidecar and not has_content(sidecar[0], _lines(records)):
        check_targets(sidecar, force=False)


def _check_same(run: _Run, i: int, clip: Clip, record: Record, taken: Sequence[Path]) -> None:
    """Take a clip for done if all its files are there as they would be written."""
    data = {run.folder / f"{run.stems[i]}{suffix}": data for suffix, data in clip.files}
    differing = [path for path in taken if path not in data or not has_content(path, data[path])]
    check_targets(differing, force=False)
    if len(taken) == len(data):
        run.done[i] = record
        run.there += 1


def _write(run: _Run, progress: Callable[[int, int], None]) -> None:
    """Write what is not there yet."""

    def put(i: int, clip: Clip, record: Record) -> None:
        for suffix, data in clip.files:
            _put(run.folder / f"{run.stems[i]}{suffix}", data, run.options.force)
        run.done[i] = record

    settled = run.there
    for document, own in run.by_document().items():
        _cut_document(run, document, own, put)
        settled += len(own)
        progress(settled, len(run.hits))


def _cut_document(
    run: _Run, document: str, own: Sequence[int], use: Callable[[int, Clip, Record], None]
) -> None:
    """Cut clips out of one document and use each, so that no more than one is held.

    A document that can't be used is passed over where that is wanted.
    """
    try:
        origin = run.origins[document]
        if isinstance(origin, FormatError):
            raise origin
        source = open_source(origin, run.options.to)
        for i in own:
            use(i, *_cut(source, run.hits[i], run.stems[i], run.options))
    except FormatError as exc:
        if not run.options.skip_bad:
            raise FormatError(f"{exc} (--skip-bad passes over such documents)") from exc
        run.refused[document] = Refused(document, str(exc))


def _put(path: Path, data: bytes, force: bool) -> None:
    if force or not has_content(path, data):
        check_targets([path], force)
        durable_replace(path, data)


def _lines(records: Mapping[int, Record]) -> bytes:
    """Write records as the sidecar has them."""
    lines = (json.dumps(records[i], ensure_ascii=True) for i in sorted(records))
    return "".join(f"{line}\n" for line in lines).encode("ascii")


def _numbered(found: Sequence[Found], top: int | None) -> list[tuple[int, Found]]:
    """Sort hits by rank; where ranks are missing or stand twice, number them in their order."""
    ranks = [hit.rank for hit in found if hit.rank is not None]
    by_rank = len(ranks) == len(found) and len(set(ranks)) == len(ranks)
    numbers = ranks if by_rank else list(range(1, len(found) + 1))
    hits = sorted(zip(numbers, found, strict=True), key=lambda pair: pair[0])
    return hits if top is None else hits[:top]


def _stems(hits: Sequence[tuple[int, Found]]) -> list[str]:
    """Name clips so that they sort by number and can't be told to lie anywhere else."""
    width = max(4, len(str(max((number for number, _ in hits), default=0))))
    return [
        f"{number:0{width}d}_{slug(hit.label) or 'clip'}_{document_stem(hit.document)}"
        for number, hit in hits
    ]


def _cut(
    source: ClipSource, hit: tuple[int, Found], stem: str, options: ExportOptions
) -> tuple[Clip, Record]:
    """Cut one clip, and say where it is from."""
    number, found = hit
    reading = source.reading
    rate, first, last = reading.motion.rate, reading.source_start, reading.source_frames
    start, end = found.source_frames or (
        first + round(found.start * rate),
        first + max(round(found.end * rate), round(found.start * rate) + 1),
    )
    if not first <= start < last:
        raise FormatError(
            f"{shown(source.origin.path, None)}: has {last} frames, the record of "
            f"'{shown(found.label)}' begins at frame {start}"
        )
    end = min(end, last)
    handle = round(options.handles * rate)
    clip_start, clip_end = max(first, start - handle), min(last, end + handle)
    clip = source.cut(clip_start, clip_end)
    return clip, {
        "rank": number,
        "document": found.document,
        "file": f"{stem}{clip.files[0][0]}",
        "label": found.label,
        "cost": round(found.cost, 9),
        "start_time": round(found.start, 6),
        "end_time": round(found.end, 6),
        "source_start_frame": start,
        "source_end_frame": end,
        "clip_start_frame": clip_start,
        "clip_end_frame": clip_end,
        "handle_before": round((start - clip_start) / rate, 6),
        "handle_after": round((clip_end - end) / rate, 6),
        "rate": rate,
        "unit": clip.unit,
        "up": clip.up,
        "root_positions": clip.root_positions,
        "holds": clip.holds,
        "source": str(source.origin.path.absolute()),
    }
