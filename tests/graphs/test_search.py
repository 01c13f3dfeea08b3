from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError, StoreError
from mocapidx.graphs.frame_distance import METRES_A_STEP, distance_grid, frame_clouds
from mocapidx.graphs.paths import PathRules, find_paths
from mocapidx.graphs.search import SearchRules, Stretch, search_once, search_web
from mocapidx.graphs.search_paths import METRES_A_UNIT, search_paths
from mocapidx.graphs.sequences import find_sequences
from mocapidx.graphs.sequences_python import find_sequences_python
from mocapidx.graphs.sweep import SweepStep, chosen_step, sweep_web
from mocapidx.kernels.choice import compiled
from tests.graphs.test_paths import smooth_grid
from tests.made_webs import gesture
from tests.naive_webs import least_path

ALL = np.ones(24, dtype=bool)


class SmallWeb:
    """All pairs of a few motions, in memory."""

    def __init__(self, motions, rules=None, rate=30.0):
        self.motions, self.rate, self.grids, self.parts = motions, rate, {}, {}
        clouds = {name: frame_clouds(poses, ALL, 3) for name, poses in motions.items()}
        names = sorted(motions)
        for a, one in enumerate(names):
            for other in names[a:]:
                diagonal = 0 if one == other else None
                grid = distance_grid(clouds[one], clouds[other], diagonal=diagonal)
                grid = (grid + 2) // 5
                paths = find_paths(grid, rate, rules or PathRules(), diagonal=diagonal)
                laid_out = search_paths(paths)
                self.grids[one, other] = grid
                self.grids[other, one] = grid.T
                self.parts.setdefault(one, []).append((other, 0, laid_out))
                self.parts.setdefault(other, []).append((one, 1, laid_out))

    def frames(self, document):
        return len(self.motions[document])

    def pieces(self, document):
        return self.parts.get(document, [])


@pytest.fixture(scope="module")
def web():
    motions = {f"arm{n}": gesture(size=1 + 0.25 * n, before=12 + n, seed=n) for n in range(5)}
    motions["noise"] = gesture(size=0, seed=9) + np.sin(np.arange(60) / 3)[:, None, None] * 0.4
    return SmallWeb(motions)


def test_every_match_costs_what_its_path_does_and_no_less_than_the_best_path(web):
    query = Stretch("arm0", 10, 46)
    matches = search_once(web, query, SearchRules(epsilon=0.3))
    assert {match.stretch.document for match in matches} >= {"arm1", "arm2", "arm3"}
    for match in matches:
        grid = web.grids["arm0", match.stretch.document].astype(float) * METRES_A_UNIT
        cells = match.cells()
        assert match.cost == pytest.approx(grid[*cells.T].mean())
        ends = tuple(cells[0].tolist()), tuple(cells[-1].tolist())
        total, count = least_path(grid, *ends, steepest=6)  # bridges start counting afresh
        assert total - 1e-9 <= match.cost * len(cells)
        assert match.cost <= 1.3 * total / count + 0.02
        assert abs(cells[0, 0] - 10) <= 3
        assert abs(cells[-1, 0] - 45) <= 3


def test_a_single_step_finds_what_brute_force_over_all_stretches_finds_most_alike(web):
    query = Stretch("arm0", 10, 46)
    for name in ("arm1", "arm2"):
        grid = web.grids["arm0", name].astype(float) * METRES_A_UNIT
        costs = {}
        for first in range(4, 20, 3):
            for last in range(36, 56, 3):
                total, count = least_path(grid, (10, first), (45, last), steepest=3)
                costs[first, last] = total / count
        first, last = min(costs, key=costs.get)
        found = [
            m
            for m in search_once(web, query, SearchRules(epsilon=0.3))
            if m.stretch.document == name
        ]
        shared = min(found[0].stretch.end, last + 1) - max(found[0].stretch.start, first)
        assert shared / (found[0].stretch.end - found[0].stretch.start) > 0.7
        assert found[0].cost <= costs[first, last] + 0.03


def test_steps_reach_what_is_far_from_the_query_by_what_lies_between(web):
    query = Stretch("arm0", 10, 46)
    costs = {m.stretch.document: m.cost for m in search_once(web, query, SearchRules(epsilon=1))}
    epsilon = (costs["arm1"] + costs["arm3"]) / 2
    once, _ = search_web(web, query, SearchRules(epsilon=epsilon, steps=1), 30.0)
    often, full = search_web(web, query, SearchRules(epsilon=epsilon), 30.0)
    assert "arm4" not in {node.document for node in once.nodes}
    far = next(node for node in often.nodes if node.document == "arm4")
    assert far.tier > 1
    assert far.direct is None
    assert far.distance > epsilon
    assert not full
    distances = [node.distance for node in often.nodes]
    assert distances == sorted(distances)
    assert all(edge.cost <= epsilon for edge in often.edges)


def test_the_number_of_matches_is_bounded(web):
    graph, full = search_web(web, Stretch("arm0", 10, 46), SearchRules(epsilon=1, most=2), 30.0)
    assert full
    assert len(graph.nodes) == 3


