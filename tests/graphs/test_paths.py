import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError, StoreError
from mocapidx.graphs.paths import PathRules, empty_paths, find_paths
from mocapidx.graphs.paths_numpy import find_paths_numpy, mark_grid
from mocapidx.graphs.web_bytes import decode_paths, encode_paths, path_counts
from mocapidx.kernels.choice import compiled
from tests.naive_webs import minima_and_region

FAST = settings(max_examples=40, deadline=None)


def smooth_grid(seed, rows, columns, scale=1000.0):
    random = np.random.default_rng(seed)
    one, other = (random.normal(size=(n, 6)).cumsum(axis=0) for n in (rows, columns))
    gaps = np.linalg.norm(one[:, None] - other, axis=2)
    return np.minimum(gaps * scale, 65535).astype(np.uint16)


def wave_grid(frames=60):
    """Two motions of the same rhythm: diagonal valleys."""
    times = np.arange(frames)
    return (3000 * (1 - np.cos((times[:, None] - times) * 0.3)) + 100).astype(np.uint16)


limits = st.tuples(
    st.sampled_from([0, 50, 150, 600]),
    st.integers(1, 5),
    st.integers(2, 14),
    st.integers(1, 25),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
grids = st.builds(
    smooth_grid,
    st.integers(0, 999),
    st.integers(1, 45),
    st.integers(1, 45),
    st.sampled_from([1.0, 30.0, 1000.0, 60000.0]),
)


@FAST
@given(grids, st.none() | st.integers(-6, 6), limits)
def test_the_kernel_and_numpy_find_the_same_paths(grid, diagonal, limits):
    kernel = compiled("webs")
    if kernel is None:
        pytest.skip("the kernel was not built")
    found = kernel.find_paths(grid, *grid.shape, diagonal, *limits)
    for part, expected in zip(found, find_paths_numpy(grid, diagonal, *limits), strict=True):
        np.testing.assert_array_equal(np.frombuffer(part, expected.dtype), expected.ravel())


@FAST
@given(grids, st.sampled_from([0, 100, 150, 1000]), st.booleans())
def test_minima_and_region_are_those_of_the_definition(grid, alpha, stop_below):
    low, region = mark_grid(grid, alpha, stop_below)
    expected = minima_and_region(grid.tolist(), alpha / 1000, stop_below)
    assert {(i, j) for i, j in np.argwhere(low).tolist()} == expected[0]
    assert {(i, j) for i, j in np.argwhere(region).tolist()} == expected[1]


def steps_of(cells):
    return {tuple(step) for step in np.diff(cells, axis=0).tolist()}


def longest_run(cells, axis):
    return max(len(list(group)) for _, group in itertools.groupby(cells[:, axis].tolist()))


@FAST
@given(grids, st.none() | st.integers(-6, 6))
def test_paths_go_forward_within_the_slope_and_the_region(grid, diagonal):
    rules = PathRules(chain_seconds=0.1, bridge_seconds=0.5)
    paths = find_paths(grid, 30.0, rules, diagonal=diagonal)
    low, region = mark_grid(grid, 150, True)
    on_chains = {tuple(cell) for cell in paths.cells.tolist()}
    assert len(on_chains) == len(paths.cells)
    for start, end in itertools.pairwise(paths.starts):
        chain = paths.cells[start:end]
        assert low[*chain.T].all()
        assert steps_of(chain) <= {(1, 1), (1, 0), (0, 1)}
        assert max(longest_run(chain, 0), longest_run(chain, 1)) <= rules.slope
        assert (chain[-1] - chain[0]).sum() / 2 + 1 >= 0.1 * 30
    pairs = paths.ends[:, [0, 2]].tolist()
    assert len({tuple(pair) for pair in pairs}) == len(pairs)
    for number, (chain, place, other, there) in enumerate(paths.ends.tolist()):
        inner = paths.inner_cells[slice(*paths.inner_starts[number : number + 2])]
        ends = paths.cells[paths.starts[chain] + place], paths.cells[paths.starts[other] + there]
        whole = np.vstack((ends[0], inner, ends[1]))
        assert chain != other
        assert steps_of(whole) <= {(1, 1), (1, 0), (0, 1)}
        assert max(longest_run(whole, 0), longest_run(whole, 1)) <= rules.slope
        assert (whole[-1] - whole[0]).sum() < 0.5 * 30
        assert region[*inner.T].all()
        assert not on_chains & {tuple(cell) for cell in inner.tolist()}
    if diagonal is not None and len(paths.cells):
        assert (paths.cells[:, 1] > paths.cells[:, 0] - diagonal).all()
    np.testing.assert_array_equal(paths.values, grid[*paths.cells.T])


def test_motions_of_one_rhythm_have_a_chain_for_each_shift_by_a_period():
    paths = find_paths(wave_grid(), 30.0, PathRules())
    shifts = {int(np.diff(paths.cells[start])[0]) for start in paths.starts[:-1]}
    assert all(any(abs(s - 2 * np.pi / 0.3 * n) < 1.5 for s in shifts) for n in range(-2, 3))


def test_what_is_printed_in_the_paper_covers_more_and_breaks_more():
    grid = smooth_grid(3, 60, 60)
    region = [mark_grid(grid, 150, stop_below)[1].mean() for stop_below in (True, False)]
    assert region[1] > region[0]
    kept = [find_paths(grid, 30.0, PathRules(chain_seconds=0, restart=r)) for r in (True, False)]
    assert kept[0].chains > kept[1].chains


@pytest.mark.parametrize(
    "wrong", [{"alpha": -1}, {"slope": 0}, {"slope": 9}, {"bridge_seconds": 3}, {"window": 9}]
)
def test_rules_are_checked(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        PathRules(**wrong)


def test_a_rate_that_makes_bridges_too_long_is_refused():
    with pytest.raises(ParameterError, match="at a lower rate"):
        find_paths(wave_grid(), 120.0, PathRules())


@FAST
@given(grids, st.integers(0, 70_000), st.integers(0, 70_000))
def test_paths_survive_being_written_and_read(grid, row, column):
    paths = find_paths(grid, 30.0, PathRules(chain_seconds=0.1))
    data = encode_paths(paths, row, column)
    again = decode_paths(data)
    np.testing.assert_array_equal(again.cells, paths.cells + np.array([row, column]))
    np.testing.assert_array_equal(again.inner_cells - np.array([row, column]), paths.inner_cells)
    for name in ("starts", "values", "ends", "inner_starts", "inner_values"):
        np.testing.assert_array_equal(getattr(again, name), getattr(paths, name))
    counts = (paths.chains, len(paths.cells), paths.bridges, len(paths.inner_cells))
    assert path_counts(data) == counts


def test_a_grid_without_paths_is_written_too():
    assert decode_paths(encode_paths(empty_paths(), 1, 2)).chains == 0


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_changed_bytes_are_refused_or_make_paths_that_still_lead_forward(data):
    good = bytearray(encode_paths(find_paths(wave_grid(40), 30.0, PathRules()), 0, 0))
    for _ in range(data.draw(st.integers(1, 3))):
        good[data.draw(st.integers(0, len(good) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(good)))
    try:
        paths = decode_paths(bytes(good[: cut if cut % 5 == 0 else len(good)]))
    except StoreError:
        return
    assert (np.diff(paths.cells.sum(axis=1)) != 0).all() or not len(paths.cells)
