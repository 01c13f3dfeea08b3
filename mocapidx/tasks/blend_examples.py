"""From hits to registered examples: movements of one body, read from the source files."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import FormatError
from mocapidx.graphs.graph_text import graph_from_json
from mocapidx.graphs.match_graph import MatchGraph, path_edges, shortest_paths
from mocapidx.model import FloatArray
from mocapidx.printable import shown
from mocapidx.synthesis.blending import Examples
from mocapidx.synthesis.bodies import Body, Movement, body_of, joint_points, movement_of
from mocapidx.synthesis.carrying import body_difference, carried
from mocapidx.synthesis.registration import RATE, Registration, Tie, register, star
from mocapidx.synthesis.spaces import Origin
from mocapidx.tasks.bounded import read_at_most
from mocapidx.tasks.found import read_found
from mocapidx.tasks.origins import find_origins
from mocapidx.tasks.read import ReadOptions, read_recorded

__all__ = ["ExampleOptions", "read_examples"]

SAME: Final = 0.5
"""A hit and a node of a match graph are one where so much of their union is common."""

FEWEST_POSES: Final = 4
MOST_EXAMPLES: Final = 500
LARGEST_GRAPH: Final = 256 << 20  # bytes


@dataclass(frozen=True, slots=True)
class ExampleOptions:
    """Where examples come from.

    Parameters
    ----------
    store : Path or None
        Knows the files of the documents.
    roots : tuple of Path
        Folders that the files may lie below.
    graph : Path or None
        A match graph (JSON) that the hits are nodes of.
    top : int or None
        Only the first hits.
    read : ReadOptions
        How motion files are understood, where the store does not know.
    """

    store: Path | None = None
    roots: tuple[Path, ...] = ()
    graph: Path | None = None
    top: int | None = None
    read: ReadOptions = field(default_factory=ReadOptions)


def read_examples(hits: Path, options: ExampleOptions) -> tuple[Examples, tuple[Origin, ...]]:
    """Read hits from their source files and register them with the first.

    Parameters
    ----------
    hits : Path
        JSON lines or CSV as `query`, `retrieve` and `match` print them; ``-`` is the standard
        input. With a match graph, its query comes first, whether it is a hit or not.
    options : ExampleOptions

    Returns
    -------
    examples : Examples
        All on the body of the first.
    origins : tuple of Origin

    Raises
    ------
    FormatError
        If there are too few hits, a source is gone or has changed, or skeletons differ.
    StoreError, ParameterError
    """
    found = read_found(hits)[: options.top]
    graph = None if options.graph is None else _read_graph(options.graph)
    wanted = list(dict.fromkeys(Origin(f.document, f.start, f.end) for f in found))
    frames = {Origin(f.document, f.start, f.end): f.source_frames for f in found}
    ties: list[Tie]
    if graph is None:
        stretches, examples, ties = wanted, list(range(len(wanted))), star(len(wanted))
    else:
        stretches, examples = _on_graph(wanted, graph)
        ties = _ties_on_ways(graph, examples)
    where = "standard input" if str(hits) == "-" else shown(hits, None)
    if len(examples) < 2:
        raise FormatError(
            f"{where}: {len(examples)} motion{'s' * (len(examples) != 1)} to blend, at least two "
            "are needed; search for more with a larger --epsilon, --tau or --top"
        )
    if len(examples) > MOST_EXAMPLES:
        raise FormatError(
            f"{where}: {len(examples)} motions to blend, at most {MOST_EXAMPLES}; take the first "
            "ones with --top"
        )
    needed = sorted({*examples, *(n for tie in ties for n in tie[:2])})
    place = {stretch: number for number, stretch in enumerate(needed)}
    body, movements = _read_movements([stretches[n] for n in needed], frames, place[examples[0]],
                                      options)  # fmt: skip
    registration = _registration(
        body,
        movements,
        [stretches[n] for n in needed],
        [(place[one], place[other], cost) for one, other, cost in ties],
        [place[n] for n in examples],
    )
    kept = Examples(body, tuple(movements[place[n]] for n in examples), registration)
    return kept, tuple(stretches[n] for n in examples)


def _read_graph(path: Path) -> MatchGraph:
    where = shown(path, None)
    try:
        if not path.is_file():
            raise FormatError(f"{where}: no such file; make one with 'mocapidx match --graph'")
        with path.open("rb") as file:
            data = read_at_most(file, LARGEST_GRAPH)
    except OSError as exc:
        raise FormatError(f"{where}: can't be read ({exc.strerror})") from exc
    if len(data) > LARGEST_GRAPH:
        raise FormatError(f"{where}: larger than {LARGEST_GRAPH >> 20} MiB")
    try:
        return graph_from_json(data.decode("utf-8", "surrogateescape"))
    except FormatError as exc:
        raise FormatError(f"{where}: {exc}") from exc


def _on_graph(wanted: Sequence[Origin], graph: MatchGraph) -> tuple[list[Origin], list[int]]:
    """Return the nodes as stretches, and which of them are examples, the query first."""
    nodes = [
        Origin(n.document, n.start_frame / graph.rate, n.end_frame / graph.rate)
        for n in graph.nodes
    ]
    stretches = list(nodes)
    examples = [0]
    for hit in wanted:
        shares = [_common(hit, node) for node in nodes]
        node = int(np.argmax(shares))
        if shares[node] < SAME:
            raise FormatError(
                f"{_name(hit)} is no node of the match graph; give the hits that were found with it"
            )
        stretches[node] = hit
        examples.append(node)
    return stretches, list(dict.fromkeys(examples))


def _ties_on_ways(graph: MatchGraph, examples: Sequence[int]) -> list[Tie]:
    """List the edges on the cheapest ways to the examples; no other motion need be read."""
    paths = shortest_paths(graph)
    edges = {id(e): e for node in examples for e in path_edges(graph, paths, node)}
    return [(e.first, e.second, e.cost) for e in edges.values()]


def _common(one: Origin, other: Origin) -> float:
    """Return what two stretches have in common, as a share of their union."""
    if one.document != other.document:
        return 0.0
    inner = min(one.end, other.end) - max(one.start, other.start)
    return max(inner, 0.0) / (max(one.end, other.end) - min(one.start, other.start))


def _name(origin: Origin) -> str:
    return f"{shown(origin.document)} at {origin.start:.2f} s"


def _read_movements(
    stretches: Sequence[Origin],
    frames: dict[Origin, tuple[int, int] | None],
    first: int,
    options: ExampleOptions,
) -> tuple[Body, list[Movement]]:
    """Read stretches from their files and carry them over to the body of one of them."""
    stores = () if options.store is None else (options.store,)
    names = dict.fromkeys(stretch.document for stretch in stretches)
    read: dict[Origin, tuple[Body, Movement]] = {}
    for document, origin in find_origins(names, stores, options.roots, options.read).items():
        if isinstance(origin, FormatError):
            raise origin
        reading, recording, mapping = read_recorded(origin.path, origin.options)
        conventions, rate = reading.conventions, reading.motion.rate
        positions = conventions.root_positions or "add"
        body = body_of(recording, mapping, conventions.unit, positions)
        for stretch in stretches:
            if stretch.document != document:
                continue
            start, end = frames.get(stretch) or (
                reading.source_start + round(stretch.start * rate),
                reading.source_start + round(stretch.end * rate),
            )
            part = slice(max(start, reading.source_start), min(end, len(recording.values)))
            if part.stop - part.start < max(FEWEST_POSES / RATE * rate, 2):
                raise FormatError(f"{_name(stretch)}: too short a motion to be blended")
            read[stretch] = (
                body,
                movement_of(
                    recording, mapping, conventions.unit, conventions.up, positions, part, rate
                ),
            )
    target = read[stretches[first]][0]
    movements = []
    for stretch in stretches:
        body, movement = read[stretch]
        difference = body_difference(target, body)
        if difference is not None:
            raise FormatError(
                f"{_name(stretch)}: has another skeleton than {_name(stretches[first])}: "
                f"{difference}; blend motions of one kind of skeleton"
            )
        movements.append(carried(movement, body, target))
    return target, movements


def _registration(
    body: Body,
    movements: Sequence[Movement],
    stretches: Sequence[Origin],
    ties: Sequence[Tie],
    examples: Sequence[int],
) -> Registration:
    durations = [(len(movement.places) - 1) / movement.rate for movement in movements]
    poses = [
        _poses(body, movement, duration)
        for movement, duration in zip(movements, durations, strict=True)
    ]
    query = movements[examples[0]]
    names = [_name(stretch) for stretch in stretches]
    return register(poses, durations, ties, examples, names, 2 * len(query.places) - 1)


def _poses(body: Body, movement: Movement, duration: float) -> FloatArray:
    """Return joint positions, about `RATE` a second, from the first frame to the last."""
    points = joint_points(body, movement)
    at = np.linspace(0, len(points) - 1, max(FEWEST_POSES, round(duration * RATE) + 1))
    before = np.minimum(at.astype(np.int64), len(points) - 2)
    part = (at - before)[:, None, None]
    poses: FloatArray = (1 - part) * points[before] + part * points[before + 1]
    return poses
