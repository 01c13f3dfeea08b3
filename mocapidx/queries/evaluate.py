"""A query over the documents of a segment file, each asked only what it can be trusted in."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import IndexArray
from mocapidx.queries.adaptive import adaptive_hits
from mocapidx.queries.exact import exact_hits
from mocapidx.queries.fuzzy import fuzzy_hits
from mocapidx.queries.source import Source
from mocapidx.queries.steps import FuzzyQuery, restrict

__all__ = ["MODES", "DocumentGroup", "GroupHits", "evaluate"]

MODES: Final[dict[str, Callable[[FuzzyQuery, Source], IndexArray]]] = {
    "exact": exact_hits,
    "fuzzy": fuzzy_hits,
    "adaptive": adaptive_hits,
}


@dataclass(frozen=True, slots=True)
class DocumentGroup:
    """Documents of a segment file that are untrusted in the same features.

    Parameters
    ----------
    untrusted : int
        These features; their bits are 0 in the words of the documents.
    documents : ndarray of int64, shape (N,)
        Numbers of the documents in the segment file; leave out what is deleted.
    """

    untrusted: int
    documents: IndexArray


@dataclass(frozen=True, slots=True)
class GroupHits:
    """The hits in one group of documents.

    Parameters
    ----------
    group : DocumentGroup
        The documents.
    query : FuzzyQuery or None
        What was looked for in them: the query without what is untrusted there, steps that can
        no longer be told apart joined. None if nothing was left, so that there are no hits.
    documents : ndarray of int64, shape (H,)
        Number of the document of each hit.
    bounds : ndarray of int64, shape (H, L + 1)
        Where each step of `query` starts, and where the last one ends, in frames of the
        document.
    """

    group: DocumentGroup
    query: FuzzyQuery | None
    documents: IndexArray
    bounds: IndexArray


def evaluate(
    query: FuzzyQuery, mode: str, source: Source, groups: Sequence[DocumentGroup]
) -> list[GroupHits]:
    """Answer a query over the documents of one segment file.

    Parameters
    ----------
    query : FuzzyQuery
        Over any of the features.
    mode : str
        A key of `MODES`.
    source : Source
        The segment file.
    groups : sequence of DocumentGroup
        The documents that count; no document is in two groups.

    Returns
    -------
    list of GroupHits
        One for each group, in their order; hits ascending by document and start.

    Raises
    ------
    ParameterError
        If there is no such mode, the query demands nothing, or it isn't one for this mode.
    StoreError
        If the lists are damaged.
    """
    if mode not in MODES:
        raise ParameterError(f"no query mode '{mode}': take one of {', '.join(MODES)}")
    asked = restrict(query, query.mask)
    if asked.steps[0].is_open:
        raise ParameterError("no feature is selected, so every motion would match")
    found: dict[int, IndexArray] = {}
    answers = []
    for group in groups:
        mask = query.mask & ~group.untrusted
        trusted = restrict(query, mask)
        if trusted.steps[0].is_open:
            answers.append(
                GroupHits(group, None, np.zeros(0, np.int64), np.zeros((0, 1), np.int64))
            )
            continue
        if mask not in found:
            found[mask] = MODES[mode](trusted, source)
        documents, bounds = _within(found[mask], source, group.documents)
        answers.append(GroupHits(group, trusted, documents, bounds))
    return answers


def _within(
    bounds: IndexArray, source: Source, wanted: IndexArray
) -> tuple[IndexArray, IndexArray]:
    """Keep the hits in some documents and count their frames from the document's first."""
    documents = source.document_at(bounds[:, 0])
    counts = np.zeros(len(source.first), np.bool_)
    counts[wanted] = True
    kept = counts[documents]
    documents = documents[kept]
    return documents, bounds[kept] - source.first[documents, np.newaxis]
