import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.errors import FormatError, ParameterError
from mocapidx.graphs.graph_text import (
    graph_from_graphml,
    graph_from_json,
    graph_to_graphml,
    graph_to_json,
)
from mocapidx.graphs.match_graph import (
    MatchEdge,
    MatchGraph,
    MatchNode,
    fitted_alignment,
    path_edges,
    shortest_paths,
)


def diagonal(frames):
    return np.repeat(np.arange(frames, dtype=np.int64)[:, None], 2, axis=1)


def graph_of(costs, nodes, frames=4, name="walk.bvh"):
    edges = [MatchEdge(a, b, cost, diagonal(frames)) for (a, b), cost in sorted(costs.items())]
    made = [
        MatchNode(name, 10 * n, 10 * n + frames, min(n, 1), None if n else 0.0, 0.1 * n)
        for n in range(nodes)
    ]
    return MatchGraph(30.0, 0.18, tuple(made), tuple(edges))


@st.composite
def graphs(draw):
    nodes = draw(st.integers(1, 6))
    pairs = list(itertools.combinations(range(nodes), 2))
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    costs = {pair: draw(st.integers(0, 8)) / 4 for pair in chosen}
    return graph_of(costs, nodes, name=draw(st.text(min_size=1, max_size=8)))


@given(graphs())
def test_shortest_paths_are_those_of_all_simple_paths(graph):
    costs = {(e.first, e.second): e.cost for e in graph.edges}
    paths = shortest_paths(graph)
    others = range(1, len(graph.nodes))
    for node in others:
        ways = [
            (0, *middle, node)
            for size in range(len(graph.nodes))
            for middle in itertools.permutations([n for n in others if n != node], size)
        ]
        totals = [
            sum(costs.get((min(s), max(s)), math.inf) for s in itertools.pairwise(way))
            for way in ways
        ]
        assert paths.distances[node] == min(totals)
        way = paths.path(node)
        if way:
            assert (way[0], way[-1]) == (0, node)
            assert sum(e.cost for e in path_edges(graph, paths, node)) == paths.distances[node]
        else:
            assert math.isinf(min(totals))


@pytest.mark.parametrize(
    ("write", "read"),
    [(graph_to_json, graph_from_json), (graph_to_graphml, graph_from_graphml)],
)
@given(graph=graphs())
def test_graphs_survive_being_written_and_read(graph, write, read):
    again = read(write(graph))
    assert (again.rate, again.epsilon) == (graph.rate, graph.epsilon)
    for one, other in zip(again.nodes, graph.nodes, strict=True):
        if other.document.isprintable():
            assert one == other
        assert one.start_frame == other.start_frame
    for one, other in zip(again.edges, graph.edges, strict=True):
        assert (one.first, one.second, one.cost) == (other.first, other.second, other.cost)
        np.testing.assert_array_equal(one.alignment, other.alignment)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[" * 100_000,
        '{"format": "mocapidx-match-graph", "version": 2}',
        '{"format": "mocapidx-match-graph", "version": 1, "rate": 30, "epsilon": 1, "nodes": 1}',
        graph_to_json(graph_of({(0, 1): 0.5}, 2)).replace('"cost": 0.5', '"cost": NaN'),
        graph_to_json(graph_of({(0, 1): 0.5}, 2)).replace('"rate": 30.0', '"rate": 1e-320'),
        graph_to_json(graph_of({(0, 1): 0.5}, 2)).replace("[1, 1]", "[1, 1e9]"),
        graph_to_json(graph_of({(0, 1): 0.5}, 2)).replace("[1, 1]", f"[1, {10**30}]"),
        graph_to_json(graph_of({(0, 1): 0.5}, 2)).replace("[1, 1]", "[7, 7]"),
        graph_to_json(graph_of({(0, 1): 0.5}, 2)).replace('"nodes": [0, 1]', '"nodes": [0, 7]'),
    ],
)
def test_what_is_no_graph_is_refused(text):
    with pytest.raises(FormatError, match="match graph"):
        graph_from_json(text)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<graphml/>",
        '<!DOCTYPE a [<!ENTITY b "bbbb">]><graphml>&b;</graphml>',
        graph_to_graphml(graph_of({(0, 1): 0.5}, 2)).replace(">0.5<", ">much<"),
        graph_to_graphml(graph_of({(0, 1): 0.5}, 2)).replace('target="n1"', 'target="nobody"'),
        graph_to_graphml(graph_of({(0, 1): 0.5}, 2)).replace("1,1", "1,1,1"),
    ],
)
def test_graphml_that_is_no_match_graph_is_refused(text):
    with pytest.raises(FormatError, match="match graph"):
        graph_from_graphml(text)


def test_a_graph_holds_alignments_from_corner_to_corner():
    with pytest.raises(ParameterError, match="from the first frames to the last"):
        MatchGraph(
            30.0,
            1.0,
            (MatchNode("a", 0, 4, 0, 0.0, 0.0), MatchNode("a", 9, 14, 1, 0.1, 0.1)),
            (MatchEdge(0, 1, 0.1, diagonal(4)),),
        )


@given(
    st.lists(st.sampled_from([(0, 1), (1, 0), (1, 1)]), max_size=30),
    st.tuples(st.integers(0, 9), st.integers(0, 9)),
    st.tuples(st.integers(0, 20), st.integers(1, 20)),
    st.tuples(st.integers(0, 20), st.integers(1, 20)),
)
def test_an_alignment_fitted_to_stretches_joins_their_corners_along_the_path(
    steps, origin, first, second
):
    cells = np.cumsum(np.array([origin, *steps], dtype=np.int64), axis=0)
    (start, length), (other, width) = first, second
    path = fitted_alignment(cells, (start, start + length), (other, other + width))
    assert path[0].tolist() == [0, 0]
    assert path[-1].tolist() == [length - 1, width - 1]
    moves = np.diff(path, axis=0)
    assert ((moves >= 0) & (moves <= 1)).all()
    assert moves.any(axis=1).all()
    kept = {tuple(cell) for cell in (path + np.array([start, other])).tolist()}
    inside = {
        (i, j)
        for i, j in cells.tolist()
        if start <= i < start + length and other <= j < other + width
    }
    assert inside <= kept
