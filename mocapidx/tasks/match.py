"""Find what is like a stretch of a document, by a match web of the store."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError, ParameterError
from mocapidx.graphs.match_graph import MatchGraph, MatchNode
from mocapidx.graphs.search import EPSILON, SearchRules, Stretch, search_once, search_web
from mocapidx.graphs.sweep import SweepStep, chosen_step, sweep_web
from mocapidx.model import Hit
from mocapidx.printable import count, shown
from mocapidx.store.manifest import Placed
from mocapidx.store.read import Snapshot, open_store
from mocapidx.tasks.example import parse_example, part_of
from mocapidx.tasks.hits import make_hit
from mocapidx.tasks.match_graphs import graph_kind, save_graph
from mocapidx.tasks.open_web import OpenWeb, open_web
from mocapidx.tasks.records import HIT_COLUMNS, Record, hit_record
from mocapidx.tasks.refine import refined

__all__ = [
    "MATCH_COLUMNS",
    "SWEEP_COLUMNS",
    "MatchOptions",
    "Matches",
    "match_records",
    "match_store",
    "sweep_records",
]

SHORTEST: Final = 0.25
"""Seconds of a query: the web holds no shorter chains."""

WIDEST: Final = 10.0
"""An epsilon beyond all distances, in metres."""

MATCH_COLUMNS: Final = (*HIT_COLUMNS, "tier", "direct", "edges")
SWEEP_COLUMNS: Final = ("epsilon", "matches", "tiers", "edges", "chosen", "plot")
PLOT_WIDTH: Final = 40


@dataclass(frozen=True, slots=True)
class MatchOptions:
    """How matches are searched.

    Parameters
    ----------
    epsilon : float or None
        Most that aligned frames may differ on average, in metres; None: the largest one of a
        sweep before the number of matches jumps.
    single_step : bool
        Only what is close to the query itself.
    most : int
        Matches after which no new ones are added.
    same_overlap, new_overlap, slack : float
        Shares, as in `mocapidx.graphs.search.SearchRules`.
    union, keep : bool
        Repairs, as there.
    sweep : bool
        Search with all epsilons of a sweep, whether one is given or not.
    """

    epsilon: float | None = None
    single_step: bool = False
    most: int = 400
    same_overlap: float = 0.8
    new_overlap: float = 0.2
    slack: float = 0.15
    union: bool = True
    keep: bool = True
    sweep: bool = False

    def rules(self) -> SearchRules:
        """Give the rules of a search."""
        return SearchRules(
            EPSILON if self.epsilon is None else self.epsilon,
            self.same_overlap,
            self.new_overlap,
            self.most,
            1 if self.single_step else None,
            self.slack,
            self.union,
            self.keep,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """What a search found.

    Parameters
    ----------
    graph : MatchGraph
        The query is node 0.
    hits : tuple of Hit
        The other nodes, in their order; the cost is the graph distance in metres.
    steps : tuple of SweepStep
        The searches of a sweep; empty where none was needed.
    remarks, warnings : tuple of str
        What a person should know.
    """

    graph: MatchGraph
    hits: tuple[Hit, ...]
    steps: tuple[SweepStep, ...] = ()
    remarks: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def match_store(
    store: str | Path,
    web: str | Path,
    query: str,
    options: MatchOptions | None = None,
    *,
    graph: Path | None = None,
) -> Matches:
    """Find the stretches of a store that are like one of them, directly or by intermediaries.

    Parameters
    ----------
    store : str or Path
    web : str or Path
        Of the store.
    query : str
        ``DOCUMENT@START:END``, in seconds; either may be left out.
    options : MatchOptions, optional
    graph : Path, optional
        Where the match graph is to go, with the query and the poses that a picture needs.

    Returns
    -------
    Matches
        By their graph distances.

    Raises
    ------
    StoreError
        If the store or the web is damaged, or the web is of another store.
    ParameterError
        If the query is shorter than 0.25 s or not in the web.
    FormatError
        If there is no such document.
    """
    options = options or MatchOptions()
    if graph is not None:
        graph_kind(graph)  # before any work is done
    with open_store(Path(store)) as snapshot:
        opened, missing = open_web(web, snapshot)
        stretch = _stretch(opened, snapshot, query)
        rules = options.rules()
        steps: tuple[SweepStep, ...] = ()
        if options.epsilon is None or options.sweep:
            steps = tuple(sweep_web(opened, stretch, rules, opened.rate))
        if options.epsilon is None:
            chosen = chosen_step(steps)
            found, full = chosen.graph, chosen.full
        else:
            found, full = search_web(opened, stretch, rules, opened.rate)
        warnings = _warnings(opened, stretch, found, full, options.most)
        found = refined(found, opened, snapshot)
        placed = {entry.document.name: entry for entry in snapshot.documents()}
        if graph is not None:
            save_graph(graph, found, snapshot)
        hits = tuple(
            _hit(placed[node.document], node, found.rate, stretch.document)
            for node in found.nodes[1:]
        )
    remarks = [f"epsilon {found.epsilon:g} m"] if options.epsilon is None else []
    if missing:
        remarks.append(f"{count(missing, 'document')} of the store not in the web: build it again")
    return Matches(found, hits, steps, tuple(remarks), warnings)


def _warnings(
    web: OpenWeb, query: Stretch, graph: MatchGraph, full: bool, most: int
) -> tuple[str, ...]:
    """Say what the list of matches itself does not."""
    if full:
        return (
            f"more than {most} matches: past the right epsilon a search finds anything; try a "
            "smaller --epsilon (--sweep shows where the number jumps)",
        )
    if len(graph.nodes) > 1:
        return ()
    nearest = search_once(web, query, SearchRules(epsilon=WIDEST))
    if nearest:
        return (f"no match below {graph.epsilon:g} m; the nearest costs {nearest[0].cost:.3f} m",)
    return (
        "no path of the web leads through the whole query, so nothing can be found for it; try a "
        "shorter part of it",
    )


def _stretch(web: OpenWeb, snapshot: Snapshot, query: str) -> Stretch:
    """Find the frames that a query names."""
    names = {entry.document.name for entry in snapshot.documents()}
    example = parse_example(query)
    name = query if query in names else str(example.path)
    if name not in names:
        raise FormatError(f"{shown(name)}: no document of {shown(snapshot.path)}")
    if not web.holds(name):
        raise ParameterError(
            f"{shown(name)}: not in the web {shown(web.where)}; 'mocapidx web build' adds it"
        )
    frames = web.frames(name)
    start, end = (0, frames) if query in names else part_of(example, frames, web.rate)
    if end - start < SHORTEST * web.rate:
        raise ParameterError(
            f"{shown(query)}: the query lasts {(end - start) / web.rate:.2f} s; a match web "
            f"answers from {SHORTEST} s on"
        )
    return Stretch(name, start, end)


def _hit(placed: Placed, node: MatchNode, rate: float, label: str) -> Hit:
    return make_hit(placed.document, node.start_frame, node.end_frame, rate, node.distance, label)


def match_records(matches: Matches) -> list[Record]:
    """Lay out matches as records.

    Parameters
    ----------
    matches : Matches

    Returns
    -------
    list of mapping
        As of hits, ``cost`` is the graph distance in metres; then ``tier``, ``direct`` (the
        distance to the query, None where it was reached by others only) and ``edges``.
    """
    degree = np.zeros(len(matches.graph.nodes), dtype=int)
    for edge in matches.graph.edges:
        degree[[edge.first, edge.second]] += 1
    return [
        {
            **hit_record(hit, rank),
            "tier": node.tier,
            "direct": None if node.direct is None else round(node.direct, 9),
            "edges": int(degree[rank]),
        }
        for rank, (hit, node) in enumerate(
            zip(matches.hits, matches.graph.nodes[1:], strict=True), start=1
        )
    ]


def sweep_records(steps: Sequence[SweepStep]) -> list[Record]:
    """Lay out a sweep as records, with a bar for people.

    Parameters
    ----------
    steps : sequence of SweepStep

    Returns
    -------
    list of mapping
        ``chosen`` marks what is taken where no epsilon is given.
    """
    chosen = chosen_step(steps)
    most = max([step.matches for step in steps] + [1])
    return [
        {
            "epsilon": step.epsilon,
            "matches": step.matches,
            "full": step.full,
            "tiers": max(node.tier for node in step.graph.nodes),
            "edges": len(step.graph.edges),
            "chosen": "<" if step is chosen else "",
            "plot": "#" * round(PLOT_WIDTH * step.matches / most) + ("+" if step.full else ""),
        }
        for step in steps
    ]
