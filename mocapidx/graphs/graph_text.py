"""Match graphs as text: JSON, which holds all, and GraphML for programs that draw graphs."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from mocapidx.errors import FormatError, ParameterError
from mocapidx.graphs.match_graph import MatchEdge, MatchGraph, MatchNode
from mocapidx.model import IndexArray
from mocapidx.printable import shown

__all__ = ["graph_from_graphml", "graph_from_json", "graph_to_graphml", "graph_to_json"]

FORMAT: Final = "mocapidx-match-graph"
VERSION: Final = 1
MOST: Final = 1_000_000
"""Nodes, edges, or cells of an alignment that are read."""

LARGEST: Final = 2**53
"""Whole numbers up to here survive every JSON reader."""

KEYS: Final = {
    "graph": {"format": "string", "version": "int", "rate": "double", "epsilon": "double"},
    "node": {
        "document": "string",
        "start_frame": "int",
        "end_frame": "int",
        "start_time": "double",
        "end_time": "double",
        "tier": "int",
        "direct": "double",
        "distance": "double",
    },
    "edge": {"cost": "double", "alignment": "string"},
}
"""The data of a GraphML file; an alignment is written as pairs, ``0,0 1,1 1,2``."""


def graph_to_json(graph: MatchGraph) -> str:
    """Write a match graph as JSON.

    Parameters
    ----------
    graph : MatchGraph

    Returns
    -------
    str
        One object in ASCII: ``rate``, ``epsilon``, ``nodes`` and ``edges``; a node and an edge
        a line.
    """
    head = {"format": FORMAT, "version": VERSION, "rate": graph.rate, "epsilon": graph.epsilon}
    nodes = [
        json.dumps({"node": number, **_node_facts(node, graph.rate)})
        for number, node in enumerate(graph.nodes)
    ]
    edges = [
        json.dumps(
            {"nodes": [e.first, e.second], "cost": e.cost, "alignment": e.alignment.tolist()}
        )
        for e in graph.edges
    ]
    start = json.dumps(head)[:-1]
    return f'{start}, "nodes": [\n{_lines(nodes)}], "edges": [\n{_lines(edges)}]}}\n'


def _lines(texts: Sequence[str]) -> str:
    return "".join(f"{text}{',' * (n < len(texts))}\n" for n, text in enumerate(texts, start=1))


def _node_facts(node: MatchNode, rate: float) -> dict[str, Any]:
    return {
        "document": node.document,
        "start_frame": node.start_frame,
        "end_frame": node.end_frame,
        "start_time": round(node.start_frame / rate, 6),
        "end_time": round(node.end_frame / rate, 6),
        "tier": node.tier,
        "direct": node.direct,
        "distance": node.distance,
    }


def graph_from_json(text: str) -> MatchGraph:
    """Read what `graph_to_json` writes.

    Parameters
    ----------
    text : str

    Returns
    -------
    MatchGraph

    Raises
    ------
    FormatError
        If it is something else; the message says what is wrong, but not of which file.
    """
    try:
        whole = json.loads(text)
    except (ValueError, RecursionError) as exc:
        raise FormatError("not a match graph: not JSON") from exc
    if type(whole) is not dict or whole.get("format") != FORMAT:
        raise FormatError("not a match graph; make one with 'mocapidx match --graph'")
    if whole.get("version") != VERSION:
        raise FormatError(
            f"a match graph of version {shown(whole.get('version'), 20)}, this mocapidx reads "
            f"{VERSION}; upgrade if it is newer"
        )
    nodes = [_node(entry, f"node {number}") for number, entry in enumerate(_list(whole, "nodes"))]
    edges = [_edge(entry, f"edge {number}") for number, entry in enumerate(_list(whole, "edges"))]
    return _graph(whole, nodes, edges)


def _graph(
    whole: Mapping[str, Any], nodes: Sequence[MatchNode], edges: Sequence[MatchEdge]
) -> MatchGraph:
    rate, epsilon = (_number(whole, key, "the graph") for key in ("rate", "epsilon"))
    try:
        return MatchGraph(rate, epsilon, tuple(nodes), tuple(edges))
    except ParameterError as exc:
        raise FormatError(f"not a match graph: {exc}") from exc


def _node(entry: Any, where: str) -> MatchNode:
    if type(entry) is not dict or type(entry.get("document")) is not str:
        raise FormatError(f"not a match graph: {where} names no document")
    start, end, tier = (_whole(entry, key, where) for key in ("start_frame", "end_frame", "tier"))
    direct = None if entry.get("direct") is None else _number(entry, "direct", where)
    distance = _number(entry, "distance", where)
    return MatchNode(entry["document"], start, end, tier, direct, distance)


def _edge(entry: Any, where: str) -> MatchEdge:
    ends = entry.get("nodes") if type(entry) is dict else None
    if type(ends) is not list or len(ends) != 2:
        raise FormatError(f"not a match graph: {where} joins no two nodes")
    first, second = (_whole({"nodes": end}, "nodes", where) for end in ends)
    pairs = _list(entry, "alignment")
    if not all(type(p) is list and len(p) == 2 and {type(v) for v in p} == {int} for p in pairs):
        raise FormatError(f"not a match graph: {where} has an alignment that is no list of pairs")
    return MatchEdge(first, second, _number(entry, "cost", where), _pairs(pairs, where))


def _pairs(pairs: Sequence[Sequence[int]], where: str) -> IndexArray:
    if any(not 0 <= value < LARGEST for pair in pairs for value in pair):
        raise FormatError(f"not a match graph: {where} has an alignment beyond all frames")
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _list(entry: Mapping[str, Any], key: str) -> list[Any]:
    found = entry.get(key)
    if type(found) is not list or len(found) > MOST:
        raise FormatError(f"not a match graph: '{key}' is no list of at most {MOST}")
    return found


def _number(entry: Mapping[str, Any], key: str, where: str) -> float:
    found: Any = entry.get(key)
    if type(found) not in (int, float) or abs(found) > LARGEST or math.isnan(found):
        raise FormatError(f"not a match graph: '{key}' of {where} is no number")
    return float(found)


def _whole(entry: Mapping[str, Any], key: str, where: str) -> int:
    found = entry.get(key)
    if type(found) is not int or not 0 <= found < LARGEST:
        raise FormatError(f"not a match graph: '{key}' of {where} is no whole number from 0")
    return found


def graph_to_graphml(graph: MatchGraph) -> str:
    r"""Write a match graph as GraphML.

    Parameters
    ----------
    graph : MatchGraph

    Returns
    -------
    str
        An undirected graph; characters that XML does not have are written as ``\x1b``.
    """
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">',
    ]
    lines += [
        f'  <key id="{kind}_{name}" for="{kind}" attr.name="{name}" attr.type="{type_}"/>'
        for kind, names in KEYS.items()
        for name, type_ in names.items()
    ]
    lines.append('  <graph id="matches" edgedefault="undirected">')
    head = {"format": FORMAT, "version": VERSION, "rate": graph.rate, "epsilon": graph.epsilon}
    lines += _data("graph", head, "    ")
    for number, node in enumerate(graph.nodes):
        lines.append(f'    <node id="n{number}">')
        lines += _data("node", _node_facts(node, graph.rate), "      ")
        lines.append("    </node>")
    for edge in graph.edges:
        ends = f'source="n{edge.first}" target="n{edge.second}"'
        pairs = " ".join(f"{one},{other}" for one, other in edge.alignment.tolist())
        lines.append(f"    <edge {ends}>")
        lines += _data("edge", {"cost": edge.cost, "alignment": pairs}, "      ")
        lines.append("    </edge>")
    return "\n".join([*lines, "  </graph>", "</graphml>", ""])


def _data(kind: str, facts: Mapping[str, Any], indent: str) -> list[str]:
    return [
        f"{indent}<data key={quoteattr(f'{kind}_{name}')}>{escape(shown(str(value), None))}</data>"
        for name, value in facts.items()
        if value is not None
    ]


def graph_from_graphml(text: str) -> MatchGraph:
    """Read what `graph_to_graphml` writes.

    Parameters
    ----------
    text : str

    Returns
    -------
    MatchGraph
        Names with characters that XML does not have are as they were written.

    Raises
    ------
    FormatError
        If it is something else.
    """
    reader = _GraphmlReader()
    try:
        reader.parser.Parse(text.encode("utf-8", "surrogatepass"), True)
    except expat.ExpatError as exc:
        raise FormatError(f"not a match graph: not GraphML at line {exc.lineno}") from exc
    if reader.facts.get("format") != FORMAT or reader.facts.get("version") != VERSION:
        raise FormatError("not a match graph; make one with 'mocapidx match --graph'")
    nodes = [_node(facts, f"node {number}") for number, facts in enumerate(reader.nodes)]
    edges = [_edge(facts, f"edge {number}") for number, facts in enumerate(reader.edges)]
    return _graph(reader.facts, nodes, edges)


class _GraphmlReader:
    """Collects the data of nodes and edges; takes no document type, so no entities either."""

    def __init__(self) -> None:
        self.facts: dict[str, Any] = {}
        self.nodes: list[dict[str, Any]] = []
        self.edges: list[dict[str, Any]] = []
        self.owner = self.facts
        self.key, self.text = "", [""]
        self.parser = expat.ParserCreate("utf-8")  # the text is; it may say anything
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.gather
        self.parser.StartDoctypeDeclHandler = self.refuse

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        if tag in ("node", "edge") and len(self.nodes) + len(self.edges) >= MOST:
            raise FormatError(f"not a match graph: more than {MOST} nodes and edges")
        if tag == "node":
            if attributes.get("id") != f"n{len(self.nodes)}":
                raise FormatError("not a match graph of mocapidx: nodes are not in their order")
            self.owner = {}
            self.nodes.append(self.owner)
        elif tag == "edge":
            ends = [attributes.get(end, "") for end in ("source", "target")]
            self.owner = {"nodes": [_parsed(end[1:], "int") for end in ends]}
            self.edges.append(self.owner)
        elif tag == "data":
            self.key, self.text = attributes.get("key", ""), []

    def end(self, tag: str) -> None:
        if tag == "data":
            kind, _, name = self.key.partition("_")
            type_ = KEYS.get(kind, {}).get(name)
            text = "".join(self.text)
            if name == "alignment":
                self.owner[name] = [
                    [_parsed(value, "int") for value in pair.split(",")] for pair in text.split()
                ]
            elif type_ is not None:
                self.owner[name] = _parsed(text, type_)
        elif tag in ("node", "edge"):
            self.owner = self.facts

    def gather(self, text: str) -> None:
        self.text.append(text)

    def refuse(self, *_: object) -> None:
        raise FormatError("not a match graph: a document type has no place in it")


def _parsed(text: str, type_: str) -> Any:
    """Read a value; what can't be read stays text, which the checks refuse."""
    if type_ == "string" or len(text) > 40:
        return text
    try:
        return int(text) if type_ == "int" else float(text)
    except ValueError:
        return text