def test_both_orders_of_two_documents_find_each_other(web):
    one = search_once(web, Stretch("arm1", 10, 46), SearchRules(epsilon=0.3))
    other = search_once(web, Stretch("arm2", 10, 46), SearchRules(epsilon=0.3))
    costs = [
        next(m.cost for m in one if m.stretch.document == "arm2"),
        next(m.cost for m in other if m.stretch.document == "arm1"),
    ]
    assert costs[0] == pytest.approx(costs[1], abs=0.01)


@pytest.mark.parametrize(
    "change", [{"union": False}, {"keep": False}, {"slack": 0.0}, {"other": 0.7}, {"same": 0.5}]
)
def test_every_rule_can_be_changed(web, change):
    graph, _ = search_web(
        web, Stretch("arm0", 10, 46), replace(SearchRules(epsilon=0.2), **change), 30.0
    )
    assert graph.nodes[0].document == "arm0"
    assert (graph.nodes[0].start_frame, graph.nodes[0].end_frame) == (10, 46)


@pytest.mark.parametrize(
    "wrong", [{"epsilon": 0}, {"most": 0}, {"slack": 0.6}, {"same": 0.1}, {"steps": 0}]
)
def test_rules_are_checked(wrong):
    with pytest.raises(ParameterError):
        SearchRules(**wrong)


def test_a_query_must_lie_in_its_document(web):
    with pytest.raises(ParameterError, match="no frames"):
        search_once(web, Stretch("arm0", 10, 61), SearchRules())


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 500),
    st.integers(0, 1),
    st.integers(0, 20),
    st.integers(0, 25),
    st.integers(0, 4),
    st.floats(0.5, 6),
)
def test_the_kernel_and_python_find_the_same_sequences(seed, role, first, length, slack, epsilon):
    grid = smooth_grid(seed, 45, 50, 1000.0)
    found = search_paths(find_paths(grid, 30.0, PathRules(chain_seconds=0.1, bridge_seconds=0.7)))
    limits = role, first, min(first + length, 44), slack, int(epsilon / METRES_A_UNIT)
    kernel = compiled("sequences")
    if kernel is None:
        pytest.skip("the kernel was not built")
    table, states = find_sequences_python(found, *limits)
    parts = kernel.find_sequences(*found.arrays, *limits)
    np.testing.assert_array_equal(np.frombuffer(parts[0], np.int64), table.ravel())
    np.testing.assert_array_equal(np.frombuffer(parts[1], np.int64), states.ravel())
    sequences = find_sequences(found, *limits[:4], epsilon)
    for number in range(len(sequences)):
        cells = sequences.cells(number)
        rows = grid if role == 0 else grid.T
        assert sequences.costs[number] == pytest.approx(rows[*cells.T].mean() * METRES_A_UNIT)
        steps = {tuple(step) for step in np.diff(cells, axis=0).tolist()}
        assert steps <= {(1, 1), (1, 0), (0, 1)}


@pytest.mark.parametrize("kernels", ["c", "numpy"])
def test_a_web_that_contradicts_itself_is_refused(kernels, monkeypatch):
    if kernels == "c" and compiled("sequences") is None:
        pytest.skip("the kernel was not built")
    paths = find_paths(smooth_grid(3, 60, 60), 30.0, PathRules(chain_seconds=0.1))
    ends = paths.ends.copy()
    ends[:, 2] = 1_000_000
    if kernels == "numpy":
        monkeypatch.setattr("mocapidx.graphs.sequences.compiled", lambda name: None)
    with pytest.raises(StoreError, match="contradicts itself"):
        find_sequences(search_paths(replace(paths, ends=ends)), 0, 5, 40, 4, 10.0)


def test_steps_of_grids_and_units_of_files_fit_each_other():
    assert round(METRES_A_UNIT / METRES_A_STEP, 9) == 5


def made_steps(*counts, full_from=1000):
    graph = search_web(SmallWeb({"a": gesture()}), Stretch("a", 0, 20), SearchRules(), 30.0)[0]
    return [
        SweepStep(0.1 + 0.01 * n, replace(graph, nodes=graph.nodes * (count + 1), edges=()), c)
        for n, (count, c) in enumerate((c, c >= full_from) for c in counts)
    ]


@pytest.mark.parametrize(
    ("counts", "chosen"),
    [
        ((0, 0, 0), 2),
        ((1, 9, 9, 400), 2),
        ((5, 17, 17, 17), 3),
        ((3, 16, 17, 300), 2),
        ((0, 0, 400), 2),
        ((150, 300), 1),
    ],
)
def test_epsilon_is_chosen_before_the_number_of_matches_jumps(counts, chosen):
    steps = made_steps(*counts)
    assert chosen_step(steps) is steps[chosen]


def test_a_sweep_ends_with_the_first_full_search(web):
    steps = list(
        sweep_web(web, Stretch("arm0", 10, 46), SearchRules(most=1), 30.0, (0.1, 1.0, 2.0))
    )
    assert [step.epsilon for step in steps][-1] < 2.0
    assert steps[-1].full
