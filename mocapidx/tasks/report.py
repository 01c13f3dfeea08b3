"""Write hits or annotations as a page to look at: one HTML file in which they move."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from mocapidx.errors import FormatError, ParameterError
from mocapidx.printable import count, shown
from mocapidx.reports.page.content import PageContent, PageFeature
from mocapidx.reports.page.html import page_html
from mocapidx.store.manifest import Placed
from mocapidx.store.read import open_store
from mocapidx.tasks.found import Found, read_found
from mocapidx.tasks.read import ReadOptions
from mocapidx.tasks.report_content import Placing, page_documents, page_hits
from mocapidx.tasks.report_plan import Plan, plan_pieces
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.tasks.store_words import check_store
from mocapidx.tasks.stretch import stretch_of_store
from mocapidx.templates.file import load_templates
from mocapidx.templates.template import TemplateSet

__all__ = ["Report", "ReportOptions", "make_report"]

SMALLEST: Final = 1.0
"""Megabytes; the library that draws has more than half of it."""


@dataclass(frozen=True, slots=True)
class ReportOptions:
    """What a report shows.

    Parameters
    ----------
    example : str, optional
        The query: ``FILE[@START:END]``, or in place of FILE a document of the store. None:
        hits are shown beside the best of their class.
    templates : str, Path or TemplateSet, optional
        Their distance functions are drawn, with the thresholds.
    top : int, optional
        Only so many hits, the best.
    max_size : float
        Of the page, in megabytes.
    title : str, optional
        Default: the name of the store.
    read : ReadOptions
        How the example's file is understood.
    """

    example: str | None = None
    templates: str | Path | TemplateSet | None = None
    top: int | None = None
    max_size: float = 32.0
    title: str | None = None
    read: ReadOptions = field(default_factory=ReadOptions)


@dataclass(frozen=True, slots=True)
class Report:
    """A page, and what is on it.

    Parameters
    ----------
    html : str
        The file.
    hits, documents : int
        How many are on it.
    noun : {"hit", "annotation"}
        What the hits are.
    remarks : tuple of str
        What was left out, a sentence each; the page says it, too.
    """

    html: str
    hits: int
    documents: int
    noun: str
    remarks: tuple[str, ...]


def make_report(
    store: str | Path,
    records: str | Path,
    options: ReportOptions | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Make the page of hits or annotations; the sources of the store are not needed.

    Parameters
    ----------
    store : str or Path
        With poses.
    records : str or Path
        JSON lines or CSV that `query`, `retrieve` or `annotate` printed; ``-`` is the standard
        input.
    options : ReportOptions, optional
    progress : callable, optional
        Told how many hits are in step with what they are compared with, and how many there are.

    Returns
    -------
    Report
        Equal input gives equal bytes.

    Raises
    ------
    FormatError
        If the records can't be read, or are of another store.
    ParameterError
        If the store keeps no poses.
    StoreError
    """
    store, records, options = Path(store), Path(records), options or ReportOptions()
    if not options.max_size >= SMALLEST:
        raise ParameterError(f"a page has at least {SMALLEST:g} MB, got {options.max_size:g}")
    with open_store(store) as snapshot:
        settings = snapshot.manifest.settings
        if not settings.poses:
            raise ParameterError(
                f"{shown(store)}: keeps no poses, so there is nothing to look at; index the "
                "files into a new store without --no-poses"
            )
        feature_set = store_feature_set(snapshot)
        templates = options.templates
        if isinstance(templates, (str, Path)):
            templates = load_templates(Path(templates))
        if templates is not None:
            check_store(snapshot, templates)
        query = None
        if options.example is not None:
            query = stretch_of_store(options.example, snapshot, feature_set, options.read)
        places = {placed.document.name: placed for placed in snapshot.documents()}
        found = read_found(records)
        placings = _best(_placed(found, places, settings.rate, records, store), options.top)
        plan, kept = _planned(placings, settings.rate, options.max_size)
        documents = page_documents(snapshot, kept, plan, templates)
        hits, references = page_hits(kept, documents, feature_set, settings.rate, query, progress)
        remarks = _remarks(plan, len(placings), len(found), settings.rate, options)
        noun = "hit" if not found or any(each.ranked for each in found) else "annotation"
        content = PageContent(
            title=options.title or f"{noun.capitalize()}s in {store.name or store.resolve().name}",
            rate=settings.rate,
            features=tuple(
                PageFeature(each.id, each.name, each.part) for each in feature_set.features
            ),
            documents=documents,
            hits=hits,
            references=references,
            remarks=remarks,
        )
    return Report(page_html(content), len(hits), len(documents), noun, remarks)


def _placed(
    found: Sequence[Found], places: Mapping[str, Placed], rate: float, records: Path, store: Path
) -> list[Placing]:
    """Put records on the frames of their documents."""
    where = "standard input" if str(records) == "-" else shown(records)
    missing = sorted({each.document for each in found} - {*places})
    if missing:
        others = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise FormatError(
            f"{where}: no document '{shown(missing[0])}'{others} in {shown(store)}; give the store "
            "that the records were made from, with the same names"
        )
    placings = []
    for each in found:
        placed = places[each.document]
        frames = placed.document.frames
        start, end = round(each.start * rate), round(each.end * rate)
        if start >= frames:
            raise FormatError(
                f"{where}: a record begins at {each.start:.2f} s of '{shown(each.document)}', "
                f"which lasts {frames / rate:.2f} s in {shown(store)}; give the store that the "
                "records were made from"
            )
        placings.append(Placing(each, placed, start, min(max(end, start + 1), frames)))
    return placings


def _by_cost(placings: Sequence[Placing]) -> list[int]:
    """Give the numbers of the records, the best first; equal costs in their own order."""
    return sorted(range(len(placings)), key=lambda number: placings[number].found.cost)


def _best(placings: Sequence[Placing], top: int | None) -> Sequence[Placing]:
    """Leave the best, in their own order."""
    return [placings[number] for number in sorted(_by_cost(placings)[:top])]


def _planned(
    placings: Sequence[Placing], rate: float, max_size: float
) -> tuple[Plan, Sequence[Placing]]:
    ordered = [placings[number] for number in _by_cost(placings)]
    wanted = [(each.placed.document.name, each.start, each.end) for each in ordered]
    frames = {each.placed.document.name: each.placed.document.frames for each in placings}
    plan = plan_pieces(wanted, frames, rate, round(max_size * 1e6))
    return plan, _best(placings, plan.hits)


def _remarks(
    plan: Plan, placings: int, found: int, rate: float, options: ReportOptions
) -> tuple[str, ...]:
    """Say what the page leaves out."""
    remarks = []
    if placings < found:
        remarks.append(f"Of {count(found, 'record')} the best {placings} are shown.")
    if plan.hits < placings:
        remarks.append(
            f"Of {count(placings, 'record')} the best {plan.hits} are shown: the page was to have "
            f"at most {options.max_size:g} MB."
        )
    if plan.step > 1:
        remarks.append(
            f"Poses are kept {rate / plan.step:g} times a second, half as often as the store has "
            "them, to keep the page small."
        )
    if not plan.whole and placings:
        remarks.append(
            "Of long takes only what is around the hits is kept, to keep the page small."
        )
    return tuple(remarks)
