"""Match graphs as files: JSON and GraphML, written and read, and pictures."""

from pathlib import Path
from typing import Final

from mocapidx.durable import durable_replace
from mocapidx.errors import FormatError, ParameterError
from mocapidx.graphs.graph_text import (
    graph_from_graphml,
    graph_from_json,
    graph_to_graphml,
    graph_to_json,
)
from mocapidx.graphs.match_graph import MatchGraph
from mocapidx.printable import shown
from mocapidx.store.read import Snapshot
from mocapidx.tasks.bounded import read_at_most
from mocapidx.tasks.stored import stored_poses

__all__ = ["graph_kind", "read_graph", "save_graph"]

MOST_BYTES: Final = 1 << 30
KINDS: Final = ("json", "graphml", "png", "svg")


def graph_kind(path: Path) -> str:
    """Say how a match graph is to be written, to be asked before any work is done.

    Parameters
    ----------
    path : Path

    Returns
    -------
    {"json", "graphml", "png", "svg"}

    Raises
    ------
    ParameterError
        If the suffix of the file is another.
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in KINDS:
        raise ParameterError(
            f"{shown(path)}: match graphs are .json or .graphml files, drawn ones .png or .svg"
        )
    return kind


def save_graph(path: Path, graph: MatchGraph, store: Snapshot) -> None:
    """Write a match graph, or a picture of it.

    Parameters
    ----------
    path : Path
        Its suffix says how.
    graph : MatchGraph
    store : Snapshot
        Has the poses for a picture.

    Raises
    ------
    ParameterError
        If the suffix is unknown.
    WriteError
        If it could not be written.
    """
    kind = graph_kind(path)
    if kind == "json":
        data = graph_to_json(graph).encode("ascii")
    elif kind == "graphml":
        data = graph_to_graphml(graph).encode("utf-8", "backslashreplace")
    else:
        data = _picture(graph, store, kind)
    durable_replace(path, data)


def _picture(graph: MatchGraph, store: Snapshot, kind: str) -> bytes:
    from mocapidx.reports.match_graphs import MOST_DRAWN, match_graph_picture

    placed = {entry.document.name: entry for entry in store.documents()}
    poses = [
        stored_poses(store, placed[node.document])[(node.start_frame + node.end_frame) // 2]
        for node in graph.nodes[:MOST_DRAWN]
    ]
    return match_graph_picture(graph, poses, suffix=kind)


def read_graph(path: Path) -> MatchGraph:
    """Read a match graph that `save_graph` wrote.

    Parameters
    ----------
    path : Path
        ``.graphml``, else JSON.

    Returns
    -------
    MatchGraph

    Raises
    ------
    FormatError
        If it can't be read or is something else.
    """
    try:
        if not path.is_file():
            raise FormatError(f"{shown(path)}: no such file, or no regular file")
        with path.open("rb") as file:
            data = read_at_most(file, MOST_BYTES)
    except OSError as exc:
        raise FormatError(f"{shown(path)}: can't be read ({exc.strerror})") from exc
    if len(data) > MOST_BYTES:
        raise FormatError(f"{shown(path)}: larger than {MOST_BYTES >> 20} MiB")
    text = data.decode("utf-8-sig", "surrogateescape")
    try:
        return (graph_from_graphml if path.suffix.lower() == ".graphml" else graph_from_json)(text)
    except FormatError as exc:
        raise FormatError(f"{shown(path)}: {exc}") from exc
