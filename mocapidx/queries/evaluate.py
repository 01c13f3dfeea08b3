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
from mocapidx.queries.mismatch import mismatch_hits
from mocapidx.queries.pattern import (
    Block,
    Finder,
    Pattern,
    pattern_from_query,
    pattern_hits,
    restrict_pattern,
)
from mocapidx.queries.source import Source
from mocapidx.queries.steps import FuzzyQuery

__all__ = ["MODES", "DocumentGroup", "GroupHits", "evaluate", "finder", "in_documents"]

FINDERS: Final[dict[str, Callable[[FuzzyQuery, Source], IndexArray]]] = {
    "exact": exact_hits,
    "fuzzy": fuzzy_hits,
    "adaptive": adaptive_hits,
}
MODES: Final = (*FINDERS, "mismatch")


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
    pattern : Pattern or None
        What was looked for in them: the query without what is untrusted there, steps that can
        no longer be told apart joined. None if nothing was left, so that there are no hits.
    documents : ndarray of int64, shape (H,)
        Number of the document of each hit.
    bounds : ndarray of int64, shape (H, S + B)
        For each block of `pattern`, where its steps start and where the last one ends, in
        frames of the document.
    """

    group: DocumentGroup
    pattern: Pattern | None
    documents: IndexArray
    bounds: IndexArray


def evaluate(
    query: FuzzyQuery | Pattern,
    mode: str,
    source: Source,
    groups: Sequence[DocumentGroup],
    mismatches: int = 0,
) -> list[GroupHits]:
    """Answer a query over the documents of one segment file.

    Parameters
    ----------
    query : FuzzyQuery or Pattern
        Over any of the features; a FuzzyQuery is a pattern of one block.
    mode : str
        One of `MODES`: how a block is found.
    source : Source
        The segment file.
    groups : sequence of DocumentGroup
        The documents that count; no document is in two groups.
    mismatches : int
        Steps that may disagree in the mode ``mismatch``, of patterns of one block.

    Returns
    -------
    list of GroupHits
        One for each group, in their order; hits ascending by document and start.

    Raises
    ------
    ParameterError
        If there is no such mode, a block demands nothing, or the query isn't one for this mode.
    StoreError
        If the lists are damaged.
    """
    pattern = pattern_from_query(query) if isinstance(query, FuzzyQuery) else query
    asked = restrict_pattern(pattern, pattern.mask)
    if asked is None:
        raise ParameterError("no feature is selected, so every motion would match")
    find = finder(mode, asked, mismatches)
    found: dict[int, IndexArray] = {}
    answers = []
    for group in groups:
        mask = pattern.mask & ~group.untrusted
        trusted = restrict_pattern(pattern, mask)
        if trusted is None:
            answers.append(
                GroupHits(group, None, np.zeros(0, np.int64), np.zeros((0, 1), np.int64))
            )
            continue
        if mask not in found:
            found[mask] = pattern_hits(trusted, source, find)
        bounds = in_documents(found[mask], source, group.documents)
        documents = source.document_at(bounds[:, 0])
        bounds = bounds - source.first[documents, np.newaxis]
        answers.append(GroupHits(group, trusted, documents, bounds))
    return answers


def finder(mode: str, pattern: Pattern, mismatches: int = 0) -> Finder:
    """Give the way in which the blocks of a pattern are found.

    Parameters
    ----------
    mode : str
        One of `MODES`.
    pattern : Pattern
        What will be asked for.
    mismatches : int
        Steps that may disagree in the mode ``mismatch``; where documents can't tell all
        steps apart, at least one step is left to agree.

    Returns
    -------
    Finder

    Raises
    ------
    ParameterError
        If there is no such mode, or it is not one for the pattern.
    """
    if mode not in MODES:
        raise ParameterError(f"no query mode '{mode}': take one of {', '.join(MODES)}")
    if mode != "mismatch":
        return lambda block, source: FINDERS[mode](block.query, source)
    count = len(pattern.steps)
    if len(pattern.blocks) > 1:
        raise ParameterError("the mode mismatch knows no open steps; leave them out")
    if not 0 <= mismatches < count:
        raise ParameterError(
            f"{mismatches} mismatches of {count} steps; at least one step must agree"
        )

    def find(block: Block, source: Source) -> IndexArray:
        most = min(mismatches, len(block.query.steps) - 1)
        return mismatch_hits(block.query, source, most, block.may_fail)

    return find


def in_documents(bounds: IndexArray, source: Source, wanted: IndexArray) -> IndexArray:
    """Keep the hits in some documents.

    Parameters
    ----------
    bounds : ndarray of int64, shape (H, N)
        In positions; the first column decides.
    source : Source
        The segment file.
    wanted : ndarray of int64, shape (D,)
        Numbers of the documents.

    Returns
    -------
    ndarray of int64, shape (M, N)
    """
    counts = np.zeros(len(source.first), np.bool_)
    counts[wanted] = True
    kept: IndexArray = bounds[counts[source.document_at(bounds[:, 0])]]
    return kept
