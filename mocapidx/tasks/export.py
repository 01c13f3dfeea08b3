"""Take hits along: each as a motion file of its own, below one folder, with where it is from."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from mocapidx.durable import durable_replace, make_folder
from mocapidx.errors import FormatError, Interrupted, ParameterError, WriteError
from mocapidx.printable import count, shown
from mocapidx.tasks.clips import ClipFormat, ClipSource, open_source
from mocapidx.tasks.found import Found, read_found
from mocapidx.tasks.origins import Origin, find_origins
from mocapidx.tasks.prepare import Refused
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.records import Record
from mocapidx.tasks.safe_names import check_place, check_targets, document_stem, slug

__all__ = ["SIDECAR", "ExportOptions", "Exported", "export_clips"]

SIDECAR: Final = "clips.jsonl"
LONGEST_HANDLE: Final = 3600.0  # seconds


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
    """What was written.

    Parameters
    ----------
    clips : tuple of mapping
        A record for each clip, as the sidecar has them.
    refused : tuple of Refused
        Documents whose files can't be used.
    """

    clips: tuple[Record, ...]
    refused: tuple[Refused, ...]


def export_clips(
    records: str | Path,
    folder: str | Path,
    options: ExportOptions | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Exported:
    """Cut the stretches that records tell of out of their motion files.

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
        Called with the number of clips written and of all.

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
    hits = _numbered(read_found(Path(records)), options.top)
    origins = find_origins(
        (hit.document for _, hit in hits), options.stores, options.roots, options.read
    )
    make_folder(folder)
    check_targets([folder / SIDECAR], options.force)
    stems = _stems(hits)
    _check_free(folder, stems, options.force)
    by_document: dict[str, list[int]] = {}
    for i, (_, hit) in enumerate(hits):
        by_document.setdefault(hit.document, []).append(i)
    written: dict[int, Record] = {}
    refused: list[Refused] = []
    done = 0
    try:
        for document, own in by_document.items():
            try:
                source = _opened(origins[document], options)
                for i in own:
                    written[i] = _write(source, hits[i], folder, stems[i], options)
            except FormatError as exc:
                if not options.skip_bad:
                    raise FormatError(f"{exc} (--skip-bad passes over such documents)") from exc
                refused.append(Refused(document, str(exc)))
            done += len(own)
            if progress is not None:
                progress(done, len(hits))
    except WriteError as exc:
        if not written:
            raise
        message = f"{exc}; {count(len(written), 'clip')} written; run again with --force"
        raise WriteError(message) from exc
    except Interrupted as exc:
        message = f"stopped after {count(len(written), 'clip')}; run again with --force"
        raise Interrupted(exc.signal_number, message) from exc
    clips = tuple(written[i] for i in sorted(written))
    lines = "".join(f"{json.dumps(clip, ensure_ascii=True)}\n" for clip in clips)
    durable_replace(folder / SIDECAR, lines.encode("ascii"))
    return Exported(clips, tuple(refused))


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


def _check_free(folder: Path, stems: Sequence[str], force: bool) -> None:
    suffixes = (".amc", ".asf", ".bvh", ".c3d", ".npz", ".csv")
    check_targets((folder / f"{stem}{suffix}" for stem in stems for suffix in suffixes), force)


def _opened(origin: Origin | FormatError, options: ExportOptions) -> ClipSource:
    if isinstance(origin, FormatError):
        raise origin
    return open_source(origin, options.to)


def _write(
    source: ClipSource, hit: tuple[int, Found], folder: Path, stem: str, options: ExportOptions
) -> Record:
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
    files = [f"{stem}{suffix}" for suffix, _ in clip.files]
    for name, (_, data) in zip(files, clip.files, strict=True):
        durable_replace(folder / name, data)
    return {
        "rank": number,
        "document": found.document,
        "file": files[0],
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
